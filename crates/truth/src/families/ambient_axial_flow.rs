//! Current, tow, the way of the vehicle: a flow along the axis.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Water};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["constant", "a slow tide", "behind a hull"],
    fits: wet,
    draw,
    ..Family::new("ambient_axial_flow")
};

enum Form {
    Constant,
    /// Changes by some percent over the run.
    Tide(f64),
    /// The hull's wake is filled in by suction: (1 - w) U, w falls with thrust.
    Wake(f64),
}

struct Ambient {
    form: Form,
    full_m_s: f64,
    flow_m_s: f64,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Constant,
        1 => Form::Tide(dice.between(-0.25, 0.25)),
        _ => Form::Wake(dice.between(0.1, 0.3)),
    };
    Box::new(Ambient { form, full_m_s: dice.side() * full.flow_m_s, flow_m_s: 0.0 })
}

impl Physics for Ambient {
    fn set(&mut self, strength: f64) {
        self.flow_m_s = strength * self.full_m_s;
    }

    fn water(&self, now: &Now, water: &mut Water) {
        water.ambient_m_s += self.flow_m_s
            * match self.form {
                Form::Constant => 1.0,
                Form::Tide(share) => 1.0 + share * (now.time_s / now.full.duration_s - 0.5),
                Form::Wake(share) => 1.0 - share * (1.0 - now.relative_flow().abs().min(1.0)),
            };
    }
}
