//! Friction and separation in the duct.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Water};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["turbulent", "power 1.8", "separation at the lip astern", "separation after a start"],
    anchors: &[Quantity::Flux, Quantity::Lift],
    fits: wet,
    draw,
    ..Family::new("duct_loss")
};

enum Form {
    /// kd/2 rho a vp |vp|.
    Turbulent,
    /// Smooth wall: |vp|^1.8.
    Smooth,
    /// The lip is sharp one way: flow astern separates, and heals slowly.
    Lip { heal_s: f64 },
    /// Flow that speeds up separates until the jet is built.
    Start { heal_s: f64 },
}

struct Duct {
    form: Form,
    loss: f64,
    separated: Lag,
    past: Lag,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let heal_s = dice.between(0.1, 0.6);
    let form = match form {
        0 => Form::Turbulent,
        1 => Form::Smooth,
        2 => Form::Lip { heal_s },
        _ => Form::Start { heal_s },
    };
    Box::new(Duct { form, loss: 0.0, separated: Lag::default(), past: Lag::default() })
}

impl Physics for Duct {
    fn set(&mut self, strength: f64) {
        self.loss = 4.0 * strength;
    }

    fn rest(&mut self) {
        (self.separated, self.past) = (Lag::default(), Lag::default());
    }

    fn water(&self, now: &Now, water: &mut Water) {
        let flow = now.relative_flow().abs();
        water.flux_gain += 0.5
            * self.loss
            * match self.form {
                Form::Turbulent => 1.0,
                Form::Smooth => flow.max(0.02).powf(-0.2),
                Form::Lip { .. } | Form::Start { .. } => self.separated.value,
            };
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        match self.form {
            Form::Lip { heal_s } => {
                let wanted = f64::from(now.flow_m_s < -0.05 * now.full.flow_m_s);
                self.separated.follow(wanted, heal_s, step_s);
            }
            Form::Start { heal_s } => {
                let before = self.past.follow(now.flow_m_s, heal_s, step_s);
                let gust = (now.flow_m_s - before).abs() / now.full.flow_m_s;
                self.separated.value = 3.0 * gust;
            }
            _ => {}
        }
    }
}
