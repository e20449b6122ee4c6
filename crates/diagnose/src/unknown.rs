//! Is something left that no name explains? A term that bends to anything is put on each place where physics
//! may be missing, on top of the best set and instead of its members. It pays for all its numbers.

use std::sync::Arc;

use kort_identify::fit::{Fit, known_of};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_thruster::effects::{Available, Descriptor};
use kort_thruster::rig::Rig;
use rayon::prelude::*;

use crate::flexible::TERMS;
use crate::left::leaves_more;
use crate::load_steps::{self, Change, LOAD_STEPS};
use crate::search::{Search, Set, with};

/// Looks for what has no name beside a set, and keeps the sets with it that do better, or as well with fewer
/// names.
pub fn look(
    search: &mut Search,
    best: &Set,
    rig: &Rig,
    offered: &Available,
    progress: &(dyn Fn(&str) + Sync),
) {
    let terms: Vec<&'static Descriptor> =
        TERMS.iter().copied().filter(|t| (t.needs)(rig, offered).is_ok()).collect();
    let Some(fit) = search.fits.get(best) else { return };
    let steps = terms.iter().any(|term| term.id == LOAD_STEPS.id);
    let grid = if steps { load_steps::on_a_grid(search.problem, fit) } else { Vec::new() };
    let beside = put_on(search, best, &terms, best, &grid);
    if let Some(beside) = beside.first() {
        // Names that only stood for it, and names that show once it is there.
        search.refine(beside);
    }
    if best.is_empty() {
        return;
    }
    // Where nothing pays on top of the names, only what does about as well as they do can stand in their place.
    let place = if beside.is_empty() { best.clone() } else { Set::new() };
    for alone in put_on(search, &Set::new(), &terms, &place, &grid) {
        search.climb(alone, progress);
        // A term that says little alone may be what the names need; it is tried while more than noise is left.
        if cheapest(search).is_none_or(|fit| !leaves_more(search.problem, fit)) {
            return;
        }
    }
}

/// The fit of the set that costs least.
fn cheapest<'a>(search: &'a Search) -> Option<&'a Fit> {
    let set = search.fits.keys().min_by(|a, b| search.cost(a).total_cmp(&search.cost(b)))?;
    search.fits.get(set)
}

/// Fits the terms that promise most on top of a set; the sets with one, the cheapest first, if a promise may earn its price
/// and do as well as what is to be beaten.
fn put_on(
    search: &mut Search,
    set: &Set,
    terms: &[&'static Descriptor],
    beaten: &Set,
    grid: &[Change],
) -> Vec<Set> {
    let Some(parent) = search.fits.get(set).cloned() else { return Vec::new() };
    let mut promised: Vec<(f64, &'static Descriptor, Hypothesis)> =
        terms.par_iter().filter_map(|term| promise(search, &parent, term, grid)).collect();
    let best = promised.iter().map(|p| p.0).fold(f64::INFINITY, f64::min);
    let doubt = search.doubt(parent.cost() - best);
    let most = search.cost(beaten).min(parent.cost()) + doubt;
    let may = |cost: f64, term: &Descriptor| cost < best + doubt && cost + search.price_of(term.id) < most;
    promised.retain(|(cost, term, _)| may(*cost, term));
    let mut larger: Vec<Set> = Vec::new();
    for (_, term, hypothesis) in promised {
        let set = with(set, term.id);
        search.fit_set(set.clone(), &hypothesis, &parent.columns);
        leave_out_changes(search, &set);
        larger.push(set);
    }
    larger.retain(|set| search.fits.contains_key(set));
    larger.sort_by(|a, b| search.cost(a).total_cmp(&search.cost(b)));
    larger
}

/// Leaves changes of the load out of a set as long as that helps.
fn leave_out_changes(search: &mut Search, set: &Set) {
    while let Some(fit) = search.fits.get(set) {
        let before = fit.cost();
        for (hypothesis, columns) in load_steps::with_one_less(search.problem, fit) {
            search.fit_set(set.clone(), &hypothesis, &columns);
        }
        if search.fits[set].cost() >= before {
            return;
        }
    }
}

/// Cost of a set with a term on it, to first order; and the set from there.
fn promise(
    search: &Search,
    parent: &Fit,
    term: &'static Descriptor,
    grid: &[Change],
) -> Option<(f64, &'static Descriptor, Hypothesis)> {
    let problem = search.problem;
    if term.id == LOAD_STEPS.id {
        return load_steps::promise(problem, parent, grid).map(|(cost, hypothesis)| (cost, term, hypothesis));
    }
    let whole = Member::new(term, &problem.scale);
    let specs = (term.parameters)(&problem.scale);
    let shapes = specs.iter().any(|s| s.shape && !s.held);
    let mut starts = (term.starts)(&problem.scale);
    if starts.is_empty() {
        // Linear in all its heights: from nothing.
        starts.push(specs.iter().map(|s| if s.shape { s.start } else { 0.0 }).collect());
    }
    let known = problem.about(&parent.lines, &parent.columns, &parent.hypothesis);
    starts
        .into_iter()
        .filter_map(|start| {
            let hypothesis = parent.hypothesis.with(&parent.values, whole.clone().at(start), &problem.scale);
            let own: Vec<usize> = (parent.values.len()..hypothesis.free.len()).collect();
            let lines = if shapes {
                problem.residual_lines(&hypothesis, &hypothesis.start)
            } else {
                parent.lines.clone()
            };
            let mut new = problem.derivatives(&hypothesis, &hypothesis.start, &own);
            new.sort_by_key(|c| c.0);
            if !new.iter().all(|c| c.1.iter().all(|v| v.is_finite())) || !lines.iter().all(|v| v.is_finite())
            {
                return None;
            }
            let mut columns = known_of(&parent.columns);
            columns.extend(new.into_iter().map(|c| Arc::new(c.1)));
            let model = known.about(&lines, &columns, &hypothesis.free);
            let found = model.minimise(&parent.floor, &hypothesis.free, &hypothesis.start, 0.0);
            let cost = model.cost(&found);
            let start = hypothesis
                .free
                .iter()
                .enumerate()
                .map(|(k, f)| (hypothesis.start[k] + found.step[k] * f.sigma).clamp(f.low, f.high))
                .collect();
            Some((cost, term, Hypothesis { start, ..hypothesis }))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
}
