//! Torque over the angle: cogging of the magnets, ripple of the current.

use std::f64::consts::TAU;

use super::{Family, turns_round};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["one order", "several orders", "ripple with current"],
    fits: turns_round,
    draw,
    ..Family::new("torque_ripple_cogging")
};

struct Teeth {
    /// Order, share, phase.
    orders: Vec<(f64, f64, f64)>,
    /// Share of the amplitude that scales with current.
    ripple: f64,
    full_n_m: f64,
    level_n_m: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let main = dice.pick(machine.cogging_orders);
    let mut orders = vec![(main, 1.0, dice.between(0.0, TAU))];
    if form == 1 {
        for order in machine.cogging_orders.iter().filter(|order| **order != main) {
            orders.push((*order, dice.between(0.1, 0.5), dice.between(0.0, TAU)));
        }
    }
    Box::new(Teeth {
        orders,
        ripple: if form == 2 { dice.between(0.6, 0.9) } else { dice.between(0.0, 0.15) },
        full_n_m: machine.torque_limit_n_m(),
        level_n_m: 0.0,
    })
}

impl Physics for Teeth {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let amplitude = 1.0 - self.ripple + self.ripple * now.relative_current();
        let sum: f64 =
            self.orders.iter().map(|(order, share, phase)| share * (order * now.angle_rad + phase).cos()).sum();
        shaft.torque_n_m += self.level_n_m * amplitude * sum;
    }

    fn quick(&self) -> bool {
        true
    }
}
