//! Which sets of effects do the recordings speak for? Forward, swap and backward steps through sets of
//! effects, to convergence. Every set that was fitted is kept, with its cost: the posterior is over them.

mod afar;
mod elsewhere;
mod every_start;
mod expand;
mod forms;
mod plainer;
mod price;
mod relatives;
mod second_look;
mod stand_in;
#[cfg(test)]
mod tests;
mod two_at_once;

pub use plainer::Disguised;

use std::collections::{BTreeMap, BTreeSet};

use kort_identify::fit::{Columns, Fit};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_identify::noise::Floor;
use kort_identify::simulate::Problem;
use kort_thruster::effects::Descriptor;
use rayon::prelude::*;

use crate::constants::{Constants, PosteriorConstants, SearchConstants};
use crate::flexible::TERMS;
use crate::probe::{Probe, probe, ways};
use crate::screen::Screened;

/// A set of effects by name, in order of the alphabet.
pub type Set = Vec<&'static str>;

/// Most effects in a set.
const MOST_EFFECTS: usize = 8;
/// Iterations of an exact fit.
const ITERATIONS: usize = 12;
/// A set that has come to cost so much less is a new place to start smaller ones from.
const BETTER: f64 = 1.0;
/// Steps of a fit by which forms or starts are compared.
const FIRST_STEPS: usize = 4;

/// The search's memory.
pub struct Search<'a, 'p> {
    /// What is compared.
    pub problem: &'a Problem<'p>,
    /// Effects that can act here.
    pub effects: Vec<&'static Descriptor>,
    /// Every set fitted.
    pub fits: BTreeMap<Set, Fit>,
    screens: BTreeMap<Set, Vec<Screened>>,
    /// Sets that were fitted from what a screen promised, with the promise.
    begun_from: BTreeSet<(Set, u64)>,
    /// What a larger set cost when a smaller one was last fitted from where it ended.
    dropped: BTreeMap<(Set, Set), f64>,
    reshaped: BTreeSet<(Set, u64)>,
    /// Effects that are not to be added for now.
    barred: Set,
    /// Sets from whose fit another was begun, with what the fit cost then.
    exchanged: BTreeSet<(Set, Set, u64)>,
    /// What each effect does to the model, and to other equations in its place: by members without a size.
    probes: BTreeMap<Set, Vec<Vec<Probe>>>,
    /// In how many ways each effect may act here.
    ways: Vec<usize>,
    /// Least noise that a set is held to: of all sets under no name, lower ones under effects without a size.
    floors: BTreeMap<&'static str, Floor>,
    /// Names that do no more than a plainer one, by the set with that in their place.
    disguised: BTreeMap<Set, Disguised>,
    constants: SearchConstants,
    odds: PosteriorConstants,
}

impl<'a, 'p> Search<'a, 'p> {
    /// Before anything is fitted.
    pub fn new(problem: &'a Problem<'p>, effects: Vec<&'static Descriptor>, constants: &Constants) -> Self {
        Self {
            problem,
            effects,
            fits: BTreeMap::new(),
            screens: BTreeMap::new(),
            begun_from: BTreeSet::new(),
            dropped: BTreeMap::new(),
            reshaped: BTreeSet::new(),
            barred: Set::new(),
            exchanged: BTreeSet::new(),
            probes: BTreeMap::new(),
            ways: Vec::new(),
            floors: BTreeMap::new(),
            disguised: BTreeMap::new(),
            constants: constants.search,
            odds: constants.posterior,
        }
    }

    /// An effect or term of any set.
    pub fn descriptor(&self, id: &str) -> Option<&'static Descriptor> {
        self.effects.iter().chain(TERMS).copied().find(|e| e.id == id)
    }

    /// Fits a set from a hypothesis and keeps it if it does better than what is known of it.
    pub fn fit_set(&mut self, set: Set, from: &Hypothesis, columns: &Columns) {
        let fit = self.problem.settle(from, columns, &self.floor_of(&set), ITERATIONS);
        self.keep(set, fit);
    }

    /// Exchanges and leaves out members of a set as long as that helps; the best set.
    pub fn refine(&mut self, set: &Set) -> Set {
        self.backward(set.clone())
    }

    /// Searches from the baseline; the best set.
    pub fn run(&mut self, baseline: &Hypothesis, progress: &(dyn Fn(&str) + Sync)) -> Set {
        progress("fitting the baseline");
        let first = self.problem.settle_from_stated(baseline, 2 * ITERATIONS);
        let second = self.problem.settle(&first.resume(), &first.columns, &first.floor, ITERATIONS);
        self.fits.insert(Vec::new(), second);
        let best: Set = Vec::new();
        let baseline = &self.fits[&best];
        if baseline.broke_down() {
            return best;
        }
        progress("trying every effect");
        let probes = self.probe_all(&best);
        let ways = |(e, probes): (&&Descriptor, &Vec<Probe>)| ways(e, &self.problem.scale, probes);
        self.ways = self.effects.iter().zip(&probes).map(ways).collect();
        self.probes.insert(best.clone(), probes);
        self.hold(&best, "");
        self.fit_what_has_no_size();
        self.expand(&best, self.cost(&best));
        self.look_from_afar();
        let best = self.climb(best, progress);
        let best = self.elsewhere(best, progress);
        self.second_look(best, progress)
    }

    /// Members of a set that are other equations in the place of the model's.
    fn equations(&self, set: &Set) -> Set {
        set.iter().copied().filter(|id| self.floors.contains_key(id)).collect()
    }

    /// What each effect does to a set that is fitted; nothing for its members.
    fn probe_all(&self, set: &Set) -> Vec<Vec<Probe>> {
        let fit = &self.fits[set];
        let of = |e: &&'static Descriptor| {
            if set.contains(&e.id) { Vec::new() } else { probe(self.problem, fit, e) }
        };
        self.effects.par_iter().map(of).collect()
    }

    /// What has no size is there or not: other equations in the place of the model's, as exact as they are. What else
    /// there is explains what they leave.
    fn fit_what_has_no_size(&mut self) {
        let baseline = self.fits[&Set::new()].clone();
        for effect in self.effects.clone() {
            let member = Member::new(effect, &self.problem.scale);
            if member.has_size(&self.problem.scale) {
                continue;
            }
            let set = vec![effect.id];
            // Numbers that were bent to other equations may have no way back: from what is stated too.
            let stated: Vec<f64> = baseline.hypothesis.free.iter().map(|free| free.mean).collect();
            for values in [&baseline.values, &stated] {
                let hypothesis = baseline.hypothesis.with(values, member.clone(), &self.problem.scale);
                self.fit_set(set.clone(), &hypothesis, &baseline.columns);
            }
            self.hold(&set, effect.id);
        }
    }

    /// Holds a set, and whatever explains its mismatch, to the form error of what would explain it.
    fn hold(&mut self, set: &Set, under: &'static str) {
        let Some(mut fit) = self.fits.remove(set) else { return };
        let spectrum = &self.problem.spectrum;
        let mismatch = spectrum.powers(&fit.lines);
        let floor = self.problem.floor.explaining(&spectrum.bands, &mismatch, &self.problem.criterion);
        fit.floor = floor.clone();
        // What white noise covered has its weight now.
        let again = self.problem.settle(&fit.resume(), &fit.columns, &floor, ITERATIONS);
        let fit = self.problem.finish(fit);
        self.fits.insert(set.clone(), if again.cost() < fit.cost() { again } else { fit });
        self.floors.insert(under, floor);
    }

    /// Least noise that a set is held to: the same for all that could explain the same mismatch, so that none gains by
    /// how much of the signal it claims to make.
    fn floor_of(&self, set: &Set) -> Floor {
        let own = set.iter().filter_map(|id| self.floors.get(id));
        own.fold(self.floors.get("").unwrap_or(&self.problem.floor).clone(), |floor, own| floor.or_lower(own))
    }

    /// Forward, swap and backward steps from a set that is fitted, until none helps; the best set.
    pub fn climb(&mut self, from: Set, progress: &(dyn Fn(&str) + Sync)) -> Set {
        let mut best = from;
        loop {
            progress(&format!("on top of {}", words(&best)));
            // The temper grows while more is explained: priors are compared as they stand in the end.
            let fitted = self.cost_of(&self.fits[&best]);
            let helps = |search: &Self, next: &Set| search.cost(next) < fitted + search.prior(&best) - 1e-9;
            let mut next = best.clone();
            if best.len() < MOST_EFFECTS {
                next = self.forward(&best);
            }
            if next != best {
                next = self.settled(next, progress);
            }
            if !helps(self, &next) {
                // What stands near the end gets the same chance.
                progress(&format!("other forms of what is near {}", words(&best)));
                let near = self.near(&best);
                near.iter().for_each(|set| self.reshape(set));
                next = self.better(best.clone(), near);
                for step in [Self::stand_in, Self::relatives, Self::every_start, Self::two_at_once] {
                    if helps(self, &next) {
                        break;
                    }
                    next = step(self, &best);
                    if next.len() > best.len() {
                        next = self.settled(next, progress);
                    }
                }
                if !helps(self, &next) {
                    return best;
                }
            }
            best = next;
        }
    }

    /// A set after exchanges and what can be left out, in its best form.
    fn settled(&mut self, set: Set, progress: &(dyn Fn(&str) + Sync)) -> Set {
        let set = self.swap(set, progress);
        let set = self.backward(set);
        self.reshape(&set);
        set
    }

    /// The best set with one more effect, or the same.
    fn forward(&mut self, set: &Set) -> Set {
        let tried = self.expand(set, self.cost(set));
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
                let rest = without(&best, member);
                progress(&format!("instead of {member} beside {}", words(&rest)));
                self.ensure(&rest, &best);
                let tried = self.expand(&rest, self.cost(&best));
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
                let rest = without(&best, member);
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

    /// Sets of a set's size that are likely enough to be stated beside it.
    fn near(&self, set: &Set) -> Vec<Set> {
        let bar = self.cost(set) + self.constants.rivals;
        let near = |other: &&Set| other.len() == set.len() && self.cost(other) < bar;
        self.fits.keys().filter(near).cloned().collect()
    }

    fn better(&self, set: Set, others: Vec<Set>) -> Set {
        others
            .into_iter()
            .fold(set, |best, other| if self.cost(&other) < self.cost(&best) { other } else { best })
    }

    /// Fits a set from where a larger one that holds it ended: a member that only led the others to a better
    /// place must not be kept for it.
    fn ensure(&mut self, set: &Set, larger: &Set) {
        let Some(from) = self.fits.get(larger) else { return };
        let known = self.dropped.entry((set.clone(), larger.clone())).or_insert(f64::INFINITY);
        if from.cost() > *known - BETTER {
            return;
        }
        *known = from.cost();
        let all = self.problem.members(&from.hypothesis, &from.values);
        let members: Vec<Member> = all.into_iter().filter(|m| set.contains(&m.effect.id)).collect();
        let (hypothesis, columns) = self.problem.recompose(from, &members);
        self.fit_set(set.clone(), &hypothesis, &columns);
    }

    /// The fit of a set without one member: the one that was searched, or the set's own with the member taken out and the
    /// rest fitted again.
    pub fn fit_without(&self, set: &Set, member: &str, steps: usize) -> Fit {
        if let Some(fit) = self.fits.get(&without(set, member)) {
            return fit.clone();
        }
        let from = &self.fits[set];
        let all = self.problem.members(&from.hypothesis, &from.values);
        let members: Vec<Member> = all.into_iter().filter(|m| m.effect.id != member).collect();
        let (hypothesis, columns) = self.problem.recompose(from, &members);
        let fit = self.problem.fit(&hypothesis, &columns, &from.floor, steps);
        // Where the rest runs away without it, nothing but the baseline stands without it.
        if fit.ran_away() { self.fits[&Set::new()].clone() } else { fit }
    }

    fn keep(&mut self, set: Set, fit: Fit) {
        let (known, cost) = (self.fits.get(&set).map(|known| self.cost_of(known)), self.cost_of(&fit));
        if fit.broke_down() || known.is_some_and(|known| known <= cost) {
            return;
        }
        if self.is_plainer(&set, &fit) {
            return;
        }
        // What was seen from a worse place, with the command's steps elsewhere, is looked at again.
        if known.is_some_and(|known| known > cost + self.constants.rivals) {
            self.screens.remove(&set);
        }
        self.fits.insert(set, fit);
    }
}

/// A set with one more effect.
pub fn with(set: &Set, id: &'static str) -> Set {
    let mut larger = set.clone();
    larger.push(id);
    larger.sort_unstable();
    larger
}

/// A set without one of its members.
fn without(set: &Set, member: &str) -> Set {
    set.iter().copied().filter(|id| *id != member).collect()
}

fn words(set: &Set) -> String {
    if set.is_empty() { "the baseline".into() } else { set.join(", ") }
}
