//! A force reading that comes late.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::{Lag, Past, Second};
use crate::physics::{Now, Path, Physics, Reading};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["first order", "second order", "mean over a while"],
    fits: wet,
    draw,
    ..Family::new("thrust_sensor_lag")
};

struct Late {
    form: usize,
    damping: f64,
    lag_s: f64,
    first: Lag,
    second: Second,
    past: Past,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Late {
        form,
        damping: dice.between(0.7, 1.1),
        lag_s: 0.0,
        first: Lag::default(),
        second: Second::default(),
        past: Past::default(),
    })
}

impl Physics for Late {
    fn set(&mut self, strength: f64) {
        self.lag_s = 0.4 * strength;
    }

    fn rest(&mut self) {
        (self.first, self.second) = (Lag::default(), Second::default());
        self.past.clear();
    }

    fn sense(&mut self, _: &Now, reading: &mut Reading, tick_s: f64) {
        let force = reading.thrust_n;
        reading.thrust_n = match self.form {
            0 => self.first.follow(force, self.lag_s, tick_s),
            1 => {
                let natural = 2.0 * self.damping / self.lag_s.max(1e-4);
                self.second.follow(force, natural, self.damping, tick_s)
            }
            _ => {
                let ticks = (2.0 * self.lag_s / tick_s).round().max(1.0) as usize;
                self.past.push(force, ticks);
                self.past.mean(ticks)
            }
        };
    }
}
