//! More turns than the rig says.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["constant", "uneven over a turn", "growing with speed"],
    same_physics: &["entrained_water_inertia"],
    anchors: &[Quantity::Inertia, Quantity::TorqueConstant, Quantity::Lift],
    fits: any,
    draw,
    ..Family::new("rotor_inertia_error")
};

enum Form {
    Constant,
    /// A crank or a key: I (1 + a cos 2q).
    Uneven(f64),
    /// Weights that swing out: I (1 + a (v/vmax)^2).
    Swinging(f64),
}

struct Inertia {
    form: Form,
    own_kg_m2: f64,
    strength: f64,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Constant,
        1 => Form::Uneven(dice.between(0.05, 0.3)),
        _ => Form::Swinging(dice.between(0.1, 0.4)),
    };
    Box::new(Inertia { form, own_kg_m2: machine.inertia_kg_m2, strength: 0.0 })
}

impl Physics for Inertia {
    fn set(&mut self, strength: f64) {
        self.strength = strength;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let shape = match self.form {
            Form::Constant => 1.0,
            Form::Uneven(share) => 1.0 + share * (2.0 * now.angle_rad).cos(),
            Form::Swinging(share) => 1.0 + share * now.relative_speed().powi(2).min(1.5),
        };
        shaft.inertia_kg_m2 += 4.0 * self.strength * self.own_kg_m2 * shape;
    }
}
