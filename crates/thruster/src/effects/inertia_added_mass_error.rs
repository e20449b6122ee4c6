//! The accelerated mass of water is not the stated one.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, wet};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "inertia_added_mass_error",
    path: Path::Flow,
    what: "the mass of water that the propeller accelerates is off, beyond the tolerance of its added-mass coefficient",
    equation: "T = m (1 + e) vp' + ...; m = rho a l gamma [kg], e [1]",
    signature: "axial flow rises more slowly (or faster) than modelled, and with it thrust overshoots longer; steady states fit",
    confused_with: &[
        "entrained_water_inertia",
        "rotor_inertia_error",
        "unsteady_lift_lag",
        "flowmeter_offset_lag_location",
        "rotational_flow",
    ],
    separated_by: "steps of shaft speed under a speed loop (the shaft's inertia drops out), with flow or thrust recorded",
    reference: "equation (2); Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |_| vec![vec![-0.3], vec![1.0]],
    needs: wet,
    build: both!(|values, _| Box::new(AddedMassError { factor: values[0] + 1.0 })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![Spec::strength("added_mass_error", "1", 0.2, -0.8, 6.0).sigma(0.5)]
}

struct AddedMassError<T> {
    factor: T,
}

impl<T: Real> Effect<T> for AddedMassError<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.added_mass_kg *= self.factor;
    }
}
