//! What members of a set are confused with, begun from every start.

use kort_identify::edges::delay_of;
use kort_identify::fit::{Columns, Fit};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_thruster::effects::Descriptor;
use rayon::prelude::*;

use super::{FIRST_STEPS, ITERATIONS, Search, Set, with, without};
use crate::probe::bends;

/// Starts from one place, each with the derivatives that are known there.
type Starts = Vec<(Hypothesis, Columns)>;

impl Search<'_, '_> {
    /// Fits, in the place of a member, what the catalogue says it is confused with and no screen led to, or not well: play,
    /// friction or a limit at another size is another motion, of which one linear step says nothing; what promises half of
    /// what the member gains may give all of it; and an equation that
    /// holds a plainer one within itself finds a way on which the plainer one got lost. The best set.
    pub(super) fn relatives(&mut self, set: &Set) -> Set {
        let mut tried = Vec::new();
        for member in set {
            let rest = without(set, member);
            let Some(named) = self.descriptor(member) else { continue };
            let related =
                |e: &Descriptor| named.confused_with.contains(&e.id) || e.confused_with.contains(member);
            self.ensure(&rest, set);
            let half = self.half_way(&rest, set);
            let promising = |e: &Descriptor| {
                let screened = self.screens.get(&rest).into_iter().flatten();
                screened.into_iter().any(|s| s.effect.id == e.id && s.cost < half)
            };
            let Some(probes) = self.probes.get(&self.equations(&rest)) else { continue };
            let others: Vec<&'static Descriptor> = self
                .effects
                .iter()
                .zip(probes)
                .filter(|(e, _)| related(e) && !rest.contains(&e.id))
                .filter(|(e, probes)| {
                    bends(probes) || promising(e) || self.fits.contains_key(&with(&rest, e.id))
                })
                .map(|(e, _)| *e)
                .collect();
            for effect in others {
                let place = with(&rest, effect.id);
                let mut starts: Vec<Starts> = Vec::new();
                if !self.fits.contains_key(&place) {
                    starts.extend(self.beside(&rest, effect));
                }
                // The fit's own cost: priors grow with the temper, and the same exchange would be begun again.
                let begun_from = self.fits.get(set).map_or(f64::INFINITY, Fit::cost).to_bits();
                if self.exchanged.insert((set.clone(), place.clone(), begun_from))
                    && self.cost(&place) > self.cost(set)
                {
                    starts.extend(self.instead(set, member, effect));
                }
                if let Some(fit) = self.best_of_starts(starts, [set, &rest, &place]) {
                    self.keep(place.clone(), fit);
                }
                tried.push(place);
            }
        }
        self.better(set.clone(), tried)
    }

    /// Half of what a set costs less than a smaller one.
    fn half_way(&self, smaller: &Set, set: &Set) -> f64 {
        let cost = |set: &Set| self.fits.get(set).map_or(f64::NAN, Fit::cost);
        0.5 * (cost(smaller) + cost(set))
    }

    /// An effect at each of its starts on top of a set, beside the set's values and beside the stated ones, which it had
    /// to bend.
    pub(super) fn beside(&self, set: &Set, effect: &'static Descriptor) -> Vec<Starts> {
        let Some(parent) = self.fits.get(set) else { return Vec::new() };
        let scale = &self.problem.scale;
        let whole = Member::new(effect, scale);
        let stated = (parent.hypothesis.free.iter().zip(&parent.values))
            .map(|(free, value)| if free.stated { free.mean } else { *value });
        let stated: Vec<f64> = stated.collect();
        let beside = |values: &Vec<f64>| {
            let at = |start| parent.hypothesis.with(values, whole.clone().at(start), scale);
            whole.starts(scale).into_iter().map(|start| (at(start), parent.columns.clone())).collect()
        };
        [&parent.values, &stated].map(beside).into()
    }

    /// An effect at each of its starts in the place of a member, all else where the set's fit has it.
    fn instead(&self, set: &Set, member: &str, effect: &'static Descriptor) -> Option<Starts> {
        let from = self.fits.get(set)?;
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
        let at = |start| (base.with(&base.start, whole.clone().at(start), scale), columns.clone());
        Some(starts.into_iter().map(at).collect())
    }

    /// The best fit of a set that begins at one of these starts. Of the best from each place, and the best of the
    /// others, a few steps tell which leads furthest; it is fitted to its end where that is near the set whose place it is
    /// to take.
    pub(super) fn best_of_starts(&self, starts: Vec<Starts>, [set, rest, place]: [&Set; 3]) -> Option<Fit> {
        let floor = &self.floor_of(place);
        let merit = |fit: &Fit| fit.noise.misfit + fit.penalty;
        let steps = |(hypothesis, columns): &(Hypothesis, Columns), steps| {
            self.problem.fit(hypothesis, columns, floor, steps)
        };
        let at_start = |start: (Hypothesis, Columns)| {
            let merit = merit(&steps(&start, 0));
            (start, merit)
        };
        let (mut begun, mut others) = (Vec::new(), Vec::new());
        for starts in starts {
            let mut of_place: Vec<_> = starts.into_par_iter().map(at_start).collect();
            of_place.retain(|(_, merit)| merit.is_finite());
            of_place.sort_by(|a, b| a.1.total_cmp(&b.1));
            let mut of_place = of_place.into_iter();
            begun.extend(of_place.next());
            others.extend(of_place.next());
        }
        begun.extend(others.into_iter().min_by(|a, b| a.1.total_cmp(&b.1)));
        let first = begun
            .par_iter()
            .map(|(start, _)| steps(start, FIRST_STEPS))
            .min_by(|a, b| merit(a).total_cmp(&merit(b)))?;
        // What a delay is worth is seen where the command's steps are placed for it.
        let first = match delay_of(&first.hypothesis) {
            Some(_) => self.problem.settle(&first.resume(), &first.columns, floor, FIRST_STEPS),
            None => self.problem.finish(first),
        };
        let reach = self.cost(set) + self.doubt(self.fits.get(rest)?.cost() - first.cost());
        if first.cost() + self.prior(place) > reach {
            return Some(first);
        }
        Some(self.problem.settle(&first.resume(), &first.columns, floor, ITERATIONS))
    }
}
