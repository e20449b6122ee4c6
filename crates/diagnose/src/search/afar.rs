//! Looks for effects from where the rig states roughly what it states, beside where the baseline bent it to.

use super::{Search, Set};
use crate::probe::Probe;
use crate::screen::screen;

impl Search<'_, '_> {
    /// Where the baseline bent what is stated roughly, fits single effects from what is stated, and from a standard
    /// deviation off, if a screen there promises what comes near the best that is known: what an effect does is nearly the
    /// same there as on the baseline, what it is worth is not. Where two such numbers make up for each other, a baseline
    /// without the physics ends with the wrong one bent, and what is looked for from there is what suits that.
    pub(super) fn look_from_afar(&mut self) {
        let none = Set::new();
        let Some(baseline) = self.fits.get(&none) else { return };
        let afar = baseline.resume().begun_afar(&self.problem.information(baseline));
        let floor = baseline.floor.clone();
        for from in afar {
            let there = self.problem.finish(self.problem.fit(&from, &Vec::new(), &floor, 0));
            if there.broke_down() {
                continue;
            }
            let Some(probes) = self.probes.get(&none) else { return };
            let probes: Vec<&[Probe]> = probes.iter().map(Vec::as_slice).collect();
            let screened = screen(self.problem, &there, &probes);
            let best = self.fits.keys().map(|set| self.cost(set)).fold(f64::INFINITY, f64::min);
            self.fit_those_that_may(&none, screened, best);
        }
    }
}
