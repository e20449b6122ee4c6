//! White noise of every sensor.

use super::{Kind, Noise};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Physics, Reading};

/// The kind.
pub const KIND: Kind = Kind { name: "white", names: &[], share: 1.0, fits: |_| true, draw };

struct White {
    /// Thrust, torque, flow, current, supply, speed: one sigma.
    sigma: [f64; 6],
    dice: Dice,
}

fn draw(machine: &Machine, full: &Scale, dice: &mut Dice) -> Noise {
    let level = dice.log_between(0.7, 1.6);
    let current = if machine.wet() { 0.003 } else { 0.005 };
    Noise::Physical(Box::new(White {
        sigma: [
            0.0048 * level * full.thrust_n,
            0.0081 * level * full.torque_n_m,
            0.019 * level * full.flow_m_s,
            current * level * full.current_a,
            0.002 * level * machine.supply_v,
            machine.sensors.tachometer_noise * full.speed_rad_s,
        ],
        dice: dice.fork(),
    }))
}

impl Physics for White {
    fn set(&mut self, _: f64) {}

    fn sense(&mut self, _: &Now, reading: &mut Reading, _: f64) {
        let [thrust, torque, flow, current, supply, speed] = self.sigma.map(|sigma| sigma * self.dice.normal());
        reading.thrust_n += thrust;
        reading.torque_n_m += torque;
        reading.flow_m_s += flow;
        reading.current_a += current;
        reading.supply_v += supply;
        reading.speed_rad_s += speed;
    }
}
