//! A bent shaft, an uneven seal, a worn screw: dry friction over the angle.

use std::f64::consts::TAU;

use super::{Family, turns_round};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["orders one and two", "a tight spot", "along the travel"],
    fits: turns_round,
    draw,
    ..Family::new("position_dependent_friction")
};

enum Form {
    /// 1 + a1 cos(q + p1) + a2 cos(2q + p2).
    Orders([(f64, f64); 2]),
    /// Tight once a turn: exp(k (cos(q - q0) - 1)).
    Spot { sharp: f64, at: f64 },
    /// Over a travel of many turns: 1 + a sin(q/n + p).
    Travel { turns: f64, phase: f64 },
}

struct Place {
    form: Form,
    full_n_m: f64,
    level_n_m: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Orders([
            (dice.between(0.4, 0.7), dice.between(0.0, TAU)),
            (dice.between(0.1, 0.3), dice.between(0.0, TAU)),
        ]),
        1 => Form::Spot { sharp: dice.between(2.0, 12.0), at: dice.between(0.0, TAU) },
        _ => Form::Travel { turns: dice.log_between(3.0, 30.0), phase: dice.between(0.0, TAU) },
    };
    Box::new(Place { form, full_n_m: 0.8 * machine.torque_limit_n_m(), level_n_m: 0.0 })
}

impl Physics for Place {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let q = now.angle_rad;
        let shape = match &self.form {
            Form::Orders([one, two]) => 1.0 + one.0 * (q + one.1).cos() + two.0 * (2.0 * q + two.1).cos(),
            Form::Spot { sharp, at } => 0.15 + (sharp * ((q - at).cos() - 1.0)).exp(),
            Form::Travel { turns, phase } => 1.0 + 0.8 * (q / turns + phase).sin(),
        };
        let level = self.level_n_m * shape.max(0.0);
        shaft.rub(level, level);
    }
}
