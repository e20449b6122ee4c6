//! The flow leaves the blades.

use super::{Family, wet};
use crate::blades::Inflow;
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["gradual from the trailing edge", "abrupt with hysteresis", "lift kept, drag rises"],
    fits: wet,
    draw,
    ..Family::new("blade_stall")
};

enum Form {
    /// Separation slides in over an angle, within some chords.
    Gradual { width: f64 },
    /// Leaves at one angle, comes back at a smaller one.
    Abrupt { back: f64 },
    /// A bubble: drag comes up, lift less.
    Bubble { width: f64 },
}

struct Stall {
    form: Form,
    angle: f64,
    chords: f64,
    loss: f64,
    separated: Lag,
    away: bool,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Gradual { width: dice.between(0.02, 0.05) },
        1 => Form::Abrupt { back: dice.between(0.7, 0.92) },
        _ => Form::Bubble { width: dice.between(0.03, 0.08) },
    };
    let angle = dice.between(0.2, 0.33);
    Box::new(Stall { form, angle, chords: dice.between(2.0, 10.0), loss: 0.0, separated: Lag::default(), away: false })
}

impl Physics for Stall {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn rest(&mut self) {
        (self.separated, self.away) = (Lag::default(), false);
    }

    fn bends_polar(&self) -> bool {
        true
    }

    fn polar(&self, now: &Now, _: &Inflow, lift: &mut f64, drag: &mut f64) {
        let gone = self.loss * self.separated.value;
        if let Form::Bubble { .. } = self.form {
            let dynamic = now.machine.blades.as_ref().map_or(1.0, |b| b.drag_max);
            *drag += 0.8 * gone * dynamic;
            *lift *= 1.0 - 0.3 * gone;
        } else {
            *lift *= 1.0 - gone;
        }
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        let Some(blades) = &now.machine.blades else { return };
        let inflow = Inflow {
            tangential_m_s: blades.arm_m() * now.speed_rad_s,
            axial_m_s: now.flow_m_s,
            section: crate::blades::Section { radius_ratio: 0.7, share: 1.0, pitch_rad: blades.pitch_rad },
        };
        let attack = inflow.attack_rad().abs();
        let wanted = match self.form {
            Form::Gradual { width } | Form::Bubble { width } => {
                1.0 / (1.0 + (-(attack - self.angle) / width).exp())
            }
            Form::Abrupt { back } => {
                let edge = if self.away { back * self.angle } else { self.angle };
                self.away = attack > edge;
                f64::from(self.away)
            }
        };
        let rate = (now.chords_per_s() / self.chords).max(0.5);
        self.separated.follow(wanted, 1.0 / rate, step_s);
    }
}
