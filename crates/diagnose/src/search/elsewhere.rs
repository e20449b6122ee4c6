//! The search begun once more, on another way.
//!
//! What acts out of proportion to its size may take a whole motion with it: a shaft that friction holds while an observer
//! or a command moves it all the same does nothing that other effects could change. Each step on top of it finds
//! nothing, though the set that is true was never come to.

use nalgebra::DVector;

use super::{MOST_EFFECTS, Search, Set};
use crate::left::leaves_more;

/// Share of an effect's action on the baseline that a set's action leaves of it where it is another way to explain.
const OTHER: f64 = 0.5;

impl Search<'_, '_> {
    /// Where the best set leaves more than noise, climbs from the best single effect that explains something else than
    /// the set does, first without those that explain the same, as long as that leads to a better one. The best set.
    pub(super) fn elsewhere(&mut self, best: Set, progress: &(dyn Fn(&str) + Sync)) -> Set {
        let (mut best, mut known) = (best, Set::new());
        while leaves_more(self.problem, &self.fits[&best]) {
            let (same, other) = self.ways_beside(&best, &known);
            let Some(mut there) = other else { break };
            known.extend(&same);
            self.barred = same;
            while there.len() < MOST_EFFECTS {
                progress(&format!("another way, on top of {}", there.join(", ")));
                let next = self.forward(&there);
                if next == there {
                    break;
                }
                there = self.settled(next, progress);
            }
            self.barred = Set::new();
            there = self.climb(there, progress);
            if self.cost(&there) >= self.cost(&best) {
                break;
            }
            best = there;
        }
        best
    }

    /// The single effects whose action on the baseline is the set's, and the cheapest of the others that pays, is not
    /// known to lead elsewhere, and on top of which nothing was tried.
    pub(super) fn ways_beside(&self, set: &Set, known: &Set) -> (Set, Option<Set>) {
        let none = Set::new();
        let Some(baseline) = self.fits.get(&none) else { return (none, None) };
        let action = |set: &Set| &baseline.lines - &self.fits[set].lines;
        let size = |lines: &DVector<f64>| {
            let powers = self.problem.spectrum.powers(lines);
            let counted = self.problem.spectrum.bands.iter().zip(&baseline.noise.weight).zip(powers);
            counted.map(|((band, weight), power)| weight * power * band.lines.len() as f64).sum::<f64>()
        };
        let whole = action(set);
        let alone = self.fits.keys().filter(|alone| alone.len() == 1).cloned();
        let (same, mut other): (Vec<Set>, Vec<Set>) = alone.partition(|alone| {
            let own = action(alone);
            size(&(&own - &whole)) < OTHER * size(&own)
        });
        other.retain(|alone| {
            !set.contains(&alone[0])
                && !known.contains(&alone[0])
                && !self.screens.contains_key(alone)
                && self.cost(alone) < self.cost(&none)
        });
        let first = other.into_iter().min_by(|a, b| self.cost(a).total_cmp(&self.cost(b)));
        (same.concat(), first)
    }
}
