//! Friction in proportion to shaft speed: oil, seals, sheared water.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "viscous_friction",
    path: Path::Shaft,
    what: "friction in proportion to shaft speed, beyond the stated one: oil-filled housing, seals, sheared water",
    equation: "I Om' = ... - kf Om; kf [N m s]",
    signature: "an offset in the shaft's torque balance that grows linearly with speed; thrust over speed squared is \
                unchanged; the loss in thrust per torque falls as 1/Om and shrinks as the unit warms",
    confused_with: &["coulomb_friction", "windage_drag", "voltage_limit_backemf", "supply_sag"],
    separated_by: "a staircase over a 10:1 range of speeds; a dry spin",
    reference: "Healey et al. 1995 (IEEE JOE 20:354), equation (10)",
    commonness: 3.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: free_shaft,
    build: both!(|values, _| Box::new(ViscousFriction { viscous_nm_s: values[0] })),
};

/// Never negative: friction gives no energy away. Less than the rig states is told by its own number, within its tolerance.
fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.torque_n_m / scale.shaft_speed_rad_s;
    vec![Spec::strength("viscous_friction_nm_s", "N m s", 0.02 * full, 0.0, full).sigma(0.1 * full)]
}

struct ViscousFriction<T> {
    viscous_nm_s: T,
}

impl<T: Real> Effect<T> for ViscousFriction<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.shaft_torque_n_m -= self.viscous_nm_s * at.shaft_speed_rad_s;
    }
}
