//! More water is accelerated than the rig says.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Water};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["constant", "more astern", "grows as the jet builds"],
    anchors: &[Quantity::AddedMass, Quantity::Lift],
    fits: wet,
    draw,
    ..Family::new("inertia_added_mass_error")
};

enum Form {
    Constant,
    /// The other end of the duct is another shape.
    Astern(f64),
    /// A longer column with time.
    Growing { time_s: f64 },
}

struct Mass {
    form: Form,
    more: f64,
    built: Lag,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Constant,
        1 => Form::Astern(dice.between(0.6, 1.5)),
        _ => Form::Growing { time_s: dice.between(0.1, 0.5) },
    };
    Box::new(Mass { form, more: 0.0, built: Lag::default() })
}

impl Physics for Mass {
    fn set(&mut self, strength: f64) {
        self.more = 5.0 * strength;
    }

    fn rest(&mut self) {
        self.built = Lag::default();
    }

    fn water(&self, now: &Now, water: &mut Water) {
        water.mass_gain += self.more
            * match self.form {
                Form::Constant => 1.0,
                Form::Astern(ratio) if now.flow_m_s < 0.0 => ratio,
                Form::Astern(_) => 1.0,
                Form::Growing { .. } => 0.7 + 0.6 * self.built.value,
            };
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        if let Form::Growing { time_s } = self.form {
            self.built.follow(now.relative_flow().abs(), time_s, step_s);
        }
    }
}
