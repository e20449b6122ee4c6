//! The stand rings.

use std::f64::consts::TAU;

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Second;
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Sensor,
    forms: &["one mode", "two modes", "a mode the shaft drives too"],
    fits: wet,
    draw,
    ..Family::new("stand_resonance")
};

struct Stand {
    /// Frequency (Hz), damping, share.
    modes: Vec<(f64, f64, f64)>,
    /// Share of the reaction torque that reaches the cell, 1/m.
    torque_per_m: f64,
    share: f64,
    places: Vec<Second>,
}

fn draw(form: usize, machine: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let hz = dice.between(5.0, 28.0);
    let mut modes = vec![(hz, dice.between(0.01, 0.05), 1.0)];
    if form == 1 {
        modes.push((hz * dice.between(1.4, 2.2), dice.between(0.01, 0.05), dice.between(0.2, 0.5)));
    }
    let radius = machine.blades.as_ref().map_or(1.0, |b| b.radius_m);
    let torque_per_m = if form == 2 { dice.side() * 0.3 / radius } else { 0.0 };
    let places = vec![Second::default(); modes.len()];
    Box::new(Stand { modes, torque_per_m, share: 0.0, places })
}

impl Physics for Stand {
    fn set(&mut self, strength: f64) {
        self.share = 1.2 * strength;
    }

    fn rest(&mut self) {
        self.places.fill(Second::default());
    }

    fn stand(&mut self, now: &Now, force_n: &mut f64, step_s: f64) {
        let input = *force_n + self.torque_per_m * now.blade_torque_n_m;
        for ((hz, damping, share), place) in self.modes.iter().zip(&mut self.places) {
            let shaken = place.follow(input, TAU * hz, *damping, step_s);
            *force_n += self.share * share * (shaken - input);
        }
    }
}
