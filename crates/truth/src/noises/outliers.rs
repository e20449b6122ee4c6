//! Single samples that are wrong.

use super::{Kind, Noise, Spoil, commanded, full_scale};
use crate::dice::Dice;
use crate::log::Table;
use crate::machine::{Machine, Scale};

/// The kind.
pub const KIND: Kind = Kind { name: "outliers", names: &[], share: 0.15, fits: |_| true, draw };

struct Spikes {
    share: f64,
    size: f64,
}

fn draw(_: &Machine, _: &Scale, dice: &mut Dice) -> Noise {
    Noise::Logged(Box::new(Spikes { share: dice.log_between(2e-4, 1e-3), size: dice.between(0.2, 1.0) }))
}

impl Spoil for Spikes {
    fn spoil(&mut self, table: &mut Table, dice: &mut Dice) {
        for (name, cells) in &mut table.columns {
            if commanded(name) || *name == "shaft_angle_rad" || *name == "current_a" {
                continue;
            }
            let full = full_scale(cells);
            cells.iter_mut().for_each(|cell| {
                if dice.chance(self.share) {
                    *cell += dice.side() * self.size * full;
                }
            });
        }
    }
}
