//! Bubbles in the water lower its density.

use super::knots::{self, Knots};
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::plant::{Balance, Foil, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "air_ingestion",
    path: Path::Blade,
    what: "bubbly water: air stirred in from the surface, a wake or a leak makes the mixture lighter, now more, now less",
    equation: "rho (1 - f(t)) at the blades, rho (1 - k f(t)) in the column ahead and behind; f(t) straight between knots [1], \
               counted from its mean where the coefficients are free to take that; k from 0, bubbles at the disc only, to 1. A \
               share that does not change is an error of density (water_density)",
    signature: "thrust and torque fall by the same fraction and come back, without a command and unlike an inflow: the shaft \
                speeds up while thrust falls, nothing shows at rest",
    confused_with: &["ventilation", "water_density", "cavitation", "ambient_flow_unsteady"],
    separated_by: "thrust over speed squared against torque over speed squared (same fraction) at one held speed for minutes",
    reference: "density of the mixture; straight pieces are kort's form",
    commonness: 0.2,
    shifts_time: false,
    nonparametric: true,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: wet,
    build: both!(|values, _| Box::new(AirIngestion {
        column_share: values[0],
        fraction: Knots::new(&values[1..])
    })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let mut specs = knots::specs(scale, &knots::SHARE, "1", 0.05, (-0.5, 0.7), 0.1);
    specs.insert(0, Spec::shape("column_share", "1", 0.5, 0.0, 1.0).sigma(0.4));
    specs
}

struct AirIngestion<T> {
    column_share: T,
    fraction: Knots<T>,
}

impl<T: Real> Effect<T> for AirIngestion<T> {
    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    fn foil(&self, at: &Local<T>, _: &[T], foil: &mut Foil<T>) {
        foil.density_kg_m3 *= T::ONE - self.fraction.at(at.time_s);
    }

    /// Bubbles drawn in at the disc leave the column its mass; bubbles that come with the water do not.
    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let left = T::ONE - self.column_share * self.fraction.at(at.time_s);
        balance.flux_kg_m *= left;
        balance.added_mass_kg *= left;
    }
}
