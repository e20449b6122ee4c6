//! Torque that varies with the angle of the rotor.

use super::{Available, Context, Descriptor, Effect, Hooks, Path, Scale, Spec, angle_recorded, free_shaft};
use crate::plant::{Balance, Local};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "torque_ripple_cogging",
    path: Path::Drive,
    what: "magnets and slots make torque vary with rotor angle: cogging (always there) and ripple (in proportion to current)",
    equation: "tau += (As + Bs im) sin(k q) + (Ac + Bc im) cos(k q); k whole, A [N m], B [N m/A], q shaft angle [rad]",
    signature: "a line at order k of shaft angle in speed and torque, its frequency follows the shaft; largest at creep speed",
    confused_with: &["encoder_eccentricity", "coulomb_friction"],
    separated_by: "a slow creep over full turns, averaged over angle; cogging stays with the current off; a resolver's \
                   error shows in speed but not in thrust",
    reference: "Jahns & Soong 1996 (IEEE Trans. Ind. Electron. 43:321)",
    parameters,
    starts,
    needs,
    build: both!(build),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let (torque, per_a) = (scale.torque_n_m, scale.torque_n_m / scale.current_a);
    vec![
        Spec::held("order", "1", 1.0, 1.0, 144.0),
        Spec::strength("cogging_sin_n_m", "N m", 0.02 * torque, -0.5 * torque, 0.5 * torque),
        Spec::strength("cogging_cos_n_m", "N m", 0.02 * torque, -0.5 * torque, 0.5 * torque),
        Spec::strength("ripple_sin_nm_a", "N m/A", 0.02 * per_a, -0.5 * per_a, 0.5 * per_a),
        Spec::strength("ripple_cos_nm_a", "N m/A", 0.02 * per_a, -0.5 * per_a, 0.5 * per_a),
    ]
}

/// One start an order: what misalignment gives, the poles, the slots, six times the pole pairs, and the
/// least common multiple of slots and poles of common windings.
fn starts(scale: &Scale) -> Vec<Vec<f64>> {
    let (torque, per_a) = (0.02 * scale.torque_n_m, 0.02 * scale.torque_n_m / scale.current_a);
    [2, 3, 4, 6, 7, 8, 10, 12, 14, 18, 21, 24, 30, 36, 42, 48, 60, 72, 84]
        .iter()
        .map(|order| vec![f64::from(*order), torque, torque, per_a, per_a])
        .collect()
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    angle_recorded(rig, available)
}

fn build<T: Real>(values: &[T], _: &Context<T>) -> Box<dyn Effect<T>> {
    Box::new(TorqueRipple {
        order: values[0].re().round(),
        cogging_n_m: [values[1], values[2]],
        ripple_nm_a: [values[3], values[4]],
    })
}

struct TorqueRipple<T> {
    order: f64,
    cogging_n_m: [T; 2],
    ripple_nm_a: [T; 2],
}

impl<T: Real> Effect<T> for TorqueRipple<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let (sin, cos) = (at.shaft_angle_rad * self.order).sin_cos();
        let amplitude = |i: usize| self.cogging_n_m[i] + self.ripple_nm_a[i] * at.current_a;
        balance.shaft_torque_n_m += amplitude(0) * sin + amplitude(1) * cos;
    }
}
