//! Converters with few bits, logs with few digits.

use super::{Kind, Noise, Spoil, commanded, full_scale};
use crate::dice::Dice;
use crate::log::Table;
use crate::machine::{Machine, Scale};

/// The kind.
pub const KIND: Kind = Kind { name: "quantisation", names: &[], share: 0.35, fits: |_| true, draw };

struct Steps {
    share: f64,
}

fn draw(_: &Machine, _: &Scale, dice: &mut Dice) -> Noise {
    Noise::Logged(Box::new(Steps { share: dice.log_between(5e-4, 6e-3) }))
}

impl Spoil for Steps {
    fn spoil(&mut self, table: &mut Table, dice: &mut Dice) {
        for (name, cells) in &mut table.columns {
            if commanded(name) || *name == "shaft_angle_rad" || dice.chance(0.4) {
                continue;
            }
            let step = self.share * full_scale(cells);
            if step > 0.0 {
                cells.iter_mut().for_each(|cell| *cell = (*cell / step).round() * step + 0.0);
            }
        }
    }
}
