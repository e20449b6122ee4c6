//! Two effects that pay together and neither alone.
//!
//! Each of them takes away a part of the mismatch that is not worth its price while the other's part stands; a search
//! that adds one at a time stops before both. What two do together follows from what was screened of each, without
//! simulating: their actions add, as far as the response is linear.

use kort_identify::fit::{Columns, known_of};
use kort_identify::hypothesis::Hypothesis;
use nalgebra::DVector;
use rayon::prelude::*;

use super::{ITERATIONS, MOST_EFFECTS, Search, Set, with};
use crate::screen::Screened;

/// Pairs that are fitted on top of one set.
const MOST_FITTED: usize = 4;

/// Two effects on top of a set, as their screens promise.
struct Pair {
    set: Set,
    hypothesis: Hypothesis,
    columns: Columns,
    /// Cost without the prior odds of its effects.
    cost: f64,
}

impl Search<'_, '_> {
    /// Fits on top of a set the pairs that promise to pay; the best set.
    pub(super) fn two_at_once(&mut self, set: &Set) -> Set {
        if set.len() + 1 >= MOST_EFFECTS {
            return set.clone();
        }
        let bar = self.cost(set);
        let mut promised: Vec<Pair> = self.promised_pairs(set);
        promised.retain(|pair| !self.fits.contains_key(&pair.set));
        let gains = |pair: &Pair| bar - pair.cost - self.prior(&pair.set);
        promised.retain(|pair| gains(pair) + self.doubt(gains(pair)) > 0.0);
        promised.sort_by(|a, b| gains(b).total_cmp(&gains(a)));
        promised.truncate(MOST_FITTED);
        let fitted: Vec<_> = promised
            .par_iter()
            .map(|pair| {
                let floor = self.floor_of(&pair.set);
                let fit = self.problem.settle(&pair.hypothesis, &pair.columns, &floor, ITERATIONS);
                (pair.set.clone(), fit)
            })
            .collect();
        let tried: Vec<Set> = fitted.iter().map(|(set, _)| set.clone()).collect();
        fitted.into_iter().for_each(|(set, fit)| self.keep(set, fit));
        self.better(set.clone(), tried)
    }

    fn promised_pairs(&self, set: &Set) -> Vec<Pair> {
        let Some(screened) = self.screens.get(set) else { return Vec::new() };
        let Some(parent) = screened.first().map(|s| &s.upon) else { return Vec::new() };
        let known = self.problem.about(&parent.lines, &parent.columns, &parent.hypothesis);
        // Of several starts of one effect the cheapest, which comes first.
        let mut firsts: Vec<&Screened> = Vec::new();
        for one in screened {
            if !firsts.iter().any(|f| f.effect.id == one.effect.id) {
                firsts.push(one);
            }
        }
        let n = parent.values.len();
        let pairs: Vec<(&Screened, &Screened)> = (0..firsts.len())
            .flat_map(|k| (0..k).map(move |j| (j, k)))
            .map(|(j, k)| (firsts[j], firsts[k]))
            .collect();
        let promise = |(a, b): (&Screened, &Screened)| {
            let member = b.hypothesis.effects.last()?.clone();
            let hypothesis = a.hypothesis.with(&a.hypothesis.start, member, &self.problem.scale);
            let columns: Columns = a.columns.iter().chain(&b.columns[n..]).cloned().collect();
            let lines: DVector<f64> = &a.lines + &b.lines - &parent.lines;
            let free = &hypothesis.free;
            let model = known.about(&lines, &known_of(&columns), free);
            let minimum = model.minimise(&parent.floor, free, &hypothesis.start, 0.0);
            let cost = model.cost(&minimum);
            let set = with(&with(set, a.effect.id), b.effect.id);
            cost.is_finite().then_some(Pair { set, hypothesis, columns, cost })
        };
        pairs.into_par_iter().filter_map(promise).collect()
    }
}
