//! Which effects on top of a set are worth an exact fit.

use kort_identify::fit::Fit;
use rayon::prelude::*;

use super::{ITERATIONS, Search, Set, with};
use crate::probe::{Probe, probe};
use crate::screen::{Screened, screen};

/// Doubt of a screen's cost, as a share of what it promises.
const SCREEN_DOUBT: f64 = 0.15;
/// What a closer look may gain beyond a probe's promise.
const HOPE: f64 = 10.0;
/// What another start must promise more than a fit has shown.
const ENOUGH: f64 = 1.0;

impl Search<'_, '_> {
    /// Screens all effects on top of a set and fits exactly those that may come near a cost; the sets fitted.
    pub(super) fn expand(&mut self, set: &Set, bar: f64) -> Vec<Set> {
        if !self.fits.contains_key(set) {
            return Vec::new();
        }
        let equations = self.equations(set);
        if !self.probes.contains_key(&equations) {
            let of = if self.fits.contains_key(&equations) { &equations } else { set };
            self.probes.insert(equations.clone(), self.probe_all(of));
        }
        let (problem, effects, parent) = (self.problem, &self.effects, &self.fits[set]);
        let Some(probes) = self.probes.get_mut(&equations) else { return Vec::new() };
        if !self.screens.contains_key(set) && !set.is_empty() {
            // What did nothing to the equations alone may act on a larger set.
            probes.par_iter_mut().zip(effects).for_each(|(probes, effect)| {
                if probes.iter().all(Probe::inert) && !set.contains(&effect.id) {
                    *probes = probe(problem, parent, effect);
                }
            });
        }
        if !self.screens.contains_key(set) {
            let rest: Vec<&[Probe]> = effects
                .iter()
                .zip(probes.iter())
                .filter(|(e, _)| !set.contains(&e.id))
                .map(|(_, p)| p.as_slice())
                .collect();
            let screened = screen(problem, parent, &rest, |promise| promise.cost < parent.cost() + HOPE);
            self.screens.insert(set.clone(), screened);
        }
        let mut effects = Vec::new();
        let mut untried = self.screens[set].clone();
        untried.retain(|s| !self.barred.contains(&s.effect.id));
        untried.retain(|s| {
            if !effects.contains(&s.effect.id) {
                effects.push(s.effect.id);
            }
            effects.iter().take(self.constants.exact).any(|id| *id == s.effect.id)
        });
        self.fit_those_that_may(set, untried, bar)
    }

    /// Fits what a screen promises comes near a cost. A promise counts until its fit has shown what it is worth: one
    /// that is not kept bars no other, and what promised less from another start is tried.
    pub(super) fn fit_those_that_may(&mut self, set: &Set, mut untried: Vec<Screened>, bar: f64) -> Vec<Set> {
        let parent = self.fits[set].clone();
        let larger = |screened: &Screened| with(set, screened.effect.id);
        let mut sets: Vec<Set> = Vec::new();
        loop {
            let fitted = sets.iter().filter_map(|s| self.fits.get(s)).map(Fit::cost);
            let best = fitted.chain(untried.iter().map(|s| s.cost)).fold(f64::INFINITY, f64::min);
            let doubt = self.doubt(parent.cost() - best);
            let bar = bar + doubt - self.prior(set);
            let may = |s: &Screened| s.cost < best + doubt && s.cost + self.price_of(s.effect.id) < bar;
            let (mut chosen, mut rest): (Vec<Screened>, Vec<Screened>) = (Vec::new(), Vec::new());
            for one in untried {
                let now = may(&one) && !chosen.iter().any(|c| c.effect.id == one.effect.id);
                if now { chosen.push(one) } else { rest.push(one) }
            }
            if chosen.is_empty() {
                return sets;
            }
            let more =
                |s: &&Screened| self.fits.get(&larger(s)).is_none_or(|fit| s.cost < fit.cost() - ENOUGH);
            let key = |s: &Screened| (larger(s), s.cost.to_bits());
            let begin: Vec<&Screened> =
                chosen.iter().filter(more).filter(|s| !self.begun_from.contains(&key(s))).collect();
            let new: Vec<(Set, Fit)> = begin
                .par_iter()
                .map(|s| {
                    let floor = self.floor_of(&larger(s));
                    (larger(s), self.problem.settle(&s.hypothesis, &s.columns, &floor, ITERATIONS))
                })
                .collect();
            let begun: Vec<_> = begin.into_iter().map(key).collect();
            self.begun_from.extend(begun);
            new.into_iter().for_each(|(set, fit)| self.keep(set, fit));
            for set in chosen.iter().map(larger) {
                if !sets.contains(&set) {
                    sets.push(set);
                }
            }
            untried = rest;
        }
    }

    /// How far a cost may be off that gains so much: what a screen promises is off by a share of it where the
    /// response bends.
    pub(crate) fn doubt(&self, gain: f64) -> f64 {
        self.constants.rivals + SCREEN_DOUBT * gain.max(0.0)
    }
}
