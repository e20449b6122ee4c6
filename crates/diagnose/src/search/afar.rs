//! Looks for effects from where the rig states roughly what it states, beside where the baseline bent it to.

use std::collections::BTreeMap;

use super::{Search, Set};
use crate::probe::Probe;
use crate::screen::{Screened, screen};

impl Search<'_, '_> {
    /// Where the baseline bent what is stated roughly, fits single effects from what is stated, and from a standard
    /// deviation off, if a screen there promises what comes near the best that is known: what an effect does is nearly the
    /// same there as on the baseline, what it is worth is not. Where two such numbers make up for each other, a baseline
    /// without the physics ends with the wrong one bent, and what is looked for from there is what suits that. An effect
    /// must promise what the baseline's own numbers do not promise from there, and more than it did before.
    pub(super) fn look_from_afar(&mut self) {
        let none = Set::new();
        let Some(baseline) = self.fits.get(&none) else { return };
        let afar = baseline.resume().begun_afar(&self.problem.information(baseline));
        let floor = baseline.floor.clone();
        let mut promised: BTreeMap<&'static str, f64> = BTreeMap::new();
        let known = self.screens.get(&none).map_or(&[][..], Vec::as_slice);
        note(&mut promised, known);
        for from in afar {
            let there = self.problem.finish(self.problem.fit(&from, &Vec::new(), &floor, 0));
            if there.broke_down() {
                continue;
            }
            let Some(probes) = self.probes.get(&none) else { return };
            let probes: Vec<&[Probe]> = probes.iter().map(Vec::as_slice).collect();
            let alone = self.problem.promised(&there);
            let screened = screen(self.problem, &there, &probes, |promise| {
                let effect = promise.member.effect.id;
                let pays = promise.cost + self.price_of(effect) < alone + self.doubt(alone - promise.cost);
                let before = promised.get(effect).copied().unwrap_or(f64::INFINITY);
                pays && promise.cost < before - self.constants.rivals
            });
            note(&mut promised, &screened);
            let best = self.fits.keys().map(|set| self.cost(set)).fold(f64::INFINITY, f64::min);
            self.fit_those_that_may(&none, screened, best);
        }
    }
}

/// Keeps the most that each effect has promised.
fn note(promised: &mut BTreeMap<&'static str, f64>, screened: &[Screened]) {
    for one in screened {
        let known = promised.entry(one.effect.id).or_insert(f64::INFINITY);
        *known = known.min(one.cost);
    }
}
