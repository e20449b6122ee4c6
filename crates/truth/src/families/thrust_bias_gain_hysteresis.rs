//! A force sensor with a wrong zero, gain, or play.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Reading};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["zero", "gain", "play", "all of them", "another gain in compression"],
    anchors: &[Quantity::Lift, Quantity::Drag, Quantity::Flux, Quantity::TorqueConstant],
    fits: wet,
    draw,
    ..Family::new("thrust_bias_gain_hysteresis")
};

struct Cell {
    /// Zero, gain, play, gain of pulls alone; per strength.
    parts: [f64; 4],
    strength: f64,
    held_n: f64,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let (side, other) = (dice.side(), dice.side());
    let parts = match form {
        0 => [side, 0.0, 0.0, 0.0],
        1 => [0.0, side, 0.0, 0.0],
        2 => [0.0, 0.0, 1.0, 0.0],
        3 => [side * 0.6, other * dice.between(0.3, 1.0), dice.between(0.1, 0.5), 0.0],
        _ => [0.0, 0.0, 0.0, side],
    };
    Box::new(Cell { parts, strength: 0.0, held_n: 0.0 })
}

impl Physics for Cell {
    fn set(&mut self, strength: f64) {
        self.strength = strength;
    }

    fn rest(&mut self) {
        self.held_n = 0.0;
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, _: f64) {
        let [zero, gain, play, pull] = self.parts.map(|part| part * self.strength);
        let half = play * now.full.thrust_n;
        self.held_n = self.held_n.clamp(reading.thrust_n - half, reading.thrust_n + half);
        let thrust = if play > 0.0 { self.held_n } else { reading.thrust_n };
        let gain = if thrust < 0.0 { gain + pull } else { gain };
        reading.thrust_n = (1.0 + gain) * thrust + zero * now.full.thrust_n;
    }
}
