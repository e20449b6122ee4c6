//! The drive gives less current than stated.

use super::{Family, current_driven};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Drive, Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["hard", "soft knee", "fold-back with heat"],
    anchors: &[Quantity::TorqueConstant],
    fits: current_driven,
    draw,
    ..Family::new("current_saturation")
};

enum Form {
    /// |i| <= limit.
    Hard,
    /// Bends over within a share of the limit.
    Soft(f64),
    /// The limit falls as the square of the current heats the drive.
    FoldBack(f64),
}

struct Limit {
    form: Form,
    loss: f64,
    heat: Lag,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let form = match form {
        0 => Form::Hard,
        1 => Form::Soft(dice.between(0.03, 0.12)),
        _ => Form::FoldBack(dice.between(0.02, 0.1) * full.duration_s),
    };
    Box::new(Limit { form, loss: 0.0, heat: Lag::default() })
}

impl Physics for Limit {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn rest(&mut self) {
        self.heat = Lag::default();
    }

    fn drive(&self, now: &Now, drive: &mut Drive) {
        let full = now.full.command;
        let limit = match self.form {
            Form::Hard => full * (1.0 - self.loss),
            // The knee begins where the limit would be.
            Form::Soft(knee) => full * (1.0 + 3.0 * knee - self.loss),
            Form::FoldBack(_) => full * (1.0 - self.loss * (0.5 + 0.8 * self.heat.value)).max(0.05),
        };
        if let Form::Soft(knee) = self.form {
            // A smooth minimum of the two.
            let (asked, width) = (drive.target.abs(), knee * full);
            let over = asked - limit;
            let bent = 0.5 * (asked + limit - (over * over + width * width).sqrt() + (limit * limit + width * width).sqrt() - limit);
            drive.target = drive.target.signum() * bent.max(0.0);
        } else {
            drive.current_limit_a = drive.current_limit_a.min(limit);
        }
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        if let Form::FoldBack(time_s) = self.form {
            self.heat.follow(now.relative_current().powi(2), time_s, step_s);
        }
    }
}
