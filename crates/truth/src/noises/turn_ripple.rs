//! A ripple once a turn: what is not quite round or balanced.

use std::f64::consts::TAU;

use super::{Kind, Noise};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Physics, Reading};

/// The kind.
pub const KIND: Kind = Kind {
    name: "turn_ripple",
    names: &["encoder_eccentricity", "torque_ripple_cogging", "position_dependent_friction"],
    share: 0.3,
    fits: |_| true,
    draw,
};

struct Ripple {
    speed: f64,
    thrust: f64,
    phase_rad: f64,
}

fn draw(_: &Machine, _: &Scale, dice: &mut Dice) -> Noise {
    let speed = dice.log_between(0.0005, 0.003);
    Noise::Physical(Box::new(Ripple { speed, thrust: dice.between(0.0, 3.0) * speed, phase_rad: dice.between(0.0, TAU) }))
}

impl Physics for Ripple {
    fn set(&mut self, _: f64) {}

    fn sense(&mut self, now: &Now, reading: &mut Reading, _: f64) {
        let wave = (now.angle_rad + self.phase_rad).cos();
        reading.speed_rad_s *= 1.0 + self.speed * wave;
        reading.thrust_n *= 1.0 + self.thrust * wave;
    }
}
