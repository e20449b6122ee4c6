//! Iron that saturates: less torque per ampere at large current.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Drive, Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["rational", "cubic", "knee"],
    anchors: &[Quantity::TorqueConstant],
    fits: any,
    draw,
    ..Family::new("torque_constant_saturation")
};

enum Form {
    /// kt / (1 + k i^2).
    Rational,
    /// kt (1 - k i^2).
    Cubic,
    /// kt up to a knee, then falling along a hyperbolic tangent.
    Knee(f64),
}

struct Iron {
    form: Form,
    loss: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Rational,
        1 => Form::Cubic,
        _ => Form::Knee(dice.between(0.3, 0.6)),
    };
    Box::new(Iron { form, loss: 0.0 })
}

impl Physics for Iron {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn drive(&self, now: &Now, drive: &mut Drive) {
        let i = now.relative_current().abs();
        drive.torque_gain *= match self.form {
            Form::Rational => 1.0 / (1.0 + self.loss * i * i),
            Form::Cubic => (1.0 - 0.8 * self.loss * i * i).max(0.1),
            Form::Knee(knee) if i > knee => {
                let over = (i - knee) * 2.0;
                1.0 - self.loss * (1.0 - over.tanh() / over) * over.min(1.5)
            }
            Form::Knee(_) => 1.0,
        };
    }
}
