//! The water is heavier or lighter than stated.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::plant::{Balance, Foil, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "water_density",
    path: Path::Blade,
    what: "the density of the water is not the stated one: salt, temperature, a constant share of bubbles",
    equation: "rho (1 + e); e [1]; 998 fresh, 1025 kg/m^3 sea",
    signature: "thrust and torque over speed squared are off by the same percentage; thrust per torque and thrust at a given \
                torque are unchanged",
    confused_with: &["air_ingestion", "thrust_bias_gain_hysteresis", "windage_drag", "duct_loss"],
    separated_by: "temperature and salinity of the water; shaft speed together with thrust and torque",
    reference: "Fofonoff & Millard 1983 (UNESCO Tech. Pap. Mar. Sci. 44)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: wet,
    build: both!(|values, _| Box::new(WaterDensity { factor: values[0] + 1.0 })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![Spec::strength("density_error", "1", 0.03, -0.6, 0.3).sigma(0.05)]
}

struct WaterDensity<T> {
    factor: T,
}

impl<T: Real> Effect<T> for WaterDensity<T> {
    fn hooks(&self) -> Hooks {
        Hooks { foil: true, balance: true, ..Hooks::NONE }
    }

    fn foil(&self, _: &Local<T>, _: &[T], foil: &mut Foil<T>) {
        foil.density_kg_m3 *= self.factor;
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.flux_kg_m *= self.factor;
        balance.added_mass_kg *= self.factor;
    }
}
