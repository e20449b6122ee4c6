//! What members of a set are confused with, fitted from every start.

use kort_identify::fit::Fit;
use kort_identify::hypothesis::Member;
use kort_identify::noise::Floor;
use kort_thruster::effects::Descriptor;
use rayon::prelude::*;

use super::{FIRST_STEPS, ITERATIONS, Search, Set, with, without};
use crate::probe::bends;

/// Starts from which first steps are taken.
const MOST_BEGUN: usize = 3;

impl Search<'_, '_> {
    /// Fits, in the place of a member, what the catalogue says it is confused with and no screen led to: play, friction
    /// or a limit at another size is another motion, of which one linear step says nothing. The best set.
    pub(super) fn relatives(&mut self, set: &Set) -> Set {
        let mut tried = Vec::new();
        for member in set {
            let rest = without(set, member);
            let Some(named) = self.descriptor(member) else { continue };
            let related =
                |e: &Descriptor| named.confused_with.contains(&e.id) || e.confused_with.contains(member);
            let Some(probes) = self.probes.get(&self.equations(&rest)) else { continue };
            let others: Vec<&'static Descriptor> = self
                .effects
                .iter()
                .zip(probes)
                .filter(|(e, probes)| related(e) && bends(probes) && !rest.contains(&e.id))
                .map(|(e, _)| *e)
                .collect();
            self.ensure(&rest, set);
            for effect in others {
                let place = with(&rest, effect.id);
                if self.fits.contains_key(&place) {
                    continue;
                }
                let Some(parent) = self.fits.get(&rest).cloned() else { break };
                if let Some(fit) = self.best_of_every_start(&parent, effect, &self.floor_of(&place)) {
                    self.keep(place.clone(), fit);
                    tried.push(place);
                }
            }
        }
        self.better(set.clone(), tried)
    }

    /// The best fit with one more effect of those that begin at each of its starts, beside the parent's values and
    /// beside the stated ones, which the parent had to bend.
    fn best_of_every_start(&self, parent: &Fit, effect: &'static Descriptor, floor: &Floor) -> Option<Fit> {
        let scale = &self.problem.scale;
        let whole = Member::new(effect, scale);
        let starts = whole.starts(scale);
        let stated: Vec<f64> = (parent.hypothesis.free.iter().zip(&parent.values))
            .map(|(free, value)| if free.stated { free.mean } else { *value })
            .collect();
        let merit = |fit: &Fit| fit.noise.misfit + fit.penalty;
        let stand = |(start, values): (&Vec<f64>, &[f64])| {
            let hypothesis = parent.hypothesis.with(values, whole.clone().at(start.clone()), scale);
            self.problem.fit(&hypothesis, &Vec::new(), floor, 0)
        };
        let begun: Vec<(&Vec<f64>, &[f64])> =
            starts.iter().flat_map(|s| [(s, &parent.values[..]), (s, &stated[..])]).collect();
        let mut begun: Vec<Fit> = begun.into_par_iter().map(stand).filter(|f| merit(f).is_finite()).collect();
        begun.sort_by(|a, b| merit(a).total_cmp(&merit(b)));
        begun.truncate(MOST_BEGUN);
        let best = begun
            .par_iter()
            .map(|fit| self.problem.fit(&fit.hypothesis, &Vec::new(), floor, FIRST_STEPS))
            .min_by(|a, b| merit(a).total_cmp(&merit(b)))?;
        Some(self.problem.settle(&best.resume(), &best.columns, floor, ITERATIONS))
    }
}
