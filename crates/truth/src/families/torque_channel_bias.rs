//! A constant in the torque: the zero of a drive or of its current sensor.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Drive, Now, Path, Physics, Reading, Shaft};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["torque", "command zero", "torque that creeps"],
    fits: any,
    draw,
    ..Family::new("torque_channel_bias")
};

enum Form {
    /// A constant torque.
    Torque,
    /// The drive regulates a current that is measured with a wrong zero.
    Zero,
    /// A constant that creeps by some percent over the run.
    Creeping(f64),
}

struct Bias {
    form: Form,
    side: f64,
    strength: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Torque,
        1 => Form::Zero,
        _ => Form::Creeping(dice.between(-0.15, 0.15)),
    };
    Box::new(Bias { form, side: dice.side(), strength: 0.0 })
}

impl Physics for Bias {
    fn set(&mut self, strength: f64) {
        self.strength = 0.6 * strength * self.side;
    }

    fn drive(&self, now: &Now, drive: &mut Drive) {
        if let Form::Zero = self.form {
            drive.target += self.strength * now.full.command;
        }
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let torque = self.strength * now.machine.torque_limit_n_m();
        match self.form {
            Form::Torque => shaft.torque_n_m -= torque,
            Form::Creeping(share) => shaft.torque_n_m -= torque * (1.0 + share * now.time_s / now.full.duration_s),
            Form::Zero => {}
        }
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, _: f64) {
        // What the current loop holds is what it shows.
        if let (Form::Zero, crate::machine::DriveKind::Current) = (&self.form, now.machine.drive) {
            reading.current_a -= self.strength * now.full.command;
        }
    }
}
