//! Iron saturates: torque per ampere falls at high current.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "torque_constant_saturation",
    path: Path::Drive,
    what: "the motor's iron saturates, so torque per ampere falls as current rises",
    equation: "tau = kt im/(1 + ks im^2); ks [1/A^2]",
    signature: "torque falls short at high current, alike in both directions; thrust per ampere sags with |im|; thrust \
                over speed squared is unchanged",
    confused_with: &["coulomb_friction", "windage_drag", "thermal_drift_kt", "current_saturation"],
    separated_by: "torque with the rotor locked; a staircase in both directions (Coulomb friction has the opposite trend)",
    reference: "Krishnan 2001, Electric Motor Drives",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: free_shaft,
    build: both!(|values, _| Box::new(TorqueConstantSaturation { per_a2: values[0] })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = 1.0 / scale.current_a.powi(2);
    vec![Spec::strength("saturation_per_a2", "1/A^2", 0.04 * full, 0.0, 2.0 * full).sigma(0.15 * full)]
}

struct TorqueConstantSaturation<T> {
    per_a2: T,
}

impl<T: Real> Effect<T> for TorqueConstantSaturation<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.motor_torque_n_m /= self.per_a2 * at.current_a * at.current_a + 1.0;
    }
}
