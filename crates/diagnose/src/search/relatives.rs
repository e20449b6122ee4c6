//! What members of a set are confused with, fitted from every start.

use kort_identify::fit::{Columns, Fit};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_identify::noise::Floor;
use kort_thruster::effects::Descriptor;
use rayon::prelude::*;

use super::{FIRST_STEPS, ITERATIONS, Search, Set, with, without};
use crate::probe::bends;

/// Starts from which first steps are taken.
const MOST_BEGUN: usize = 3;

impl Search<'_, '_> {
    /// Fits, in the place of a member, what the catalogue says it is confused with and no screen led to, or not well: play,
    /// friction or a limit at another size is another motion, of which one linear step says nothing, and an equation that
    /// holds a plainer one within itself finds a way on which the plainer one got lost. The best set.
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
                .filter(|(e, _)| related(e) && !rest.contains(&e.id))
                .filter(|(e, probes)| bends(probes) || self.fits.contains_key(&with(&rest, e.id)))
                .map(|(e, _)| *e)
                .collect();
            self.ensure(&rest, set);
            for effect in others {
                let place = with(&rest, effect.id);
                let floor = self.floor_of(&place);
                if !self.fits.contains_key(&place) {
                    let Some(parent) = self.fits.get(&rest).cloned() else { break };
                    if let Some(fit) = self.best_of_every_start(&parent, effect, &floor) {
                        self.keep(place.clone(), fit);
                    }
                }
                // The fit's own cost: priors grow with the temper, and the same exchange would be begun again.
                let begun_from = self.fits.get(set).map_or(f64::INFINITY, Fit::cost).to_bits();
                if self.exchanged.insert((set.clone(), place.clone(), begun_from))
                    && let Some(fit) = self.exchange(set, member, effect, &floor)
                {
                    self.keep(place.clone(), fit);
                }
                tried.push(place);
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
        let beside = |(start, values): (&Vec<f64>, &[f64])| {
            (parent.hypothesis.with(values, whole.clone().at(start.clone()), scale), Vec::new())
        };
        let begun = starts.iter().flat_map(|s| [(s, &parent.values[..]), (s, &stated[..])]).map(beside);
        let best = self.begun(begun.collect(), floor)?;
        Some(self.problem.settle(&best.resume(), &best.columns, floor, ITERATIONS))
    }

    /// The best fit with an effect in the place of a member, all else where the set's fit has it; none where a
    /// few steps do not lead near, or it does no better than what is known of that set.
    fn exchange(&self, set: &Set, member: &str, effect: &'static Descriptor, floor: &Floor) -> Option<Fit> {
        let from = self.fits.get(set)?;
        let place = with(&without(set, member), effect.id);
        let known = self.cost(&place);
        if known <= self.cost(set) {
            return None;
        }
        let scale = &self.problem.scale;
        let mut members = self.problem.members(&from.hypothesis, &from.values);
        let at = members.iter().position(|m| m.effect.id == member)?;
        let old = members.remove(at);
        let whole = Member::new(effect, scale);
        let mut starts = whole.starts(scale);
        // A size of the same kind is taken over.
        let (specs, old_specs) = ((effect.parameters)(scale), (old.effect.parameters)(scale));
        if let (Some(new), Some(was)) = (specs.first(), old_specs.first())
            && new.unit == was.unit
            && !new.shape
            && !was.shape
        {
            let mut taken = whole.values.clone();
            taken[0] = old.values[0].clamp(new.low, new.high);
            starts.push(taken);
        }
        let (base, columns) = self.problem.recompose(from, &members);
        let beside =
            |start: Vec<f64>| (base.with(&base.start, whole.clone().at(start), scale), columns.clone());
        let best = self.begun(starts.into_iter().map(beside).collect(), floor)?;
        let first = self.problem.finish(best);
        let reach = self.cost(set) + self.doubt(known.min(first.cost()) - self.cost(set));
        if first.cost() + self.prior(&place) > reach {
            return None;
        }
        let fit = self.problem.settle(&first.resume(), &first.columns, floor, ITERATIONS);
        (fit.cost() + self.prior(&place) < known).then_some(fit)
    }

    /// Of hypotheses that begin somewhere, the one that a few steps lead furthest.
    fn begun(&self, starts: Vec<(Hypothesis, Columns)>, floor: &Floor) -> Option<Fit> {
        let merit = |fit: &Fit| fit.noise.misfit + fit.penalty;
        let steps = |(hypothesis, columns): &(Hypothesis, Columns), steps| {
            self.problem.fit(hypothesis, columns, floor, steps)
        };
        let mut begun: Vec<((Hypothesis, Columns), f64)> = starts
            .into_par_iter()
            .map(|start| {
                let merit = merit(&steps(&start, 0));
                (start, merit)
            })
            .filter(|(_, merit)| merit.is_finite())
            .collect();
        begun.sort_by(|a, b| a.1.total_cmp(&b.1));
        begun.truncate(MOST_BEGUN);
        begun
            .par_iter()
            .map(|(start, _)| steps(start, FIRST_STEPS))
            .min_by(|a, b| merit(a).total_cmp(&merit(b)))
    }
}
