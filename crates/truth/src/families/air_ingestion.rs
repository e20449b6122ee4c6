//! Bubbles in the water.

use std::f64::consts::TAU;

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["slow clouds", "bursts", "drawn in with speed"],
    fits: wet,
    draw,
    ..Family::new("air_ingestion")
};

enum Form {
    /// A share that comes and goes.
    Clouds([(f64, f64); 2]),
    /// Clouds that pass within a second or so: (centre s, width s).
    Bursts(Vec<(f64, f64)>),
    /// More with speed, and never even.
    Drawn([(f64, f64); 2]),
}

struct Bubbles {
    form: Form,
    share: f64,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let mut waves =
        || [(dice.between(0.05, 0.15), dice.between(0.0, TAU)), (dice.between(0.2, 0.5), dice.between(0.0, TAU))];
    let form = match form {
        0 => Form::Clouds(waves()),
        2 => Form::Drawn(waves()),
        _ => Form::Bursts(
            (0..6 + dice.index(8))
                .map(|_| (dice.between(0.0, full.duration_s), dice.between(0.2, 1.0)))
                .collect(),
        ),
    };
    Box::new(Bubbles { form, share: 0.0 })
}

fn clouds(waves: &[(f64, f64); 2], time_s: f64) -> f64 {
    let sum: f64 = waves.iter().map(|(hz, phase)| (TAU * hz * time_s + phase).sin()).sum();
    0.5 + 0.25 * sum
}

impl Physics for Bubbles {
    fn set(&mut self, strength: f64) {
        self.share = strength;
    }

    fn forces(&self, now: &Now, thrust_n: &mut f64, torque_n_m: &mut f64) {
        let air = match &self.form {
            Form::Clouds(waves) => clouds(waves, now.time_s),
            Form::Bursts(list) => list
                .iter()
                .map(|(at, width)| (-((now.time_s - at) / width).powi(2)).exp())
                .sum::<f64>()
                .min(1.0),
            Form::Drawn(waves) => clouds(waves, now.time_s) * 1.3 * now.relative_speed().abs().min(1.2),
        };
        let left = 1.0 - self.share * air;
        *thrust_n *= left;
        *torque_n_m *= left;
    }
}
