//! Water that turns with the propeller.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Shaft};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["rigid", "dragged along", "washed out by the jet"],
    same_physics: &["rotor_inertia_error"],
    anchors: &[Quantity::Inertia, Quantity::TorqueConstant, Quantity::Lift],
    fits: wet,
    draw,
    ..Family::new("entrained_water_inertia")
};

enum Form {
    /// Turns as one with the blades.
    Rigid,
    /// Follows through the boundary layer within a few milliseconds.
    Dragged { follow_s: f64 },
    /// Less of it the more flows through: I / (1 + (vp/v0)^2).
    Washed { flow: f64 },
}

struct Water {
    form: Form,
    own_kg_m2: f64,
    strength: f64,
    follower: Lag,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Rigid,
        1 => Form::Dragged { follow_s: dice.between(0.004, 0.012) },
        _ => Form::Washed { flow: dice.between(1.0, 3.0) },
    };
    Box::new(Water { form, own_kg_m2: machine.inertia_kg_m2, strength: 0.0, follower: Lag::default() })
}

impl Physics for Water {
    fn set(&mut self, strength: f64) {
        self.strength = strength;
    }

    fn rest(&mut self) {
        self.follower = Lag::default();
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let inertia = 4.0 * self.strength * self.own_kg_m2;
        match self.form {
            Form::Rigid => shaft.inertia_kg_m2 += inertia,
            Form::Washed { flow } => shaft.inertia_kg_m2 += inertia / (1.0 + (now.relative_flow() / flow).powi(2)),
            Form::Dragged { follow_s } => {
                shaft.torque_n_m += inertia * (now.speed_rad_s - self.follower.value) / follow_s;
            }
        }
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        if let Form::Dragged { follow_s } = self.form {
            self.follower.follow(now.speed_rad_s, follow_s, step_s);
        }
    }
}
