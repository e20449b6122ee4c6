//! Effects fitted on top of what is known: from several starts, with the command's edges and the
//! noise where each of them wants them.

use kort_thruster::effects::{Descriptor, Scale};
use rayon::prelude::*;

use crate::baseline::with_effect;
use crate::fit::{Fit, Hypothesis, Problem, Target};
use crate::noise::Whitener;
use crate::rules;
use crate::screen::Screened;
use crate::search::{Candidate, Search, criterion};

/// Effects that shift signals in time, and so depend on where the edges of the command lie.
pub(crate) const TIMING: [&str; 5] =
    ["transport_delay", "amplifier_lag", "clock_skew", "encoder_filter_lag", "thrust_sensor_lag"];

impl Search<'_> {
    /// Re-fits chosen effects on top of a fit, best first.
    pub(crate) fn refit(&self, current: &Fit, chosen: &[Screened]) -> Vec<Candidate> {
        let base = criterion(current);
        let first: Vec<Fit> = chosen
            .par_iter()
            .map(|s| {
                // Under other equations what was fitted is no place to start from: what is stated is.
                let from: Vec<f64> = if amends(s.effect, &self.scale) {
                    let stated = |k: usize| current.hypothesis.free[k].prior.map(|p| p.0);
                    (0..current.values.len()).map(|k| stated(k).unwrap_or(current.values[k])).collect()
                } else {
                    current.values.clone()
                };
                let at = |start: &[f64]| {
                    with_effect(&current.hypothesis, &from, s.effect, &self.scale, Some(start))
                };
                // Derivatives carry over, unless the equations are others.
                let known = if amends(s.effect, &self.scale) { &[][..] } else { &current.columns };
                let fit_from =
                    |h: &Hypothesis| self.problem.fit(h, known, if known.is_empty() { 8 } else { 3 });
                // Limits and thresholds do not scale: start where the screen stood, if that is better.
                let near = [at(&s.start), at(&s.origin)]
                    .into_iter()
                    .map(|h| (cost(&self.problem, &h), h))
                    .min_by(|a, b| a.0.total_cmp(&b.0));
                // A promise far out may break the simulation, or lead nowhere: then a part of the way. Not
                // first: a limit weakened to where it does not bind has nowhere to go.
                let part = at(&weaken(s.effect, &self.scale, &s.start));
                let fit = near.filter(|n| n.0.is_finite()).map(|n| fit_from(&n.1));
                match fit {
                    Some(fit) if criterion(&fit) < base => fit,
                    _ => fit_from(&part),
                }
            })
            .collect();
        // Whoever trails far after the first steps is left there.
        let best = first.iter().map(|fit| base - criterion(fit)).fold(0.0, f64::max);
        let mut all: Vec<Candidate> = chosen
            .par_iter()
            .zip(first)
            .map(|(s, mut fit)| {
                if TIMING.contains(&s.effect.id) {
                    fit = self.with_own_edges(&fit, &[1.0, 2.0, 3.0]);
                } else if base - criterion(&fit) > rules::SLOW_START * best {
                    fit = self.problem.again(&fit, 4);
                }
                Candidate { effect: s.effect, criterion: criterion(&fit), fit, screened: s.gain }
            })
            .collect();
        sort(&mut all);
        // An effect may have been started from several places: keep its best.
        let mut seen: Vec<&str> = Vec::new();
        all.retain(|c| {
            let fresh = !seen.contains(&c.effect.id);
            seen.push(c.effect.id);
            fresh
        });
        all
    }

    /// The same hypothesis fitted again from where it was, under the present noise and edges.
    pub fn again(&self, fit: &Fit) -> Fit {
        self.problem.again(fit, 6)
    }

    /// Like [`Search::again`], with the command's edges where this hypothesis wants them: a lag or
    /// a delay judged on edges that were placed without it would never win.
    pub(crate) fn with_own_edges(&self, fit: &Fit, sizes: &[f64]) -> Fit {
        if self.problem.recordings.iter().all(|r| r.edges.is_empty()) {
            return self.again(fit);
        }
        // Edges that were placed too late hold a delay small, and the other way round: from several sizes.
        let slot = fit.hypothesis.effects.len() - 1;
        let own_value = |k: usize| match fit.hypothesis.free[k].target {
            Target::Effect(s, j) if s == slot => Some(j),
            _ => None,
        };
        let from = |value: &dyn Fn(usize, usize) -> f64| {
            let mut hypothesis = fit.hypothesis.clone();
            for (k, free) in fit.hypothesis.free.iter().enumerate() {
                let wanted = own_value(k).map_or(fit.values[k], |j| value(k, j));
                hypothesis.start[k] = wanted.clamp(free.low, free.high);
            }
            hypothesis
        };
        let mut starts: Vec<Hypothesis> =
            sizes.iter().map(|factor| from(&|k, _| factor * fit.values[k])).collect();
        if sizes.len() > 1 {
            let far = (fit.hypothesis.effects[slot].starts)(&self.scale).into_iter();
            let far = far.map(|start| from(&|_, j| start[j])).map(|h| (cost(&self.problem, &h), h));
            starts.extend(far.min_by(|a, b| a.0.total_cmp(&b.0)).map(|f| f.1));
        }
        starts
            .into_par_iter()
            .map(|start| {
                let mut own = self.problem.clone();
                own.place_edges(&start, &start.start);
                (cost(&own, &start), own, start)
            })
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .map_or_else(|| fit.clone(), |(_, own, start)| own.fit(&start, &fit.columns, 5))
    }

    /// A candidate fitted under the noise it leaves itself, and what it leaves. The noise of a model
    /// that misses something forgives slow errors; so once more from white noise, if that leaves less.
    pub(crate) fn under_own_noise(&self, candidate: &Candidate) -> (f64, Fit) {
        let fit = candidate.fit.clone();
        let mut own = self.problem.clone();
        own.learn_noise(&fit.hypothesis, &fit.values);
        let here = left(&own, &fit);
        if self.free_in_time(candidate.effect) {
            return (here, fit);
        }
        let mut own = self.problem.clone();
        own.flat_noise();
        let first = own.fit(&fit.resume(), &[], 8);
        let afresh = in_turn(&mut own, first);
        own.learn_noise(&afresh.hypothesis, &afresh.values);
        let there = left(&own, &afresh);
        if there < here { (there, afresh) } else { (here, fit) }
    }
}

/// What a fit leaves, when the noise was learned from it: twice the logarithm of its size, and what
/// its parameters cost.
pub(crate) fn left(problem: &Problem, fit: &Fit) -> f64 {
    let size: f64 = problem.whiteners.iter().flatten().map(Whitener::log_size).sum();
    size + fit.penalty + rules::PER_PARAMETER * fit.hypothesis.free.len() as f64
}

/// Misfit of a hypothesis where it starts; infinite where the simulation breaks down.
pub(crate) fn cost(problem: &Problem, hypothesis: &Hypothesis) -> f64 {
    let residual = problem.residual(&problem.respond(hypothesis, &hypothesis.start));
    let cost = problem.whiten(&residual).norm_squared();
    if cost.is_finite() { cost } else { f64::INFINITY }
}

/// Whether an effect has no strength that could be zero: it puts other equations in the place of
/// the baseline's.
pub(crate) fn amends(effect: &Descriptor, scale: &Scale) -> bool {
    (effect.parameters)(scale).iter().all(|p| p.shape)
}

/// The starts of an effect at which no first-order look is possible.
pub(crate) fn unscreened(effect: &'static Descriptor, scale: &Scale) -> Vec<Screened> {
    let default: Vec<f64> = (effect.parameters)(scale).iter().map(|p| p.start).collect();
    std::iter::once(default)
        .chain((effect.starts)(scale))
        .map(|start| Screened {
            effect,
            origin: start.clone(),
            start,
            gain: 0.0,
            plain: 0.0,
            directions: 0,
            size: 0.0,
        })
        .collect()
}

/// Edges, noise and parameters in turn until they agree.
pub(crate) fn in_turn(problem: &mut Problem, mut fit: Fit) -> Fit {
    let mut at = fit.hypothesis.clone();
    for _ in 0..8 {
        at.start.clone_from(&fit.values);
        let moved = problem.place_edges(&at, &fit.values);
        if moved {
            fit = problem.fit(&at, &fit.columns, 3);
            at.start.clone_from(&fit.values);
        }
        problem.learn_noise(&at, &fit.values);
        fit = problem.fit(&at, &fit.columns, 4);
        if !moved {
            break;
        }
    }
    fit
}

/// The same values with a quarter of the strengths.
fn weaken(effect: &Descriptor, scale: &Scale, values: &[f64]) -> Vec<f64> {
    (effect.parameters)(scale)
        .iter()
        .zip(values)
        .map(|(spec, v)| if spec.shape { *v } else { (0.25 * v).clamp(spec.low, spec.high) })
        .collect()
}

pub(crate) fn sort(candidates: &mut [Candidate]) {
    candidates.sort_by(|a, b| a.criterion.total_cmp(&b.criterion).then(a.effect.id.cmp(b.effect.id)));
}
