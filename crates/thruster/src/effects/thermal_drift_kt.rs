//! The magnets warm and torque per ampere falls.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "thermal_drift_kt",
    path: Path::Drive,
    what: "the motor warms with its copper loss and the torque constant falls, slowly, and recovers at rest",
    equation: "kt = kt0 (1 - c w), tt w' = im^2 - w; c = aT R Rt [1/A^2], tt = Ct Rt [s]",
    signature: "thrust per ampere decays over minutes under load and recovers after a rest; thrust over speed squared is unchanged",
    confused_with: &[
        "torque_constant_saturation",
        "tank_recirculation",
        "viscous_friction",
        "supply_sag",
        "friction_warm_up",
    ],
    separated_by: "a long hold with rests; recirculation changes thrust over speed squared, warming oil acts the other way",
    reference: "Krishnan 2001, Electric Motor Drives; one thermal mass",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: |scale| {
        let full = 1.0 / scale.current_a.powi(2);
        [0.1, 1.0, 3.0]
            .iter()
            .map(|share| vec![0.05 * full, (share * scale.duration_s).clamp(4.0, 2000.0)])
            .collect()
    },
    needs: free_shaft,
    build: both!(|values, _| Box::new(ThermalDriftKt { loss_per_a2: values[0], lag_s: values[1] })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = 1.0 / scale.current_a.powi(2);
    vec![
        Spec::strength("kt_loss_per_a2", "1/A^2", 0.05 * full, 0.0, full).sigma(0.1 * full),
        Spec::shape("warming_time_s", "s", (0.3 * scale.duration_s).clamp(5.0, 600.0), 3.0, 3000.0)
            .sigma((0.3 * scale.duration_s).clamp(5.0, 600.0)),
    ]
}

struct ThermalDriftKt<T> {
    loss_per_a2: T,
    lag_s: T,
}

impl<T: Real> Effect<T> for ThermalDriftKt<T> {
    fn states(&self) -> usize {
        1
    }

    fn slow(&self) -> bool {
        true
    }

    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    /// The form exp(-c w) is 1 - c w where the loss is small and never turns the torque round.
    fn balance(&self, at: &Local<T>, own: &[T], balance: &mut Balance<T>, rates: &mut [T]) {
        balance.motor_torque_n_m *= (-self.loss_per_a2 * own[0]).exp();
        rates[0] = (at.current_a * at.current_a - own[0]) / self.lag_s;
    }
}
