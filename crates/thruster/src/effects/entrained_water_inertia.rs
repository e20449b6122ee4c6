//! Water that turns with the propeller adds to its inertia.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start, wet};
use crate::plant::{Balance, Local};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "entrained_water_inertia",
    path: Path::Shaft,
    what: "water carried round by the blades adds to the inertia of the shaft; the same equation as an inertia stated \
           too low (rotor_inertia_error)",
    equation: "(I + Ia) Om' = ...; Ia >= 0 [kg m^2]",
    signature: "shaft speed rises and falls more slowly than modelled, without overshoot; the torque residual follows \
                Om'; steady states fit",
    confused_with: &["rotor_inertia_error", "inertia_added_mass_error", "amplifier_lag", "rotational_flow"],
    separated_by: "a coast-down in air against one in water; small fast variations of torque about zero speed",
    reference: "Newman 1977, Marine Hydrodynamics (added moment of inertia); equation (10)",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs,
    build: both!(|values, _| Box::new(EntrainedWater { inertia_kg_m2: values[0] })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let stated = scale.inertia_kg_m2;
    vec![
        Spec::strength("entrained_inertia_kg_m2", "kg m^2", 0.15 * stated, 0.0, 5.0 * stated)
            .sigma(0.5 * stated),
    ]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    wet(rig, available)?;
    free_shaft(rig, available)
}

struct EntrainedWater<T> {
    inertia_kg_m2: T,
}

impl<T: Real> Effect<T> for EntrainedWater<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.inertia_kg_m2 += self.inertia_kg_m2;
    }
}
