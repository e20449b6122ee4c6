//! Which effects are worth an exact fit on top of a set? Those whose probes promise most are simulated there:
//! the response is taken as linear about that point, and the criterion minimised and priced as a fit's is.

use std::sync::Arc;

use kort_identify::Quadratic;
use kort_identify::fit::{Columns, Fit, known_of};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_identify::simulate::Problem;
use kort_thruster::dual::LANES;
use kort_thruster::effects::Descriptor;
use nalgebra::DVector;
use rayon::prelude::*;

use crate::probe::{Probe, Promise, promises};

/// An effect on top of a set, as the screen sees it.
#[derive(Clone)]
pub struct Screened {
    /// The effect.
    pub effect: &'static Descriptor,
    /// The set with it, from where the screen looked: the step from there is the fit's to take, which sees
    /// where the response bends.
    pub hypothesis: Hypothesis,
    /// Derivatives there.
    pub columns: Columns,
    /// Measured less simulated there, as lines.
    pub lines: DVector<f64>,
    /// The fit that it was looked at on top of.
    pub upon: Arc<Fit>,
    /// Its cost there, without the prior odds of its effects.
    pub cost: f64,
}

/// Starts of one effect that are fitted on top of one set.
const STARTS_OF_ONE: usize = 2;
/// Part of what a probe promises that is worth no other look.
const KEPT: f64 = 0.7;
/// Promises looked at closely on top of one set, and effects of which one is.
const CLOSELY: usize = 14;

/// Screens effects on top of a fit, cheapest first. Effects that break the simulation down are left out, and promises
/// that are worth no closer look.
pub fn screen(
    problem: &Problem,
    parent: &Fit,
    probes: &[&[Probe]],
    worth: impl Fn(&Promise) -> bool,
) -> Vec<Screened> {
    let parent = &Arc::new(parent.clone());
    let known = &problem.about(&parent.lines, &parent.columns, &parent.hypothesis);
    let mut promised: Vec<Promise> =
        probes.par_iter().flat_map_iter(|probes| promises(problem, parent, known, probes)).collect();
    promised.retain(worth);
    promised.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    let mut effects = Vec::new();
    let promised = promised.into_iter().enumerate().filter(|(place, p)| {
        let first = !effects.contains(&p.member.effect.id);
        if first {
            effects.push(p.member.effect.id);
        }
        // Other starts of a few effects must not crowd out the rest.
        *place < CLOSELY || first && effects.len() <= CLOSELY
    });
    let promised: Vec<Promise> = promised.map(|p| p.1).collect();
    let mut all: Vec<Screened> =
        promised.into_par_iter().filter_map(|p| look(problem, parent, known, p)).collect();
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    // Where an effect is a different motion from each of its starts, a fit does not come from one to the other.
    let mut seen: Vec<&'static str> = Vec::new();
    all.retain(|s| {
        let before = seen.iter().filter(|id| **id == s.effect.id).count();
        seen.push(s.effect.id);
        before < STARTS_OF_ONE
    });
    all
}

/// A closer look at a promise: at the size that a straight line promises and, where that does not keep it, at the size
/// that was probed. What switches on or binds may do nothing at the first.
pub fn look(problem: &Problem, parent: &Arc<Fit>, known: &Quadratic, promise: Promise) -> Option<Screened> {
    let promised = parent.cost() - promise.cost;
    let scaled = at(problem, parent, known, promise.member);
    if scaled.as_ref().is_some_and(|s| parent.cost() - s.cost > KEPT * promised) {
        return scaled;
    }
    let probed = at(problem, parent, known, promise.probed);
    scaled.into_iter().chain(probed).min_by(|a, b| a.cost.total_cmp(&b.cost))
}

fn at(problem: &Problem, parent: &Arc<Fit>, known: &Quadratic, member: Member) -> Option<Screened> {
    let effect = member.effect;
    let hypothesis = parent.hypothesis.with(&parent.values, member, &problem.scale);
    let own: Vec<usize> = (parent.values.len()..hypothesis.free.len()).collect();
    let (lines, new) = if own.len() <= LANES {
        problem.residual_with_derivatives(&hypothesis, &hypothesis.start, &own)
    } else {
        let mut new = problem.derivatives(&hypothesis, &hypothesis.start, &own);
        new.sort_by_key(|c| c.0);
        (problem.residual_lines(&hypothesis, &hypothesis.start), new.into_iter().map(|c| c.1).collect())
    };
    let finite = |v: &DVector<f64>| v.iter().all(|x| x.is_finite());
    if !finite(&lines) || !new.iter().all(finite) {
        return None;
    }
    let new: Vec<Arc<DVector<f64>>> = new.into_iter().map(Arc::new).collect();
    let columns = [known_of(&parent.columns), new.clone()].concat();
    let model = known.about(&lines, &columns, &hypothesis.free);
    let minimum = model.minimise(&parent.floor, &hypothesis.free, &hypothesis.start, 0.0);
    let cost = model.cost(&minimum);
    let columns = parent.columns.iter().cloned().chain(new.into_iter().map(Some)).collect();
    Some(Screened { effect, hypothesis, columns, lines, upon: parent.clone(), cost })
}
