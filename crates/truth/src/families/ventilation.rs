//! Air from the surface reaches the blades.

use super::{Family, wet};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Now, Path, Physics};

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Blade,
    forms: &["hysteresis in speed", "hysteresis in loading", "gradual, with a slow recovery"],
    fits: wet,
    draw,
    ..Family::new("ventilation")
};

/// Thrust and torque fall abruptly beyond a threshold and come back late.
struct Air {
    form: usize,
    threshold: f64,
    back: f64,
    in_s: f64,
    out_s: f64,
    torque_share: f64,
    loss: f64,
    vented: Lag,
    open: bool,
}

fn draw(form: usize, _: &Machine, _: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    Box::new(Air {
        form,
        threshold: if form == 1 { dice.between(0.35, 0.7) } else { dice.between(0.6, 0.85) },
        back: dice.between(0.6, 0.85),
        in_s: dice.between(0.03, 0.15),
        out_s: dice.between(0.15, 0.6),
        torque_share: dice.between(0.75, 1.0),
        loss: 0.0,
        vented: Lag::default(),
        open: false,
    })
}

impl Physics for Air {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn rest(&mut self) {
        (self.vented, self.open) = (Lag::default(), false);
    }

    fn forces(&self, _: &Now, thrust_n: &mut f64, torque_n_m: &mut f64) {
        *thrust_n *= 1.0 - self.loss * self.vented.value;
        *torque_n_m *= 1.0 - self.torque_share * self.loss * self.vented.value;
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        // Loading is the thrust that water would give: what is lost does not close the air off.
        let sign = match self.form {
            1 => now.thrust_n.abs() / (now.full.thrust_n * (1.0 - self.loss * self.vented.value).max(0.05)),
            _ => now.relative_speed().abs(),
        };
        let edge = if self.open { self.back * self.threshold } else { self.threshold };
        self.open = sign > edge;
        let wanted = match self.form {
            2 if self.open => ((sign - self.back * self.threshold) / (1.0 - self.back * self.threshold)).min(1.0),
            _ => f64::from(self.open),
        };
        let time_s = if wanted > self.vented.value { self.in_s } else { self.out_s };
        self.vented.follow(wanted, time_s, step_s);
    }
}
