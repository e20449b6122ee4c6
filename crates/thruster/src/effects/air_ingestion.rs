//! Bubbles in the water lower its density.

use super::knots::{self, Knots};
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::plant::{Balance, Foil, Local};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "air_ingestion",
    path: Path::Blade,
    what: "bubbly water: air stirred in from the surface, a wake or a leak makes the mixture lighter, now more, now less",
    equation: "rho (1 - f(t)); f(t) straight between knots [1], counted from its mean where the coefficients are free to take \
               that. A share that does not change is an error of density (water_density)",
    signature: "thrust and torque fall by the same fraction and come back, without a command and unlike an inflow: the shaft \
                speeds up while thrust falls, nothing shows at rest",
    confused_with: &["ventilation", "water_density", "cavitation", "ambient_flow_unsteady"],
    separated_by: "thrust over speed squared against torque over speed squared (same fraction) at one held speed for minutes",
    reference: "density of the mixture; straight pieces are kort's form",
    parameters,
    starts: one_start,
    needs: wet,
    build: |values, _| Box::new(AirIngestion { fraction: Knots::new(values) }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    knots::specs(scale, &knots::SHARE, "1", 0.05, -0.5, 0.7)
}

struct AirIngestion {
    fraction: Knots,
}

impl Effect for AirIngestion {
    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    fn foil(&self, at: &Local, _: &[f64], foil: &mut Foil) {
        foil.density_kg_m3 *= 1.0 - self.fraction.at(at.time_s);
    }

    /// The water ahead of and behind the blades is the same mixture.
    fn balance(&self, at: &Local, _: &[f64], balance: &mut Balance, _: &mut [f64]) {
        let left = 1.0 - self.fraction.at(at.time_s);
        balance.flux_kg_m *= left;
        balance.added_mass_kg *= left;
    }
}
