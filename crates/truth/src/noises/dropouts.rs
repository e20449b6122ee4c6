//! Cells that were not sampled.

use super::{Kind, Noise, Spoil, commanded};
use crate::dice::Dice;
use crate::log::Table;
use crate::machine::{Machine, Scale};

/// The kind.
pub const KIND: Kind = Kind { name: "dropouts", names: &[], share: 0.2, fits: |_| true, draw };

struct Empty {
    share: f64,
}

fn draw(_: &Machine, _: &Scale, dice: &mut Dice) -> Noise {
    Noise::Logged(Box::new(Empty { share: dice.log_between(0.005, 0.3) }))
}

impl Spoil for Empty {
    fn spoil(&mut self, table: &mut Table, dice: &mut Dice) {
        for (name, cells) in &mut table.columns {
            // A measured current may be what drives the model: it keeps most of its cells.
            let share = if *name == "current_a" { 0.1 * self.share } else { self.share };
            if commanded(name) || dice.chance(0.4) {
                continue;
            }
            cells.iter_mut().for_each(|cell| {
                if dice.chance(share) {
                    *cell = f64::NAN;
                }
            });
        }
    }
}
