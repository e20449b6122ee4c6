//! Friction of a gear in proportion to what it transmits.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, geared};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "gear_load_friction",
    path: Path::Shaft,
    what: "the teeth of a gear, a worm or a screw rub in proportion to the torque they carry: the gear's loss of efficiency",
    equation: "I Om' = ... - mu |tm - s tl| sgn(Om), at rest whatever holds the shaft up to that; tm the motor's torque, tl the \
               load's, positive where it drives ahead [N m]: with s = 1 what pulls against the motor loads the teeth twice, \
               with s = 0 the motor's torque alone does; mu, s [1]",
    signature: "dry friction that grows with the load and vanishes with it: a heavy arm is held without current, and falls \
                more slowly than it should when the drive is released; thrust over speed squared is unchanged",
    confused_with: &[
        "coulomb_friction",
        "torque_constant_saturation",
        "windage_drag",
        "direction_dependent_friction",
    ],
    separated_by: "another load at the same speed; the load left to swing with the drive released",
    reference: "Duclusaud, Passault, Padois, Ly 2024 (arXiv 2410.08650), friction by load; mu 0.05 to 0.3; s of the \
                six servos in their repository (M5): 0 in three, 0.1, large, and one without such friction",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 1]],
    parameters,
    starts: |_| vec![vec![0.1, 1.0], vec![0.25, 1.0], vec![0.25, 0.0]],
    needs: geared,
    build: both!(|values, _| Box::new(GearLoadFriction { share: values[0], load_side: values[1] })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("gear_friction_share", "1", 0.05, 0.0, 0.9).sigma(0.15),
        Spec::shape("load_side", "1", 0.3, 0.0, 1.0).prior(1.0, 1.0),
    ]
}

struct GearLoadFriction<T> {
    share: T,
    load_side: T,
}

impl<T: Real> Effect<T> for GearLoadFriction<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let load_n_m = balance.load_torque_n_m - balance.blade_torque_n_m;
        let rubbed = self.share * (balance.motor_torque_n_m - self.load_side * load_n_m).abs();
        balance.rub(rubbed, rubbed);
    }
}
