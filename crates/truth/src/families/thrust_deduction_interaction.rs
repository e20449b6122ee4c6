//! A hull or a neighbour takes part of the thrust.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["a share of the thrust", "less at small loading", "more ahead than astern"],
    same_physics: &["thrust_bias_gain_hysteresis"],
    anchors: &[Quantity::Lift, Quantity::Drag, Quantity::Flux, Quantity::TorqueConstant],
    fits: wet,
    draw,
    ..Family::new("thrust_deduction_interaction")
};

/// T (1 - t); t may depend on loading and direction.
struct Suction {
    form: usize,
    astern: f64,
    share: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Suction { form, astern: dice.between(0.5, 0.9), share: 0.0 })
}

impl Physics for Suction {
    fn set(&mut self, strength: f64) {
        self.share = strength;
    }

    fn stand(&mut self, now: &Now, force_n: &mut f64, _: f64) {
        let t = match self.form {
            0 => 1.0,
            1 => (now.thrust_n.abs() / now.full.thrust_n).min(1.0).powf(0.2),
            _ if *force_n < 0.0 => self.astern,
            _ => 1.0,
        };
        *force_n *= 1.0 - self.share * t;
    }
}
