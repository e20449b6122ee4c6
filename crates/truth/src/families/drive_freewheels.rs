//! A drive that does not brake.

use super::{Family, voltage_driven};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Drive, Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["diodes", "brakes on stop", "coasts on stop", "worse one way"],
    fits: voltage_driven,
    draw,
    ..Family::new("drive_freewheels")
};

/// Command below which the drive is told to stop, over the largest.
const STOP: f64 = 0.02;

enum Form {
    /// The same at every command.
    Diodes,
    /// It brakes at no command, as many speed controllers are set to.
    BrakesOnStop,
    /// Only a released drive coasts.
    CoastsOnStop,
    /// One half of the bridge brakes better, by this share.
    OneWay(f64),
}

struct Bridge {
    form: Form,
    lost: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Diodes,
        1 => Form::BrakesOnStop,
        2 => Form::CoastsOnStop,
        _ => Form::OneWay(dice.between(0.2, 0.5)),
    };
    Box::new(Bridge { form, lost: 0.0 })
}

impl Physics for Bridge {
    fn set(&mut self, strength: f64) {
        self.lost = strength.clamp(0.0, 1.0);
    }

    fn drive(&self, now: &Now, drive: &mut Drive) {
        let stopped = drive.target.abs() < STOP * now.full.command;
        let lost = match self.form {
            Form::Diodes => self.lost,
            Form::BrakesOnStop => self.lost * f64::from(!stopped),
            Form::CoastsOnStop => self.lost * f64::from(stopped),
            Form::OneWay(share) if now.speed_rad_s < 0.0 => self.lost * (1.0 - share),
            Form::OneWay(_) => self.lost,
        };
        drive.braking *= 1.0 - lost;
    }
}
