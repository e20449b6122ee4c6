//! Turbulence of the water that comes in.

use super::{Kind, Noise};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Physics, Water};

/// The kind.
pub const KIND: Kind =
    Kind { name: "turbulence", names: &["ambient_flow_unsteady"], share: 1.0, fits: Machine::wet, draw };

/// An Ornstein-Uhlenbeck process.
struct Turbulence {
    sigma_m_s: f64,
    time_s: f64,
    flow_m_s: f64,
    dice: Dice,
}

fn draw(_: &Machine, full: &Scale, dice: &mut Dice) -> Noise {
    let sigma_m_s = dice.between(0.004, 0.008) * full.flow_m_s;
    Noise::Physical(Box::new(Turbulence {
        sigma_m_s,
        time_s: dice.between(0.4, 0.9),
        flow_m_s: sigma_m_s * dice.normal(),
        dice: dice.fork(),
    }))
}

impl Physics for Turbulence {
    fn set(&mut self, _: f64) {}

    fn water(&self, _: &Now, water: &mut Water) {
        water.ambient_m_s += self.flow_m_s;
    }

    fn advance(&mut self, _: &Now, step_s: f64) {
        let keep = (-step_s / self.time_s).exp();
        let kick = self.sigma_m_s * (1.0 - keep * keep).sqrt();
        self.flow_m_s = keep * self.flow_m_s + kick * self.dice.normal();
    }
}
