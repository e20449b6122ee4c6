//! Magnets that weaken as the motor warms.

use super::{Family, any};
use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::Lag;
use crate::physics::{Drive, Now, Path, Physics};
use crate::statement::Quantity;

/// The family.
pub const FAMILY: Family = Family {
    path: Path::Drive,
    forms: &["winding alone", "winding and housing", "copper loss kept"],
    anchors: &[Quantity::TorqueConstant],
    fits: any,
    draw,
    ..Family::new("thermal_drift_kt")
};

struct Heat {
    /// Times of winding and housing, s; the second is zero where there is none.
    time_s: [f64; 2],
    share: f64,
    nodes: [Lag; 2],
    loss: f64,
}

fn draw(form: usize, _: &Machine, full: &Scale, dice: &mut Dice) -> Box<dyn Physics> {
    let quick = dice.between(0.2, 0.9) * full.duration_s;
    let (time_s, share) = match form {
        0 => ([quick, 0.0], 1.0),
        1 => ([0.3 * quick, 2.0 * quick], dice.between(0.3, 0.6)),
        // Far longer than the run: what the copper loses stays.
        _ => ([5.0 * full.duration_s, 0.0], 5.0),
    };
    Box::new(Heat { time_s, share, nodes: [Lag::default(); 2], loss: 0.0 })
}

impl Physics for Heat {
    fn set(&mut self, strength: f64) {
        self.loss = strength;
    }

    fn rest(&mut self) {
        self.nodes = [Lag::default(); 2];
    }

    fn drive(&self, _: &Now, drive: &mut Drive) {
        let second = if self.time_s[1] > 0.0 { (1.0 - self.share) * self.nodes[1].value } else { 0.0 };
        drive.torque_gain *= (1.0 - self.loss * (self.share * self.nodes[0].value + second)).max(0.1);
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        let power = now.relative_current().powi(2);
        for (node, time_s) in self.nodes.iter_mut().zip(self.time_s) {
            if time_s > 0.0 {
                node.follow(power, time_s, step_s);
            }
        }
    }
}
