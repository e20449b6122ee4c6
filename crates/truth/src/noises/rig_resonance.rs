//! The rig rings a little.

use std::f64::consts::TAU;

use super::{Kind, Noise};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Second;
use crate::physics::{Now, Physics, Reading};

/// The kind.
pub const KIND: Kind =
    Kind { name: "rig_resonance", names: &["stand_resonance", "flexible_coupling"], share: 0.2, fits: |_| true, draw };

/// Frame or coupling, shaken by the torque: a share of it shows in thrust and speed.
struct Ring {
    hz: f64,
    damping: f64,
    share: f64,
    place: Second,
}

fn draw(machine: &Machine, _: &Scale, dice: &mut Dice) -> Noise {
    let share = dice.log_between(0.003, 0.015);
    Noise::Physical(Box::new(Ring {
        hz: dice.between(8.0, 30.0),
        damping: dice.between(0.02, 0.1),
        share: if machine.wet() { share } else { 0.3 * share },
        place: Second::default(),
    }))
}

impl Physics for Ring {
    fn set(&mut self, _: f64) {}

    fn rest(&mut self) {
        self.place = Second::default();
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, tick_s: f64) {
        let torque = now.motor_torque_n_m / now.full.torque_n_m;
        let ringing = self.place.follow(torque, TAU * self.hz, self.damping, tick_s) - torque;
        reading.thrust_n += self.share * ringing * now.full.thrust_n;
        reading.speed_rad_s += 0.1 * self.share * ringing * now.full.speed_rad_s;
    }
}
