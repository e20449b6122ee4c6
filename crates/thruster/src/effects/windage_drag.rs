//! Drag of hub and rotor, in proportion to the square of shaft speed.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "windage_drag",
    path: Path::Shaft,
    what: "drag of hub, shaft or a flooded rotor as a disk in water: a torque that grows with the square of shaft speed",
    equation: "I Om' = ... - kw Om|Om|; kw [N m s^2]",
    signature: "thrust per torque is lower by the same percentage at all speeds; thrust over speed squared is unchanged",
    confused_with: &[
        "torque_constant_saturation",
        "nonsinusoidal_lift_drag",
        "viscous_friction",
        "water_density",
    ],
    separated_by: "a spin with the blades off (windage stays); an error of the torque constant shows at standstill too",
    reference: "Daily & Nece 1960 (J. Basic Eng. 82:217)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: free_shaft,
    build: both!(|values, _| Box::new(WindageDrag { drag_nm_s2: values[0] })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.torque_n_m / scale.shaft_speed_rad_s.powi(2);
    vec![Spec::strength("windage_nm_s2", "N m s^2", 0.03 * full, 0.0, full).sigma(0.1 * full)]
}

struct WindageDrag<T> {
    drag_nm_s2: T,
}

impl<T: Real> Effect<T> for WindageDrag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let speed = at.shaft_speed_rad_s;
        balance.shaft_torque_n_m -= self.drag_nm_s2 * speed * speed.abs();
    }
}
