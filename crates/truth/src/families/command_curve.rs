//! A throttle that is not linear in what it drives.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["square", "cube", "power", "table"],
    anchors: &[Quantity::TorqueConstant],
    fits: any,
    draw,
    ..Family::new("command_curve")
};

enum Form {
    /// u + c u |u|, ends kept.
    Square(f64),
    /// u + c u^3, ends kept.
    Cube(f64),
    /// sgn(u) |u|^p.
    Power(f64),
    /// Straight between two points.
    Table { at: f64, side: f64 },
}

struct Curve {
    form: Form,
    full: f64,
    strength: f64,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let side = dice.side();
    let form = match form {
        0 => Form::Square(side),
        1 => Form::Cube(side),
        2 => Form::Power(side),
        _ => Form::Table { at: dice.between(0.3, 0.6), side },
    };
    Box::new(Curve { form, full: full.command, strength: 0.0 })
}

impl Physics for Curve {
    fn set(&mut self, strength: f64) {
        self.strength = 0.9 * strength;
    }

    fn command(&mut self, asked: f64, _: &Now, _: f64) -> f64 {
        let u = asked.abs() / self.full;
        let s = self.strength;
        let bent = match self.form {
            Form::Square(side) => u * (1.0 - side * s + side * s * u),
            Form::Cube(side) => u * (1.0 - side * s + side * s * u * u),
            Form::Power(side) => u.powf((side * s * 1.5).exp()),
            Form::Table { at, side } => {
                let middle = at * (1.0 - side * s * (1.0 - at));
                if u < at { middle * u / at } else { middle + (1.0 - middle) * (u - at) / (1.0 - at) }
            }
        };
        asked.signum() * bent * self.full
    }
}
