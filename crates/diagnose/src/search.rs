//! Which sets of effects do the recordings speak for? Forward, swap and backward steps through sets of
//! effects, to convergence. Every set that was fitted is kept, with its cost: the posterior is over them.

use std::collections::{BTreeMap, BTreeSet};

use kort_identify::fit::Fit;
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_identify::simulate::Problem;
use kort_thruster::effects::Descriptor;
use rayon::prelude::*;

use crate::probe::{Probe, probe};
use crate::screen::{Screened, screen};

/// A set of effects by name, in order of the alphabet.
pub type Set = Vec<&'static str>;

/// Most effects in a set.
const MOST_EFFECTS: usize = 8;
/// Doubt of a screen's cost, as a share of what it promises.
const SCREEN_DOUBT: f64 = 0.3;
/// Iterations of an exact fit.
const ITERATIONS: usize = 12;

/// What the search may spend and asks for.
#[derive(Clone, Copy, Debug)]
pub struct Reach {
    /// Effects of a screen that are fitted exactly.
    pub exact: usize,
    /// Sets within this cost of the best count as its rivals; screened ones within it are fitted exactly.
    pub rivals: f64,
    /// Cost of one more effect.
    pub per_effect: f64,
}

/// The search's memory.
pub struct Search<'a, 'p> {
    /// What is compared.
    pub problem: &'a Problem<'p>,
    /// Effects that can act here.
    pub effects: Vec<&'static Descriptor>,
    /// Every set fitted.
    pub fits: BTreeMap<Set, Fit>,
    pub screens: BTreeMap<Set, Vec<Screened>>,
    dropped: BTreeSet<(Set, Set)>,
    probes: Vec<Vec<Probe>>,
    reach: Reach,
}

impl<'a, 'p> Search<'a, 'p> {
    /// Before anything is fitted.
    pub fn new(problem: &'a Problem<'p>, effects: Vec<&'static Descriptor>, reach: Reach) -> Self {
        Self { problem, effects, fits: BTreeMap::new(), screens: BTreeMap::new(), dropped: BTreeSet::new(), probes: Vec::new(), reach }
    }

    /// Cost of a set: of its fit, and of the prior odds of each effect.
    pub fn cost(&self, set: &Set) -> f64 {
        self.fits.get(set).map_or(f64::INFINITY, |fit| fit.cost() + self.reach.per_effect * set.len() as f64)
    }

    /// Searches from the baseline; the best set.
    pub fn run(&mut self, baseline: &Hypothesis, progress: &(dyn Fn(&str) + Sync)) -> Set {
        progress("fitting the baseline");
        let first = self.problem.settle(baseline, &Vec::new(), &[], 2 * ITERATIONS);
        let second = self.problem.settle(&first.resume(), &first.columns, &[], ITERATIONS);
        self.fits.insert(Vec::new(), second);
        let mut best: Set = Vec::new();
        let baseline = &self.fits[&best];
        if baseline.broke_down() {
            return best;
        }
        progress("trying every effect");
        self.probes = self.effects.par_iter().map(|e| probe(self.problem, baseline, e)).collect();
        loop {
            progress(&format!("on top of {}", words(&best)));
            let mut next = best.clone();
            if best.len() < MOST_EFFECTS {
                next = self.forward(&best);
            }
            next = self.swap(next, progress);
            next = self.backward(next);
            if self.cost(&next) >= self.cost(&best) - 1e-9 {
                return best;
            }
            best = next;
        }
    }

    /// The best set with one more effect, or the same.
    fn forward(&mut self, set: &Set) -> Set {
        let tried = self.expand(set, self.reach.exact);
        self.better(set.clone(), tried)
    }

    /// Exchanges members until no exchange helps.
    fn swap(&mut self, set: Set, progress: &(dyn Fn(&str) + Sync)) -> Set {
        let mut best = set;
        'again: loop {
            if best.len() < 2 {
                return best;
            }
            for member in best.clone() {
                let rest: Set = best.iter().copied().filter(|m| *m != member).collect();
                progress(&format!("instead of {member} beside {}", words(&rest)));
                self.ensure(&rest, &best);
                let tried = self.expand(&rest, self.reach.exact.min(3));
                let better = self.better(best.clone(), tried);
                if better != best {
                    best = better;
                    continue 'again;
                }
            }
            return best;
        }
    }

    /// Leaves members out as long as that helps.
    fn backward(&mut self, set: Set) -> Set {
        let mut best = set;
        loop {
            let mut smaller = Vec::new();
            for member in &best {
                let rest: Set = best.iter().copied().filter(|m| m != member).collect();
                self.ensure(&rest, &best);
                smaller.push(rest);
            }
            let better = self.better(best.clone(), smaller);
            if better == best {
                return best;
            }
            best = better;
        }
    }

    fn better(&self, set: Set, others: Vec<Set>) -> Set {
        others.into_iter().fold(set, |best, other| if self.cost(&other) < self.cost(&best) { other } else { best })
    }

    /// Fits a set from where a larger one that holds it ended: a member that only led the others to a better
    /// place must not be kept for it.
    fn ensure(&mut self, set: &Set, larger: &Set) {
        if !self.dropped.insert((set.clone(), larger.clone())) {
            return;
        }
        let Some(from) = self.fits.get(larger) else { return };
        let all = self.problem.members(&from.hypothesis, &from.values);
        let (members, actions): (Vec<Member>, Vec<Vec<f64>>) =
            all.into_iter().zip(from.actions.clone()).filter(|(m, _)| set.contains(&m.effect.id)).unzip();
        let (hypothesis, columns) = self.problem.recompose(from, &members);
        let fit = self.problem.settle(&hypothesis, &columns, &actions, ITERATIONS);
        self.keep(set.clone(), fit);
    }

    /// Screens all effects on top of a set and fits the first ones exactly; the sets fitted.
    fn expand(&mut self, set: &Set, exact: usize) -> Vec<Set> {
        let Some(parent) = self.fits.get(set) else { return Vec::new() };
        if !self.screens.contains_key(set) {
            let rest: Vec<&[Probe]> = self
                .effects
                .iter()
                .zip(&self.probes)
                .filter(|(e, _)| !set.contains(&e.id))
                .map(|(_, p)| p.as_slice())
                .collect();
            let screened = screen(self.problem, parent, &rest);
            self.screens.insert(set.clone(), screened);
        }
        let with = |effect: &Descriptor| {
            let mut larger = set.clone();
            larger.push(effect.id);
            larger.sort_unstable();
            larger
        };
        let screened = &self.screens[set];
        let best = screened.first().map_or(f64::INFINITY, |s| s.cost);
        // What a screen promises is off by its share of the gain where the response bends.
        let near = best + self.reach.rivals + SCREEN_DOUBT * (parent.cost() - best).max(0.0);
        let worth = parent.cost() - self.reach.per_effect + self.reach.rivals;
        let chosen: Vec<&Screened> =
            screened.iter().take(exact).filter(|s| s.cost < worth && s.cost < near).collect();
        let sets: Vec<Set> = chosen.iter().map(|s| with(s.effect)).collect();
        let new: Vec<(Set, Fit)> = chosen
            .par_iter()
            .filter(|s| !self.fits.contains_key(&with(s.effect)))
            .map(|s| {
                let mut actions = parent.actions.clone();
                actions.push(s.action.clone());
                (with(s.effect), self.problem.settle(&s.hypothesis, &parent.columns, &actions, ITERATIONS))
            })
            .collect();
        for (set, fit) in new {
            self.keep(set, fit);
        }
        sets
    }

    fn keep(&mut self, set: Set, fit: Fit) {
        let worse = self.fits.get(&set).is_some_and(|known| known.cost() <= fit.cost());
        if !worse && !fit.broke_down() {
            self.fits.insert(set, fit);
        }
    }
}

fn words(set: &Set) -> String {
    if set.is_empty() { "the baseline".into() } else { set.join(", ") }
}
