//! The jet comes back.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics, Water};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["first order", "round the tank and then mixed", "by momentum"],
    fits: wet,
    draw,
    ..Family::new("tank_recirculation")
};

struct Return {
    form: usize,
    time_s: f64,
    gain: f64,
    mixed: [Lag; 3],
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Return { form, time_s: dice.between(2.0, 15.0), gain: 0.0, mixed: [Lag::default(); 3] })
}

impl Physics for Return {
    fn set(&mut self, strength: f64) {
        self.gain = 0.9 * strength;
    }

    fn rest(&mut self) {
        self.mixed = [Lag::default(); 3];
    }

    fn water(&self, now: &Now, water: &mut Water) {
        water.ambient_m_s += match self.form {
            0 => self.mixed[0].value,
            1 => self.mixed[2].value,
            // Square root of the momentum that was brought in.
            _ => {
                let m = self.mixed[0].value;
                m.signum() * m.abs().sqrt() * now.full.flow_m_s.sqrt() * self.gain.sqrt()
            }
        };
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        let flow = now.flow_m_s;
        match self.form {
            0 => {
                self.mixed[0].follow(self.gain * flow, self.time_s, step_s);
            }
            1 => {
                let mut carried = self.gain * flow;
                for lag in &mut self.mixed {
                    carried = lag.follow(carried, self.time_s / 3.0, step_s);
                }
            }
            _ => {
                let brought = self.gain * flow * flow.abs() / now.full.flow_m_s;
                self.mixed[0].follow(brought, self.time_s, step_s);
            }
        }
    }
}
