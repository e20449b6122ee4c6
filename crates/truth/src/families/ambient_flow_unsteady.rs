//! Waves and eddies that nobody commands.

use std::f64::consts::TAU;

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Water};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Flow,
    forms: &["three waves", "random walk that returns", "narrow-band sea"],
    fits: wet,
    draw,
    ..Family::new("ambient_flow_unsteady")
};

struct Sea {
    /// Frequency (Hz) and phase.
    waves: Vec<(f64, f64)>,
    full_m_s: f64,
    amplitude_m_s: f64,
}

/// A random walk that returns is drawn as many sines below its corner: the same at every step size.
fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let mut wave = |low: f64, high: f64| (dice.between(low, high), dice.between(0.0, TAU));
    let waves = match form {
        0 => vec![wave(0.05, 0.12), wave(0.1, 0.2), wave(0.18, 0.3)],
        1 => (1..14).map(|n| wave(0.02 * f64::from(n), 0.02 * f64::from(n) + 0.02)).collect(),
        _ => (0..7).map(|_| wave(0.12, 0.2)).collect(),
    };
    Box::new(Sea { waves, full_m_s: 2.0 * full.flow_m_s, amplitude_m_s: 0.0 })
}

impl Physics for Sea {
    fn set(&mut self, strength: f64) {
        self.amplitude_m_s = strength * self.full_m_s;
    }

    fn water(&self, now: &Now, water: &mut Water) {
        let sum: f64 = self.waves.iter().map(|(hz, phase)| (TAU * hz * now.time_s + phase).sin()).sum();
        water.ambient_m_s += self.amplitude_m_s * sum / (self.waves.len() as f64).sqrt() / 1.5;
    }
}
