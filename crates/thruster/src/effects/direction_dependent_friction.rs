//! Friction that differs by the direction of turning: screws, seals with a lip, gears.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft};
use crate::plant::{Balance, Local};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "direction_dependent_friction",
    path: Path::Shaft,
    what: "screws, lip seals and gears rub more when turning one way than the other",
    equation: "I Om' = ... - [tc+ + kf+ |Om|] ahead, + [tc- + kf- |Om|] astern; at rest whatever holds the shaft up to tc+ \
               or tc-; tc [N m], kf [N m s]",
    signature: "an offset in the shaft's torque balance that changes sign with the direction, and is larger one way; the \
                difference may grow with speed, a bias does not; thrust over speed squared is unchanged",
    confused_with: &[
        "coulomb_friction",
        "torque_channel_bias",
        "viscous_friction",
        "forward_reverse_asymmetry",
    ],
    separated_by: "a staircase in both directions; on one-sided data it is coulomb_friction with a torque_channel_bias",
    reference: "Armstrong-Helouvry, Dupont, Canudas de Wit 1994 (Automatica 30:1083), friction by direction; in real \
                drives 10 to 45 % between the ways",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[&["coulomb_friction", "torque_channel_bias"], &["coulomb_friction", "viscous_friction"]],
    holds: &["coulomb_friction"],
    forms: &[&[0, 1], &[2, 3], &[0, 1, 2, 3]],
    parameters,
    starts: |scale| {
        let (dry, viscous) = (0.04 * scale.torque_n_m, 0.02 * scale.torque_n_m / scale.shaft_speed_rad_s);
        vec![vec![dry, 0.5 * dry, viscous, viscous], vec![0.5 * dry, dry, viscous, viscous]]
    },
    needs,
    build: both!(|values, _| {
        Box::new(DirectionDependentFriction {
            ahead_n_m: values[0],
            astern_n_m: values[1],
            ahead_nm_s: values[2],
            astern_nm_s: values[3],
        })
    }),
};

/// Of a shaft that turns one way alone dry friction and this are the same.
fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    free_shaft(rig, available)?;
    if available.one_way {
        return Err("the shaft turned one way only, so nothing tells how it rubs the other way");
    }
    Ok(())
}

fn parameters(scale: &Scale) -> Vec<Spec> {
    let torque = scale.torque_n_m;
    let viscous = torque / scale.shaft_speed_rad_s;
    let dry = |name| Spec::strength(name, "N m", 0.02 * torque, 0.0, torque).sigma(0.1 * torque);
    let slope = |name| Spec::strength(name, "N m s", 0.02 * viscous, 0.0, viscous).sigma(0.1 * viscous);
    vec![
        dry("dry_ahead_n_m"),
        dry("dry_astern_n_m"),
        slope("viscous_ahead_nm_s"),
        slope("viscous_astern_nm_s"),
    ]
}

struct DirectionDependentFriction<T> {
    ahead_n_m: T,
    astern_n_m: T,
    ahead_nm_s: T,
    astern_nm_s: T,
}

impl<T: Real> Effect<T> for DirectionDependentFriction<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.rub(self.ahead_n_m, self.astern_n_m);
        let speed = at.shaft_speed_rad_s;
        balance.shaft_torque_n_m -= if speed < 0.0 { self.astern_nm_s } else { self.ahead_nm_s } * speed;
    }
}
