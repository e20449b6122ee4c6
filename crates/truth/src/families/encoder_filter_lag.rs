//! A speed reading that is filtered more than stated.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::{Lag, Past, Second};
use crate::physics::{Now, Path, Physics, Reading};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["first order", "mean over a while", "tracking loop"],
    fits: any,
    draw,
    ..Family::new("encoder_filter_lag")
};

struct Filter {
    form: usize,
    damping: f64,
    most_s: f64,
    lag_s: f64,
    first: Lag,
    second: Second,
    past: Past,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Filter {
        form,
        damping: dice.between(0.7, 1.0),
        most_s: if machine.wet() { 0.3 } else { 0.12 },
        lag_s: 0.0,
        first: Lag::default(),
        second: Second::default(),
        past: Past::default(),
    })
}

impl Physics for Filter {
    fn set(&mut self, strength: f64) {
        self.lag_s = self.most_s * strength;
    }

    fn rest(&mut self) {
        (self.first, self.second) = (Lag::default(), Second::default());
        self.past.clear();
    }

    fn sense(&mut self, _: &Now, reading: &mut Reading, tick_s: f64) {
        let seen = reading.speed_rad_s;
        reading.speed_rad_s = match self.form {
            0 => self.first.follow(seen, self.lag_s, tick_s),
            1 => {
                let ticks = (2.0 * self.lag_s / tick_s).round().max(1.0) as usize;
                self.past.push(seen, ticks);
                self.past.mean(ticks)
            }
            _ => {
                let natural = 2.0 * self.damping / self.lag_s.max(1e-4);
                self.second.follow(seen, natural, self.damping, tick_s)
            }
        };
    }
}
