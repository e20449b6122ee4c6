//! Flow across the axis.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["share of the square", "deflected jet", "loss below a ratio"],
    fits: wet,
    draw,
    ..Family::new("cross_flow")
};

enum Form {
    /// T (1 - c vt^2/(vp^2 + vt^2)).
    Square,
    /// T cos of the jet's deflection: vp/sqrt(vp^2 + c vt^2).
    Jet,
    /// T (1 - c max(0, 1 - vp/(n vt))).
    Below(f64),
}

struct Cross {
    form: Form,
    across_m_s: f64,
    loss: f64,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Square,
        1 => Form::Jet,
        _ => Form::Below(dice.between(1.2, 2.5)),
    };
    Box::new(Cross { form, across_m_s: dice.between(0.15, 0.4) * full.flow_m_s, loss: 0.0 })
}

impl Physics for Cross {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn forces(&self, now: &Now, thrust_n: &mut f64, _: &mut f64) {
        let (along, across) = (now.flow_m_s.powi(2), self.across_m_s.powi(2));
        *thrust_n *= match self.form {
            Form::Square => 1.0 - self.loss * across / (along + across),
            Form::Jet => ((along + 1e-9) / (along + 4.0 * self.loss * across + 1e-9)).sqrt().max(0.1),
            Form::Below(ratio) => {
                1.0 - self.loss * (1.0 - now.flow_m_s.abs() / (ratio * self.across_m_s)).max(0.0)
            }
        };
    }
}
