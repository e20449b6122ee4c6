//! The stated inertia is wrong.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "rotor_inertia_error",
    path: Path::Shaft,
    what: "the stated inertia of motor, shaft and propeller is off, beyond its tolerance and in either direction",
    equation: "I (1 + e) Om' = ...; e [1]",
    signature: "shaft speed rises and falls more slowly (or faster) than modelled; the torque residual follows Om'; \
                steady states fit",
    confused_with: &[
        "entrained_water_inertia",
        "inertia_added_mass_error",
        "amplifier_lag",
        "rotational_flow",
    ],
    separated_by: "small fast variations of torque about zero speed; a coast-down in air against one in water",
    reference: "Healey et al. 1995 (IEEE JOE 20:354), equation (10)",
    commonness: 2.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: free_shaft,
    build: both!(|values, _| Box::new(RotorInertiaError { factor: values[0] + 1.0 })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![Spec::strength("inertia_error", "1", 0.15, -0.8, 5.0).sigma(0.3)]
}

struct RotorInertiaError<T> {
    factor: T,
}

impl<T: Real> Effect<T> for RotorInertiaError<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.inertia_kg_m2 *= self.factor;
    }
}
