//! Zeros that wander.

use super::{Kind, Noise};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Physics, Reading};

/// The kind.
pub const KIND: Kind = Kind { name: "drift", names: &["thrust_bias_gain_hysteresis"], share: 0.6, fits: |_| true, draw };

/// Random walks of the zeros of force, current and torque.
struct Drift {
    /// Per square root of a second.
    pace: [f64; 3],
    zero: [f64; 3],
    dice: Dice,
}

fn draw(_: &Machine, full: &Scale, dice: &mut Dice) -> Noise {
    let share = dice.between(0.001, 0.003) / full.duration_s.sqrt();
    Noise::Physical(Box::new(Drift {
        pace: [share * full.thrust_n, 0.6 * share * full.current_a, share * full.torque_n_m],
        zero: [0.0; 3],
        dice: dice.fork(),
    }))
}

impl Physics for Drift {
    fn set(&mut self, _: f64) {}

    fn rest(&mut self) {
        self.zero = [0.0; 3];
    }

    fn sense(&mut self, _: &Now, reading: &mut Reading, tick_s: f64) {
        for (zero, pace) in self.zero.iter_mut().zip(self.pace) {
            *zero += pace * tick_s.sqrt() * self.dice.normal();
        }
        reading.thrust_n += self.zero[0];
        reading.current_a += self.zero[1];
        reading.torque_n_m += self.zero[2];
    }
}
