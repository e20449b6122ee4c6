//! Small commands do nothing.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["shifted", "jump", "off centre", "with hysteresis"],
    fits: any,
    draw,
    ..Family::new("command_dead_band")
};

enum Form {
    /// sgn(u) (|u| - d).
    Shifted,
    /// u beyond d.
    Jump,
    /// The band lies off zero by a share of its width.
    OffCentre(f64),
    /// Opens at d, closes at a share of it.
    Sticky(f64),
}

struct Band {
    form: Form,
    full: f64,
    width: f64,
    open: bool,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Shifted,
        1 => Form::Jump,
        2 => Form::OffCentre(dice.side() * dice.between(0.1, 0.5)),
        _ => Form::Sticky(dice.between(0.5, 0.9)),
    };
    Box::new(Band { form, full: full.command, width: 0.0, open: false })
}

impl Physics for Band {
    fn set(&mut self, strength: f64) {
        self.width = 0.6 * strength * self.full;
    }

    fn rest(&mut self) {
        self.open = false;
    }

    fn command(&mut self, asked: f64, _: &Now, _: f64) -> f64 {
        let beyond = |asked: f64| asked.signum() * (asked.abs() - self.width).max(0.0);
        match self.form {
            Form::Shifted => beyond(asked),
            Form::Jump => asked * f64::from(asked.abs() > self.width),
            Form::OffCentre(share) => beyond(asked - share * self.width),
            Form::Sticky(close) => {
                let edge = if self.open { close * self.width } else { self.width };
                self.open = asked.abs() > edge;
                if self.open { asked } else { 0.0 }
            }
        }
    }
}
