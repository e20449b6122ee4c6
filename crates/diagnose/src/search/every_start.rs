//! What acts out of proportion to its size, begun from every start.

use kort_thruster::effects::Descriptor;

use super::{Search, Set};
use crate::left::leaves_more;
use crate::probe::bends;

impl Search<'_, '_> {
    /// Where a set leaves more than noise, fits alone, from each of its starts, what acts out of proportion to its size
    /// and no screen led to. Play of another width is another motion: what one linear step from any size promises says
    /// nothing of where a fit from there ends. The best set.
    pub(super) fn every_start(&mut self, set: &Set) -> Set {
        let none = Set::new();
        if !leaves_more(self.problem, &self.fits[set]) {
            return set.clone();
        }
        let Some(probes) = self.probes.get(&none) else { return set.clone() };
        let bending = self.effects.iter().zip(probes).filter(|(_, probes)| bends(probes));
        let bending: Vec<&'static Descriptor> = bending.map(|(effect, _)| *effect).collect();
        let mut tried = Vec::new();
        for effect in bending {
            let alone = vec![effect.id];
            if self.fits.contains_key(&alone) {
                continue;
            }
            if let Some(fit) = self.best_of_starts(self.beside(&none, effect), [set, &none, &alone]) {
                self.keep(alone.clone(), fit);
                tried.push(alone);
            }
        }
        self.better(set.clone(), tried)
    }
}
