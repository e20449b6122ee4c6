//! Dry friction of bearings and seals, with a Stribeck rise near standstill.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft};
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "coulomb_friction",
    path: Path::Shaft,
    what: "dry friction of bearings or shaft seals: a torque of constant size against the direction of turning, \
           higher near standstill (Stribeck)",
    equation: "I Om' = ... - tc [1 + (ts/tc - 1) exp(-(Om/vs)^2)] sgn(Om), at rest whatever holds the shaft up to ts; tc, ts [N m], \
               vs [rad/s]",
    signature: "an offset in the shaft's torque balance that changes sign with the direction; stick-slip near zero; \
                thrust over speed squared is unchanged; the loss in thrust per torque falls as 1/Om^2",
    confused_with: &[
        "viscous_friction",
        "torque_channel_bias",
        "command_dead_band",
        "direction_dependent_friction",
        "gear_load_friction",
    ],
    separated_by: "a slow ramp through zero in both directions; a coast-down",
    reference: "Armstrong-Helouvry, Dupont, Canudas de Wit 1994 (Automatica 30:1083)",
    commonness: 4.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 1, 2]],
    parameters,
    starts: |scale| {
        let (torque, speed) = (scale.torque_n_m, scale.shaft_speed_rad_s);
        vec![vec![0.02 * torque, 0.7, 0.015 * speed], vec![0.02 * torque, 0.7, 0.08 * speed]]
    },
    needs: free_shaft,
    build: both!(|values, _| {
        Box::new(CoulombFriction { level_n_m: values[0], rise: values[1], stribeck_rad_s: values[2] })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("coulomb_torque_n_m", "N m", 0.02 * scale.torque_n_m, 0.0, scale.torque_n_m)
            .sigma(0.1 * scale.torque_n_m),
        Spec::shape("stribeck_rise", "1", 0.3, 0.0, 2.0).prior(0.0, 0.5),
        Spec::shape(
            "stribeck_speed_rad_s",
            "rad/s",
            0.04 * scale.shaft_speed_rad_s,
            0.002 * scale.shaft_speed_rad_s,
            0.3 * scale.shaft_speed_rad_s,
        )
        .sigma(0.08 * scale.shaft_speed_rad_s),
    ]
}

struct CoulombFriction<T> {
    level_n_m: T,
    rise: T,
    stribeck_rad_s: T,
}

impl<T: Real> Effect<T> for CoulombFriction<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let stribeck = (-(at.shaft_speed_rad_s / self.stribeck_rad_s).squared()).exp();
        let torque = self.level_n_m * (self.rise * stribeck + 1.0);
        balance.rub(torque, torque);
    }
}
