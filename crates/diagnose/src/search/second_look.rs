//! What the best set leaves, looked at once more with less excuse.
//!
//! What explains a mismatch is excused for a share of it, which is what the forms of some effects are off by and much more
//! than those of others are. Below it what is weak beside what is strong hides. How exact a form is, is one more thing
//! that the recordings tell: where a set with more names, held to a quarter of the excuse, costs less than the best one
//! under all of it, the forms were as exact as that.

use std::collections::{BTreeMap, BTreeSet};

use kort_identify::fit::Fit;

use super::{MOST_EFFECTS, Search, Set, words};

impl Search<'_, '_> {
    /// Climbs on from a set with less excuse for what explains the mismatch. Where that leads to more names at less cost, every
    /// set is weighed so from there on; the best set.
    pub(super) fn second_look(&mut self, best: Set, progress: &(dyn Fn(&str) + Sync)) -> Set {
        if best.is_empty() {
            return best;
        }
        progress(&format!("once more, on top of {}", words(&best)));
        let share = self.constants.closer;
        let mut closer = self.held_closer(&best, share);
        let mut found = best.clone();
        while found.len() < MOST_EFFECTS {
            let next = closer.forward(&found);
            if next == found {
                break;
            }
            let next = closer.settled(next, progress);
            if closer.cost(&next) >= closer.cost(&found) {
                break;
            }
            found = next;
        }
        if found.len() <= best.len() || closer.cost(&found) >= self.cost(&best) {
            return best;
        }
        for (set, fit) in &self.fits {
            closer.keep(set.clone(), self.problem.finish(closer_of(fit, share)));
        }
        *self = closer;
        found
    }

    /// A search that has the baseline and one set, each held to a share of the form error of what explains the mismatch.
    fn held_closer(&self, set: &Set, share: f64) -> Self {
        let none = Set::new();
        let kept = [&none, set].into_iter().filter_map(|set| Some((set, self.fits.get(set)?)));
        let floors = self.floors.iter().map(|(under, floor)| (*under, floor.excusing_less(share)));
        let mut closer = Self {
            problem: self.problem,
            effects: self.effects.clone(),
            fits: kept.map(|(set, fit)| (set.clone(), self.problem.finish(closer_of(fit, share)))).collect(),
            screens: BTreeMap::new(),
            begun_from: BTreeSet::new(),
            dropped: BTreeMap::new(),
            reshaped: BTreeSet::new(),
            barred: Set::new(),
            exchanged: BTreeSet::new(),
            probes: self.probes.clone(),
            ways: self.ways.clone(),
            floors: floors.collect(),
            disguised: BTreeMap::new(),
            constants: self.constants,
            odds: self.odds,
        };
        let from = closer.fits[set].clone();
        closer.fit_set(set.clone(), &from.resume(), &from.columns);
        closer
    }
}

/// A fit under less excuse, where it stands.
fn closer_of(fit: &Fit, share: f64) -> Fit {
    Fit { floor: fit.floor.excusing_less(share), ..fit.clone() }
}
