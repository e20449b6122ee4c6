//! Bubbles in the water lower its density.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::plant::{Balance, Foil, Local};

/// Width of the onset, as a share of the onset speed.
const WIDTH: f64 = 0.15;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "air_ingestion",
    path: Path::Blade,
    what: "the propeller stirs bubbles into the water it works in, the more the faster it turns; the mixture is lighter",
    equation: "rho (1 - f e), ta e' = s[(|Om|/on - 1)/0.15] - e, s logistic; f [1], on [rad/s], ta [s]. A constant share of \
               bubbles is an error of density (water_density)",
    signature: "thrust and torque fall by the same fraction at high speed, slowly, and recover slowly",
    confused_with: &["ventilation", "water_density", "cavitation"],
    separated_by: "thrust over speed squared against torque over speed squared (same fraction); long holds with rests",
    reference: "density of the mixture; the onset with speed is kort's form",
    parameters,
    starts: |scale| {
        let full = scale.shaft_speed_rad_s;
        vec![vec![0.05, 0.05 * full, 0.1], vec![0.05, 0.4 * full, 0.5], vec![0.05, 0.4 * full, 5.0], vec![0.05, 0.8 * full, 0.5]]
    },
    needs: wet,
    build: |values, _| Box::new(AirIngestion { fraction: values[0], onset_rad_s: values[1], lag_s: values[2] }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.shaft_speed_rad_s;
    vec![
        Spec::strength("air_fraction", "1", 0.05, 0.0, 0.7),
        Spec::shape("onset_speed_rad_s", "rad/s", 0.6 * full, 0.02 * full, 1.3 * full),
        Spec::shape("lag_s", "s", 2.0, 0.02, 60.0),
    ]
}

struct AirIngestion {
    fraction: f64,
    onset_rad_s: f64,
    lag_s: f64,
}

impl Effect for AirIngestion {
    fn states(&self) -> usize {
        1
    }

    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    fn foil(&self, _: &Local, own: &[f64], foil: &mut Foil) {
        foil.density_kg_m3 *= 1.0 - self.fraction * own[0];
    }

    /// The water ahead of and behind the blades is the same mixture.
    fn balance(&self, at: &Local, own: &[f64], balance: &mut Balance, rates: &mut [f64]) {
        let left = 1.0 - self.fraction * own[0];
        balance.flux_kg_m *= left;
        balance.added_mass_kg *= left;
        let past = at.shaft_speed_rad_s.abs() / self.onset_rad_s - 1.0;
        rates[0] = (super::logistic(past / WIDTH) - own[0]) / self.lag_s;
    }
}
