//! A drive slower than stated.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::{Lag, Second};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["first order", "slower one way", "second order"],
    fits: any,
    draw,
    ..Family::new("amplifier_lag")
};

enum Form {
    /// One time constant.
    First,
    /// Another time constant while the command grows than while it falls.
    OneWay(f64),
    /// A loop of second order, well damped.
    Second(f64),
}

struct Slow {
    form: Form,
    most_s: f64,
    lag_s: f64,
    first: Lag,
    second: Second,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::First,
        1 => Form::OneWay(dice.between(1.3, 2.2)),
        _ => Form::Second(dice.between(0.75, 1.2)),
    };
    let most_s = if machine.wet() { 0.3 } else { 0.15 };
    Box::new(Slow { form, most_s, lag_s: 0.0, first: Lag::default(), second: Second::default() })
}

impl Physics for Slow {
    fn set(&mut self, strength: f64) {
        self.lag_s = self.most_s * strength;
    }

    fn rest(&mut self) {
        (self.first, self.second) = (Lag::default(), Second::default());
    }

    fn command(&mut self, asked: f64, _: &Now, step_s: f64) -> f64 {
        match self.form {
            Form::First => self.first.follow(asked, self.lag_s, step_s),
            Form::OneWay(ratio) => {
                let falls = asked.abs() < self.first.value.abs();
                let lag_s = if falls { ratio * self.lag_s } else { self.lag_s };
                self.first.follow(asked, lag_s, step_s)
            }
            Form::Second(damping) => {
                let natural = 2.0 * damping / self.lag_s.max(1e-4);
                self.second.follow(asked, natural, damping, step_s)
            }
        }
    }
}
