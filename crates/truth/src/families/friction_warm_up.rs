//! Grease and seals that rub less as they warm.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::physics::{Now, Path, Physics, Shaft};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Shaft,
    forms: &["falls with time", "falls with the heat it makes", "falls with turns made"],
    fits: any,
    draw,
    ..Family::new("friction_warm_up")
};

enum Form {
    /// exp(-t/T).
    Time(f64),
    /// Heat = friction power, cooling slowly; friction / (1 + heat).
    Heat { capacity: f64 },
    /// exp(-turns/N): grease that spreads.
    Turns(f64),
}

struct Warm {
    form: Form,
    viscous_share: f64,
    full_n_m: f64,
    level_n_m: f64,
    warmth: f64,
}

fn draw(form: usize, machine: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let share = dice.between(0.15, 0.5);
    let form = match form {
        0 => Form::Time(share * full.duration_s),
        1 => Form::Heat { capacity: 0.3 * share * full.duration_s },
        _ => Form::Turns(0.4 * share * full.duration_s * full.speed_rad_s),
    };
    Box::new(Warm {
        form,
        viscous_share: dice.pick(&[0.0, 0.5, 1.0]),
        full_n_m: machine.torque_limit_n_m(),
        level_n_m: 0.0,
        warmth: 0.0,
    })
}

impl Warm {
    fn left(&self) -> f64 {
        match self.form {
            Form::Time(_) | Form::Turns(_) => (-self.warmth).exp(),
            Form::Heat { .. } => 1.0 / (1.0 + self.warmth),
        }
    }
}

impl Physics for Warm {
    fn set(&mut self, strength: f64) {
        self.level_n_m = strength * self.full_n_m;
    }

    fn rest(&mut self) {
        self.warmth = 0.0;
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        let level = self.level_n_m * self.left();
        let dry = level * (1.0 - self.viscous_share);
        shaft.torque_n_m += level * self.viscous_share * now.relative_speed();
        shaft.rub(dry, dry);
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        self.warmth += step_s
            * match self.form {
                Form::Time(time_s) => 1.0 / time_s,
                Form::Heat { capacity } => self.left() * now.relative_speed().abs() / capacity,
                Form::Turns(angle) => now.speed_rad_s.abs() / angle,
            };
    }
}
