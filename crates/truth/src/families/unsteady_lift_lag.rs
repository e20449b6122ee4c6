//! Lift takes chords to build.

use super::{Family, wet};
use crate::blades::Inflow;
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["two exponentials", "one exponential", "two exponentials, slower tail"],
    fits: wet,
    draw,
    ..Family::new("unsteady_lift_lag")
};

/// Part of the lift comes late, in chords travelled: shares and rates (per half chord) of an
/// indicial function (R. T. Jones 1940 for a flat plate).
struct Late {
    shares: [f64; 2],
    rates: [f64; 2],
    chord_m: f64,
    /// Late part of sin 2a at the reference section.
    memory: [Lag; 2],
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let (shares, rates) = match form {
        0 => ([0.165, 0.335], [0.0455, 0.3]),
        1 => ([dice.between(0.4, 0.55), 0.0], [dice.between(0.1, 0.25), 1.0]),
        _ => ([dice.between(0.2, 0.3), 0.3], [dice.between(0.02, 0.04), 0.25]),
    };
    Box::new(Late { shares, rates, chord_m: 0.0, memory: [Lag::default(); 2] })
}

/// Lift at the reference section: its shape over the angle of attack, signed by the way of turning.
fn circulation(now: &Now) -> f64 {
    let Some(blades) = &now.machine.blades else { return 0.0 };
    let (along, across) = (blades.arm_m() * now.speed_rad_s, now.flow_m_s);
    let speed = along.hypot(across).max(1e-9);
    let (sin, cos) = blades.pitch_rad.sin_cos();
    let (normal, chordwise) = ((sin * along - cos * across) / speed, (cos * along + sin * across) / speed);
    2.0 * normal * chordwise * along.signum()
}

impl Physics for Late {
    fn set(&mut self, strength: f64) {
        self.chord_m = strength;
    }

    fn rest(&mut self) {
        self.memory = [Lag::default(); 2];
    }

    fn bends_polar(&self) -> bool {
        true
    }

    fn polar(&self, now: &Now, inflow: &Inflow, lift: &mut f64, _: &mut f64) {
        let Some(blades) = &now.machine.blades else { return };
        let late: f64 = self.shares.iter().zip(&self.memory).map(|(share, memory)| share * memory.value).sum();
        let shares: f64 = self.shares.iter().sum();
        *lift = (1.0 - shares) * *lift + blades.lift_max * late * inflow.tangential_m_s.signum();
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        let Some(blades) = &now.machine.blades else { return };
        let chord_m = (4.0 * self.chord_m * blades.radius_m).max(1e-6);
        let settled = circulation(now);
        for (memory, rate) in self.memory.iter_mut().zip(self.rates) {
            let per_s = 2.0 * rate * now.blade_speed_m_s() / chord_m;
            memory.follow(settled, 1.0 / per_s.max(1e-6), step_s);
        }
    }
}
