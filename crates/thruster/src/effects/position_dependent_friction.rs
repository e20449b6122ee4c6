//! Friction that varies over the turn: a bent shaft, an uneven seal or screw.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, turns_round};
use crate::plant::{Balance, Local};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "position_dependent_friction",
    path: Path::Shaft,
    what: "a bent shaft, an uneven seal or a worn screw rubs more at some angles than at others",
    equation: "I Om' = ... - t0 max(1 + a1 sin q + b1 cos q + a2 sin 2q + b2 cos 2q, 0) sgn(Om); t0 [N m], a, b [1], q shaft \
               angle [rad]",
    signature: "lines at orders 1 and 2 of shaft angle in the shaft's torque balance that change sign with the direction of \
                turning (cogging does not)",
    confused_with: &["torque_ripple_cogging", "encoder_eccentricity", "coulomb_friction"],
    separated_by: "a slow creep over full turns in both directions",
    reference: "Armstrong-Helouvry 1991, Control of Machines with Friction (friction by position)",
    commonness: 0.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &["coulomb_friction"],
    forms: &[&[0, 1, 2], &[0, 3, 4], &[0, 1, 2, 3, 4]],
    parameters,
    starts: |scale| {
        let mean = 0.06 * scale.torque_n_m;
        if !scale.angle_known {
            return vec![vec![mean, 0.0, 0.0, 0.0, 0.0]];
        }
        vec![vec![mean, 0.4, 0.4, 0.1, 0.1], vec![mean, -0.4, -0.4, 0.1, 0.1]]
    },
    needs,
    build: both!(|values, _| {
        Box::new(PositionDependentFriction {
            mean_n_m: values[0],
            once: [values[1], values[2]],
            twice: [values[3], values[4]],
        })
    }),
};

/// Where no angle is known, a simulated one loses the phase within seconds: only the mean is left, which dry
/// friction has too.
fn parameters(scale: &Scale) -> Vec<Spec> {
    let torque = scale.torque_n_m;
    let wave = |name| {
        let spec = Spec::shape(name, "1", 0.3, -2.0, 2.0).prior(0.0, 0.5);
        if scale.angle_known { spec } else { Spec { start: 0.0, held: true, ..spec } }
    };
    vec![
        Spec::strength("mean_friction_n_m", "N m", 0.05 * torque, 0.0, torque).sigma(0.1 * torque),
        wave("once_sin_share"),
        wave("once_cos_share"),
        wave("twice_sin_share"),
        wave("twice_cos_share"),
    ]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    turns_round(rig, available)
}

struct PositionDependentFriction<T> {
    mean_n_m: T,
    once: [T; 2],
    twice: [T; 2],
}

impl<T: Real> Effect<T> for PositionDependentFriction<T> {
    fn brisk(&self) -> bool {
        true
    }

    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let (sin, cos) = at.shaft_angle_rad.sin_cos();
        let (sin_2, cos_2) = (sin * 2.0 * cos, T::ONE - sin * 2.0 * sin);
        let wave = self.once[0] * sin + self.once[1] * cos + self.twice[0] * sin_2 + self.twice[1] * cos_2;
        let size = self.mean_n_m * (wave + 1.0).max(T::ZERO);
        balance.rub(size, size);
    }
}
