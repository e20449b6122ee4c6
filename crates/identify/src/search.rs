//! The search for what was left out: forward one effect at a time, then back.
//!
//! Each round screens everything, simulates and re-fits what scores well, learns the noise again
//! from the best (a wrong model's residual would hide the differences between rivals), and lets
//! the rivals compete under that noise.

use kort_thruster::effects::{self, Available, Descriptor, Scale};
use rayon::prelude::*;

use crate::baseline;
use crate::changes;
use crate::data::{Prepared, Series, possible_drivers};
use crate::errors;
use crate::fit::{Fit, Hypothesis, Problem, Stack, Target, difference};
use crate::heldout;
use crate::library::{self, is_term};
use crate::noise::Whitener;
use crate::refit::{TIMING, amends, in_turn, left, sort, unscreened};
use crate::rules;
use crate::screen::{Known, Screened, screen};

/// Candidates that are compared each under its own noise before one leads.
const OWN_NOISE: usize = 4;

/// An effect fitted on top of what was found before.
#[derive(Clone)]
pub struct Candidate {
    /// The effect.
    pub effect: &'static Descriptor,
    /// Fit with it.
    pub fit: Fit,
    /// Sum of squares, priors' penalty and cost of parameters.
    pub criterion: f64,
    /// First-order promise in the screen.
    pub screened: f64,
}

/// One round's result.
#[derive(Clone)]
pub struct Round {
    /// Fit without the new effect, under the same noise.
    pub before: Fit,
    /// Candidates, best first, under the same noise.
    pub candidates: Vec<Candidate>,
    /// The best's gain holds on left-out blocks.
    pub holds: bool,
    /// Root mean square of the best's response over full scale, largest channel.
    pub size: f64,
}

/// Criterion of a fit; infinite where the simulation broke down. A parameter that moves nothing that was
/// recorded (the zero of a transducer that is not there) costs nothing.
pub fn criterion(fit: &Fit) -> f64 {
    let moves = |k: usize| {
        fit.columns[k].as_ref().is_none_or(|stack| stack.iter().flatten().flatten().any(|v| *v != 0.0))
    };
    let of_effect = |k: &usize| matches!(fit.hypothesis.free[*k].target, Target::Effect(..));
    let of_effects = (0..fit.hypothesis.free.len()).filter(of_effect).filter(|k| moves(*k)).count();
    let all = fit.chi2 + fit.penalty + rules::PER_PARAMETER * of_effects as f64;
    if all.is_finite() { all } else { f64::INFINITY }
}

/// What is known of the noise: whiteners by recording and channel, and recordings with the command's
/// edges where a hypothesis wants them.
pub type Noise = (Vec<Prepared>, Vec<Vec<Whitener>>);

/// What a search works on.
pub struct Search<'a> {
    /// The problem; its noise and edges follow the best hypothesis so far.
    pub problem: Problem<'a>,
    /// Sizes in use.
    pub scale: Scale,
    /// Named effects that this recording can show.
    pub named: Vec<&'static Descriptor>,
    /// Named effects it cannot, and why.
    pub unfit: Vec<(&'static Descriptor, &'static str)>,
    /// Terms without a name.
    pub terms: Vec<&'static Descriptor>,
    /// The further column that promises most as a driver of what the baseline leaves.
    pub driver: Option<String>,
    known: Known,
}

impl<'a> Search<'a> {
    /// Sorts the catalogue by what this recording can show.
    pub fn new(problem: Problem<'a>, scale: Scale, available: &Available) -> Self {
        let mut named = Vec::new();
        let mut unfit = Vec::new();
        for effect in effects::ALL {
            match (effect.needs)(problem.rig, available) {
                Ok(()) => named.push(*effect),
                Err(why) => unfit.push((*effect, why)),
            }
        }
        let terms =
            library::TERMS.iter().copied().filter(|t| (t.needs)(problem.rig, available).is_ok()).collect();
        Self { problem, scale, named, unfit, terms, driver: None, known: Known::new() }
    }

    /// Fits the baseline: edges, noise and parameters in turn until they agree.
    pub fn baseline(&mut self, hypothesis: &Hypothesis) -> Fit {
        let (_, problem, fit) = baseline::starts(hypothesis)
            .into_par_iter()
            .map(|start| {
                let mut own = self.problem.clone();
                let first = own.fit(&start, &[], 8);
                let fit = in_turn(&mut own, first);
                (left(&own, &fit), own, fit)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .expect("a hypothesis has a start");
        self.problem = problem;
        fit
    }

    /// Tries further columns as drivers of what the baseline leaves; the most promising one is
    /// laid beside the inputs and its terms join the library.
    pub fn try_columns(&mut self, series: &[Series], current: &mut Fit, available: &Available) {
        let usable: Vec<&'static Descriptor> = library::COLUMN_TERMS
            .iter()
            .copied()
            .filter(|t| (t.needs)(self.problem.rig, available).is_ok())
            .collect();
        let mut best: Option<(f64, String)> = None;
        for name in possible_drivers(series) {
            self.lay_extra(series, &name);
            let gain = screen(&self.problem, current, &usable, &self.scale, &mut Known::new())
                .first()
                .map_or(0.0, |s| s.gain);
            if gain > rules::BELIEVE && best.as_ref().is_none_or(|b| gain > b.0) {
                best = Some((gain, name));
            }
        }
        if let Some((_, name)) = best {
            self.lay_extra(series, &name);
            self.terms.extend(usable);
            self.driver = Some(name);
        }
    }

    fn lay_extra(&mut self, series: &[Series], name: &str) {
        for (recording, one) in self.problem.recordings.iter_mut().zip(series) {
            if let Some(column) = one.column(name) {
                recording.lay_extra(column);
            }
        }
    }

    /// The noise as it is known now, and where the command's edges lie.
    pub fn noise(&self) -> Noise {
        (self.problem.recordings.clone(), self.problem.whiteners.clone())
    }

    /// Back to what was known of noise and edges.
    pub fn set_noise(&mut self, noise: Noise) {
        (self.problem.recordings, self.problem.whiteners) = noise;
    }

    /// Looks for one more effect on top of a fit that already gained `so_far`.
    pub fn round(&mut self, current: &mut Fit, so_far: f64) -> Option<Round> {
        let taken: Vec<&str> = current.hypothesis.effects.iter().map(|e| e.id).collect();
        // Loads that switch on at some time have many starts: they are tried at the end only.
        let terms: Vec<&'static Descriptor> =
            self.terms.iter().copied().filter(|t| taken.is_empty() && !t.id.ends_with("_switched")).collect();
        let everything: Vec<&'static Descriptor> =
            self.named.iter().chain(&terms).copied().filter(|e| !taken.contains(&e.id)).collect();
        let (amending, everything): (Vec<_>, Vec<_>) =
            everything.into_iter().partition(|e| amends(e, &self.scale));
        if current.hypothesis.effects.last().is_some_and(|e| amends(e, &self.scale)) {
            // Other equations: what was known of the responses holds no more.
            self.known.clear();
        }
        let screened = screen(&self.problem, current, &everything, &self.scale, &mut self.known);
        let least = (0.25 * rules::BELIEVE).max(0.02 * rules::SHARE_OF_FIRST * so_far);
        let mut chosen = choose(&screened, least);
        chosen.extend(amending.into_iter().flat_map(|e| unscreened(e, &self.scale)));
        let mut candidates = self.refit(current, &chosen);
        if let Some(best) =
            candidates.first().filter(|c| criterion(current) - c.criterion > 0.3 * rules::BELIEVE)
        {
            *current = self.without_the_last(current, best);
        }
        let base = criterion(current);
        if candidates.first().is_none_or(|c| base - c.criterion < 0.3 * rules::BELIEVE) {
            return None;
        }
        self.lead_by_own_noise(&mut candidates, base);
        self.structured_first(&mut candidates, base);
        // Under the noise of the best so far the rivals part more sharply; that may change the best.
        let mut before = current.clone();
        for _ in 0..2 {
            let best = candidates[0].clone();
            let leader = best.effect.id;
            self.problem.place_edges(&best.fit.hypothesis, &best.fit.values);
            self.problem.learn_noise(&best.fit.hypothesis, &best.fit.values);
            let base = criterion(&before);
            let worth = base - candidates[0].criterion;
            candidates.retain(|c| c.effect.id == leader || base - c.criterion > 0.4 * worth);
            candidates.truncate(6);
            before = self.without_the_last(&self.again(&before), &best);
            candidates = candidates
                .into_par_iter()
                .map(|c| {
                    let far = base - c.criterion < rules::NEAR_THE_LEADER * worth;
                    let fit = if far {
                        self.problem.fit(&c.fit.resume(), &c.fit.columns, 0)
                    } else if TIMING.contains(&c.effect.id) {
                        self.with_own_edges(&c.fit, &[1.0])
                    } else {
                        self.again(&c.fit)
                    };
                    Candidate { criterion: criterion(&fit), fit, ..c }
                })
                .collect();
            sort(&mut candidates);
            self.structured_first(&mut candidates, criterion(&before));
            if candidates[0].effect.id == leader {
                break;
            }
        }
        // A leader whose gain does not hold on left-out blocks (many parameters, little physics) or
        // that is too small to matter gives way to the next.
        let mut holds = false;
        while let Some(leader) = candidates.first_mut() {
            let gain = criterion(&before) - leader.criterion;
            let (without, with) = heldout::left_out(&self.problem, &mut before, &mut leader.fit, &self.scale);
            // What is stated is no data that could be left out: leaving it costs either fit what it costs.
            let left_out = heldout::paired(&without, &with).0 + before.penalty - leader.fit.penalty;
            let size = self.size(&before, &leader.fit);
            holds = if self.free_in_time(leader.effect) {
                size > rules::LEAST_SIZE_KNOTS
                    && (left_out > gain * rules::HOLDS_KNOTS
                        || self.removed_on_held_out(&before, &leader.fit) > rules::HOLDS_KNOTS)
            } else {
                // The first-order look fails thresholds and whatever moves far; the full form is for what is clear.
                size > rules::LEAST_SIZE && left_out > gain * rules::HOLDS
                    || size > rules::CLEAR_SIZE
                        && self.removed_on_held_out(&before, &leader.fit) > rules::HOLDS
            };
            if holds || candidates.len() == 1 {
                break;
            }
            candidates.remove(0);
        }
        let best = &candidates[0];
        Some(Round { holds, size: self.size(&before, &best.fit), before, candidates })
    }

    /// The smaller fit, once more from where a candidate has moved what they share, if that is better:
    /// what a fit stuck on its way would gain there is no merit of the candidate.
    fn without_the_last(&self, smaller: &Fit, candidate: &Candidate) -> Fit {
        if amends(candidate.effect, &self.scale) {
            return smaller.clone();
        }
        let start = candidate.fit.values[..smaller.values.len()].to_vec();
        let from_there = Hypothesis { start, ..smaller.hypothesis.clone() };
        let fit = self.problem.fit(&from_there, &smaller.columns, 6);
        if criterion(&fit) < criterion(smaller) { fit } else { smaller.clone() }
    }

    /// What changes freely with time bends to any physics a little: a name with a form of its own that
    /// explains nearly half as much goes first, and what it leaves is looked at again.
    fn structured_first(&self, candidates: &mut Vec<Candidate>, base: f64) {
        let worth = base - candidates[0].criterion;
        let formed = |c: &Candidate| !is_term(c.effect) && !self.free_in_time(c.effect);
        let best =
            candidates.iter().position(|c| formed(c) && base - c.criterion > rules::FORMED_SHARE * worth);
        if let Some(best) = best.filter(|_| self.free_in_time(candidates[0].effect)) {
            let leader = candidates.remove(best);
            candidates.insert(0, leader);
        }
    }

    /// Share of the squared error above the noise that a fit removes on rows it was not fitted to: the
    /// full form of the first-order look at left-out blocks, which knots may bend too far for.
    fn removed_on_held_out(&self, before: &Fit, after: &Fit) -> f64 {
        let longest_s = heldout::longest_block_s(after.hypothesis.effects.iter(), &self.scale);
        let held = heldout::held_out_rows(&self.problem, &[after], longest_s);
        let (before, after) = heldout::trained(&self.problem, &held, before, after);
        let (floor, full) = (errors::noise_floor(&self.problem, &after), errors::full_scales(&self.problem));
        let above = |residual: &Stack| -> f64 {
            errors::sums(&self.problem, residual, |r, row| !self.problem.masked[r][row] && held[r][row])
                .into_iter()
                .map(|(name, (sum, n))| (sum / n.max(1) as f64 - floor[name]).max(0.0) / full[name].powi(2))
                .sum()
        };
        1.0 - above(&after) / above(&before).max(1e-12)
    }

    /// Puts that of the best candidates first which leaves least when each learns its own noise: under
    /// the noise of a model that misses something, a poor name may look as good as the right one.
    fn lead_by_own_noise(&self, candidates: &mut Vec<Candidate>, base: f64) {
        let worth = base - candidates[0].criterion;
        let near = candidates.iter().take(OWN_NOISE).take_while(|c| base - c.criterion > 0.5 * worth).count();
        let own: Vec<(f64, Fit)> = candidates[..near].par_iter().map(|c| self.under_own_noise(c)).collect();
        let best = (0..near).min_by(|a, b| own[*a].0.total_cmp(&own[*b].0)).unwrap_or(0);
        for (candidate, (_, fit)) in candidates.iter_mut().zip(own) {
            candidate.fit = fit;
        }
        let leader = candidates.remove(best);
        candidates.insert(0, leader);
    }

    /// Whether an effect changes freely with time, in knots.
    pub fn free_in_time(&self, effect: &Descriptor) -> bool {
        (effect.parameters)(&self.scale).iter().any(|p| p.acts.is_some())
    }

    /// The best term without a name on top of a fit, if any promises half of what is needed at `least`.
    pub fn best_term(&mut self, current: &mut Fit, least: f64) -> Option<Candidate> {
        let terms = self.terms_on(current, least);
        likelier(terms, criterion(current))
    }

    /// The same, with the terms compared under the noise that the best of them leaves.
    pub fn best_term_under_its_noise(&mut self, current: &mut Fit, least: f64) -> Option<Candidate> {
        let mut terms = self.terms_on(current, least);
        terms.first()?;
        self.lead_by_own_noise(&mut terms, criterion(current));
        let best = &terms[0];
        self.problem.learn_noise(&best.fit.hypothesis, &best.fit.values);
        *current = self.again(current);
        terms = terms
            .into_par_iter()
            .map(|t| {
                let fit = self.again(&t.fit);
                Candidate { criterion: criterion(&fit), fit, ..t }
            })
            .collect();
        sort(&mut terms);
        likelier(terms, criterion(current))
    }

    /// Terms without a name on top of a fit that promise half of what is needed at `least`, best first.
    fn terms_on(&mut self, current: &mut Fit, least: f64) -> Vec<Candidate> {
        // Changes in mid-run that were found hold more than one switch could add.
        let changed = current.hypothesis.effects.iter().any(|e| changes::is_change(e));
        let terms: Vec<&'static Descriptor> =
            self.terms.iter().copied().filter(|t| !(changed && t.id.ends_with("_switched"))).collect();
        let screened = screen(&self.problem, current, &terms, &self.scale, &mut self.known);
        let mut chosen: Vec<Screened> = Vec::new();
        for s in screened {
            let fresh = chosen.iter().all(|c| c.effect.id != s.effect.id);
            if fresh && s.gain > 0.5 * least && s.size > rules::LEAST_SIZE && chosen.len() < 4 {
                chosen.push(s);
            }
        }
        self.refit(current, &chosen)
    }

    /// Largest root mean square difference of two fits' responses over full scale.
    pub fn size(&self, a: &Fit, b: &Fit) -> f64 {
        let y = self.problem.respond(&b.hypothesis, &b.values);
        let x = difference(self.problem.respond(&a.hypothesis, &a.values), &y);
        self.problem.size(&x)
    }
}

/// The first of the terms, but at one speed a load that comes on and a drive that loses gain look alike:
/// the load is the likelier of the two.
fn likelier(mut terms: Vec<Candidate>, base: f64) -> Option<Candidate> {
    let best = terms.first()?;
    let doubt = rules::TERM_LEAST.max(rules::TERM_SHARE * (base - best.criterion));
    let load = (best.effect.id == "term_drive_switched")
        .then(|| terms.iter().position(|c| c.effect.id == "term_shaft_switched"))
        .flatten()
        .filter(|k| terms[*k].criterion - terms[0].criterion < doubt);
    Some(terms.swap_remove(load.unwrap_or(0)))
}

/// Which screened starts are worth a re-fit: the best by promise, a second start where it
/// promises nearly as much, and whatever the leaders are known to be confused with.
fn choose(screened: &[Screened], least: f64) -> Vec<Screened> {
    let mut chosen: Vec<Screened> = Vec::new();
    let Some(top) = screened.first().map(|s| s.gain) else { return chosen };
    let mates: Vec<&str> = screened.iter().take(2).flat_map(|s| s.effect.confused_with).copied().collect();
    let (mut named, mut terms) = (0, 0);
    for s in screened {
        if s.gain < least {
            break;
        }
        // Something free in time bends to anything a little, and is costly to fit.
        let costly = s.directions > 12 && s.gain < 0.2 * top;
        if s.size < rules::LEAST_SIZE || costly {
            continue;
        }
        let starts: Vec<&Screened> = chosen.iter().filter(|c| c.effect.id == s.effect.id).collect();
        if let Some(first) = starts.first() {
            if starts.len() < 2 && s.gain > 0.7 * first.gain && s.gain > 0.5 * top && !is_term(s.effect) {
                chosen.push(s.clone());
            }
            continue;
        }
        if is_term(s.effect) {
            if terms < 3 && s.gain > 0.5 * top {
                terms += 1;
                chosen.push(s.clone());
            }
        } else if named < rules::REFITTED && s.gain > 0.02 * top
            || mates.contains(&s.effect.id) && s.gain > 0.01 * top
        {
            named += 1;
            chosen.push(s.clone());
        }
    }
    // Limits and thresholds do not scale with their strength: judge them where they were simulated.
    let mut seen: Vec<&str> = Vec::new();
    let mut plain: Vec<&Screened> =
        screened.iter().filter(|s| s.plain > 0.3 * top && !is_term(s.effect)).collect();
    plain.sort_by(|a, b| b.plain.total_cmp(&a.plain).then(a.effect.id.cmp(b.effect.id)));
    for s in plain {
        if !seen.contains(&s.effect.id) && seen.len() < 4 {
            seen.push(s.effect.id);
            if !chosen.iter().any(|c| c.effect.id == s.effect.id && c.origin == s.origin) {
                chosen.push(Screened { start: s.origin.clone(), ..s.clone() });
            }
        }
    }
    // What the leader is known to be confused with competes, whatever the screen says of it.
    let leader = screened[0].effect;
    for id in leader.confused_with {
        if chosen.iter().any(|c| c.effect.id == *id) {
            continue;
        }
        let starts = screened.iter().filter(|s| s.effect.id == *id);
        if let Some(s) = starts.max_by(|a, b| a.plain.max(a.gain).total_cmp(&b.plain.max(b.gain))) {
            let start = if s.plain > s.gain { s.origin.clone() } else { s.start.clone() };
            chosen.push(Screened { start, ..s.clone() });
        }
    }
    chosen
}
