//! Rows that a logger missed: at random, or just when something happened.

use super::{Kind, Noise, Spoil, commanded, full_scale};
use crate::dice::Dice;
use crate::log::Table;
use crate::machine::{Machine, Scale};

/// The kind.
pub const KIND: Kind = Kind { name: "gaps", names: &["log_gaps"], share: 0.18, fits: |_| true, draw };

struct Gaps {
    after_steps: bool,
    count: usize,
    length_s: f64,
}

fn draw(_: &Machine, _: &Scale, dice: &mut Dice) -> Noise {
    Noise::Logged(Box::new(Gaps {
        after_steps: dice.chance(0.5),
        count: 1 + dice.index(6),
        length_s: dice.log_between(0.04, 0.6),
    }))
}

impl Spoil for Gaps {
    fn spoil(&mut self, table: &mut Table, dice: &mut Dice) {
        let (first, last) = (table.time_s[0], table.time_s[table.time_s.len() - 1]);
        let mut starts: Vec<f64> =
            (0..self.count).map(|_| dice.between(first + 0.5, (last - 1.0).max(first + 0.6))).collect();
        let command = table.columns.iter().find(|(name, _)| commanded(name));
        if let (true, Some((_, cells))) = (self.after_steps, command) {
            // After most large steps up the logger is busy for a while.
            let full = full_scale(cells);
            starts = (1..cells.len())
                .filter(|&row| cells[row] - cells[row - 1] > 0.5 * full)
                .map(|row| table.time_s[row])
                .collect();
            starts.retain(|_| dice.chance(0.8));
        }
        let length_s = if self.after_steps { self.length_s.min(0.12) } else { self.length_s };
        let keep: Vec<bool> =
            table.time_s.iter().map(|t| !starts.iter().any(|s| *t > *s && *t < s + length_s)).collect();
        table.retain(&keep);
    }
}
