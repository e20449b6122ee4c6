//! A sensor of speed that does not know the direction.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Reading};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["rectified", "blind near rest", "rectified and smoothed"],
    sized: false,
    fits: any,
    draw,
    ..Family::new("unsigned_speed_sensor")
};

/// It is there or not: no strength makes it small.
struct Unsigned {
    form: usize,
    blind: f64,
    on: bool,
    smooth: Lag,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Unsigned { form, blind: dice.between(0.01, 0.03), on: false, smooth: Lag::default() })
}

impl Physics for Unsigned {
    fn set(&mut self, strength: f64) {
        self.on = strength > 0.0;
    }

    fn rest(&mut self) {
        self.smooth = Lag::default();
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, tick_s: f64) {
        if !self.on {
            return;
        }
        let seen = reading.speed_rad_s.abs();
        reading.speed_rad_s = match self.form {
            0 => seen,
            1 => seen * f64::from(seen > self.blind * now.full.speed_rad_s),
            _ => self.smooth.follow(seen, 0.004, tick_s),
        };
    }
}
