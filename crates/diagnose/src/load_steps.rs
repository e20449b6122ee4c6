//! A load on the shaft that comes on, goes off or changes at instants: what a hand on a brake, weed in a propeller or
//! a clutch does, and no law of the machine's own motion.
//!
//! An instant has no slope where the load is none, and a few of them together show what one alone does not (a load
//! that comes on and goes off again). They are looked for by what a small load does from each instant of a grid on,
//! simulated once, in as many places as pay for themselves; each is then moved to where it leaves least.

use std::sync::Arc;

use kort_identify::fit::{Columns, Fit, known_of};
use kort_identify::hypothesis::{Free, Hypothesis, Member};
use kort_identify::simulate::Problem;
use kort_identify::{Quadratic, products};
use kort_thruster::both;
use kort_thruster::effects::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start};
use kort_thruster::plant::{Balance, Local};
use kort_thruster::real::Real;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::nameless::nameless;

/// Most changes in a recording.
const MOST: usize = 4;
/// Instants of the grid; from each the true one is found by halving the step.
const INSTANTS: usize = 80;
/// Changes of the grid whose products are summed at once.
const AT_ONCE: usize = 10;
/// Share of the recording before the first change, and after the last, at least.
const MARGIN: f64 = 0.02;
/// How long a change takes, s: least (long against a tick), usually, and most.
const RISE_S: [f64; 3] = [0.02, 0.05, 0.5];
/// An instant is moved by halves of the grid's step, so often.
const HALVINGS: i32 = 4;
/// Changes that are tried beyond what paid: a load that comes on and goes off again shows with its second one.
const LOOKAHEAD: usize = 2;

const SIZES: [&str; MOST] = ["torque_1_n_m", "torque_2_n_m", "torque_3_n_m", "torque_4_n_m"];
const BEGINNINGS: [&str; MOST] = ["from_1_s", "from_2_s", "from_3_s", "from_4_s"];

/// The term.
pub const LOAD_STEPS: Descriptor = Descriptor {
    forms: &[&[0, 1, 2], &[0, 1, 2, 3, 4], &[0, 1, 2, 3, 4, 5, 6], &[0, 1, 2, 3, 4, 5, 6, 7, 8]],
    ..nameless! {
        id: "unknown_shaft_step",
        path: Path::Shaft,
        what: "a load that changes at instants",
        equation: "shaft torque [N m] over time_s",
        parameters: specs,
        starts: one_start,
        needs: free_shaft,
        build: both!(|values, _: &Context<_>| Box::new(Steps { values: values.to_vec() })),
    }
};

fn specs(scale: &Scale) -> Vec<Spec> {
    let most = scale.torque_n_m;
    let of_change = |k: usize| {
        let size = Spec::strength(SIZES[k], "N m", SMALL * most, -most, most).sigma(0.1 * most);
        let [first, last] = within(scale);
        [size, Spec::shape(BEGINNINGS[k], "s", 0.5 * (first + last), first, last)]
    };
    let [least, usual, longest] = RISE_S;
    let rise = Spec::shape("rise_s", "s", usual, least, longest);
    std::iter::once(rise).chain((0..MOST).flat_map(of_change)).collect()
}

/// When a change may be: what was before it and what is after it must both be seen, a load throughout is no change.
fn within(scale: &Scale) -> [f64; 2] {
    let [from_s, to_s] = scale.clock_s;
    [MARGIN, 1.0 - MARGIN].map(|share| from_s + share * (to_s - from_s))
}

/// The load that is tried, as a share of the largest torque.
const SMALL: f64 = 0.02;

struct Steps<T> {
    values: Vec<T>,
}

impl<T: Real> Effect<T> for Steps<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let Some((rise_s, changes)) = self.values.split_first() else { return };
        for change in changes.chunks_exact(2) {
            let on = (((T::from(at.time_s) - change[1]) / *rise_s).tanh() + 1.0) * 0.5;
            balance.shaft_torque_n_m += change[0] * on;
        }
    }
}

/// Sizes and instants of the changes that are there, in order of time.
fn in_order(values: &[f64]) -> Vec<[f64; 2]> {
    let there = values.get(1..).unwrap_or_default().chunks_exact(2).filter(|change| change[0] != 0.0);
    let mut changes: Vec<[f64; 2]> = there.map(|change| [change[0], change[1]]).collect();
    changes.sort_by(|a, b| a[1].total_cmp(&b[1]));
    changes
}

/// The changes as words, in order of time.
pub fn expression(values: &[f64]) -> String {
    let words = in_order(values)
        .into_iter()
        .map(|[size, from_s]| format!("{size:+.4} N m from t = {from_s:.2} s on"));
    words.collect::<Vec<_>>().join(", ")
}

/// When the load of a fit differs, in words and as spans from each change to the next.
pub fn regime(problem: &Problem, fit: &Fit) -> (String, Vec<[f64; 2]>) {
    let members = problem.members(&fit.hypothesis, &fit.values);
    let values =
        members.into_iter().find(|m| m.effect.id == LOAD_STEPS.id).map_or_else(Vec::new, |m| m.values);
    let spans = spans(&values, problem.scale.clock_s[1]);
    let instants: Vec<String> = spans.iter().map(|span| format!("{:.2} s", span[0])).collect();
    (format!("from t = {} on", instants.join(", ")), spans)
}

fn spans(values: &[f64], end_s: f64) -> Vec<[f64; 2]> {
    let changes = in_order(values);
    let ends = changes.iter().skip(1).map(|c| c[1]).chain([end_s]);
    changes.iter().zip(ends).map(|(change, end)| [change[1], end]).collect()
}

/// The term with these changes.
fn changes(scale: &Scale, sizes: &[f64], instants: &[f64]) -> Member {
    let mut member = Member::new(&LOAD_STEPS, scale);
    for k in 0..MOST {
        member.values[2 * k + 1] = sizes.get(k).copied().unwrap_or(0.0);
        match instants.get(k) {
            Some(instant) => member.values[2 * k + 2] = *instant,
            None => member.held.extend([2 * k + 1, 2 * k + 2]),
        }
    }
    member
}

/// What a small load does from each instant of a grid on, on a fitted set: nearly the same as on any other.
pub fn on_a_grid(problem: &Problem, parent: &Fit) -> Vec<Change> {
    let looking = Looking::new(problem, parent);
    let [from_s, _] = problem.scale.clock_s;
    let step_s = grid_step_s(problem);
    let instants = (0..INSTANTS).into_par_iter().map(|k| from_s + (k as f64 + 0.5) * step_s);
    instants.filter_map(|instant| looking.change(instant)).collect()
}

fn grid_step_s(problem: &Problem) -> f64 {
    let [from_s, to_s] = problem.scale.clock_s;
    (to_s - from_s) / INSTANTS as f64
}

/// Cost of a set with changes of the load on it, as many as pay for themselves, about as it will be; and the set from
/// there. Changes that do not pay for themselves where they are on the grid are not moved about.
pub fn promise(problem: &Problem, parent: &Fit, grid: &[Change]) -> Option<(f64, Hypothesis)> {
    let looking = Looking::new(problem, parent);
    let mut changes: Vec<Change> = Vec::new();
    let mut best: Option<(Promise, Vec<f64>)> = None;
    let mut in_vain = 0;
    let mut model = problem.about(&parent.lines, &parent.columns, &parent.hypothesis);
    while changes.len() < MOST && in_vain < LOOKAHEAD {
        let costs = looking.with_each_of(&model, grid, changes.len());
        let Some(least) = (0..grid.len()).min_by(|a, b| costs[*a].total_cmp(&costs[*b])) else { break };
        changes.push(grid[least].clone());
        let pays = costs[least] < parent.cost();
        let promise = if pays {
            looking.place(&model, &mut changes, grid_step_s(problem))
        } else {
            looking.promise(&model, &changes)
        };
        model = looking.with_changes(&model, &changes).0;
        if best.as_ref().is_none_or(|(known, _)| promise.cost < known.cost) {
            best = Some((promise, changes.iter().map(|c| c.from_s).collect()));
            in_vain = 0;
        } else {
            in_vain += 1;
        }
    }
    let (promise, instants) = best?;
    Some((promise.cost, looking.with(&promise.sizes_n_m, &instants)))
}

/// A fit's set with one change less, for each that it has.
pub fn with_one_less(problem: &Problem, fit: &Fit) -> Vec<(Hypothesis, Columns)> {
    let members = problem.members(&fit.hypothesis, &fit.values);
    let Some(place) = members.iter().position(|m| m.effect.id == LOAD_STEPS.id) else { return Vec::new() };
    let all = in_order(&members[place].values);
    let less = |k: usize| {
        let mut rest = all.clone();
        rest.remove(k);
        let (sizes, instants): (Vec<f64>, Vec<f64>) =
            rest.into_iter().map(|[size, from_s]| (size, from_s)).unzip();
        let mut fewer = changes(&problem.scale, &sizes, &instants);
        fewer.values[0] = members[place].values[0];
        let mut members = members.clone();
        members[place] = fewer;
        problem.recompose(fit, &members)
    };
    if all.len() < 2 { Vec::new() } else { (0..all.len()).map(less).collect() }
}

/// What a small load does from an instant on.
#[derive(Clone)]
pub struct Change {
    from_s: f64,
    action: Arc<DVector<f64>>,
}

/// What changes of the load promise: the cost with them, and how large they would be.
struct Promise {
    cost: f64,
    sizes_n_m: Vec<f64>,
}

/// A fitted set on which changes are tried.
struct Looking<'a> {
    problem: &'a Problem<'a>,
    parent: &'a Fit,
    /// Derivatives of what is free in the set.
    columns: Vec<Arc<DVector<f64>>>,
    /// A change's size, in small loads.
    size: Free,
    small_n_m: f64,
}

impl<'a> Looking<'a> {
    fn new(problem: &'a Problem<'a>, parent: &'a Fit) -> Self {
        let small_n_m = SMALL * problem.scale.torque_n_m;
        let one = parent.hypothesis.with(
            &parent.values,
            changes(&problem.scale, &[small_n_m], &[0.0]),
            &problem.scale,
        );
        let size = one.free[parent.values.len() + 1].clone();
        Self {
            problem,
            parent,
            columns: known_of(&parent.columns),
            size: Free {
                sigma: size.sigma / small_n_m,
                low: size.low / small_n_m,
                high: size.high / small_n_m,
                ..size
            },
            small_n_m,
        }
    }

    fn with(&self, sizes_n_m: &[f64], instants: &[f64]) -> Hypothesis {
        let scale = &self.problem.scale;
        self.parent.hypothesis.with(&self.parent.values, changes(scale, sizes_n_m, instants), scale)
    }

    fn change(&self, from_s: f64) -> Option<Change> {
        let hypothesis = self.with(&[self.small_n_m], &[from_s]);
        let action = &self.parent.lines - self.problem.residual_lines(&hypothesis, &hypothesis.start);
        action.iter().all(|v| v.is_finite()).then(|| Change { from_s, action: Arc::new(action) })
    }

    /// The criterion with these changes on the set, from one with others: what both have is not summed again.
    fn with_changes(&self, before: &Quadratic<'a>, changes: &[Change]) -> (Quadratic<'a>, Vec<Free>) {
        let actions = changes.iter().map(|change| change.action.clone());
        let columns: Vec<Arc<DVector<f64>>> = self.columns.iter().cloned().chain(actions).collect();
        let mut free = self.parent.hypothesis.free.clone();
        free.extend(changes.iter().map(|_| self.size.clone()));
        (before.beside(&self.parent.lines, &columns, &free), free)
    }

    fn promise(&self, before: &Quadratic<'a>, changes: &[Change]) -> Promise {
        let (model, free) = self.with_changes(before, changes);
        self.promise_of(&model, &free, changes.len())
    }

    /// What it costs to add each change of a grid to so many.
    fn with_each_of(&self, before: &Quadratic<'a>, grid: &[Change], changes: usize) -> Vec<f64> {
        let mut free = self.parent.hypothesis.free.clone();
        free.extend((0..=changes).map(|_| self.size.clone()));
        let costs = |some: &[Change]| -> Vec<f64> {
            let actions: Vec<&DVector<f64>> = some.iter().map(|change| change.action.as_ref()).collect();
            let crossed = before.crossed(&self.parent.lines, &actions);
            let with = |(action, crossed): (&&DVector<f64>, &DMatrix<f64>)| {
                let own = products(&self.problem.spectrum, &[*action]);
                self.promise_of(&before.joined(&[crossed], &own, &free), &free, changes + 1).cost
            };
            actions.iter().zip(&crossed).map(with).collect()
        };
        grid.par_chunks(AT_ONCE).flat_map_iter(costs).collect()
    }

    fn promise_of(&self, model: &Quadratic, free: &[Free], changes: usize) -> Promise {
        let parent = self.parent;
        let mut values = parent.values.clone();
        values.resize(free.len(), 0.0);
        let found = model.minimise(&parent.floor, free, &values, 0.0);
        // An instant is a number too: one of so many.
        let instants = 2.0 * (INSTANTS as f64).ln() * changes as f64;
        let size = |k: usize| found.step[k] * free[k].sigma * self.small_n_m;
        Promise {
            cost: model.cost(&found) + instants,
            sizes_n_m: (parent.values.len()..free.len()).map(size).collect(),
        }
    }

    /// Moves each change to where they leave least together.
    fn place(&self, before: &Quadratic<'a>, changes: &mut [Change], step_s: f64) -> Promise {
        let [first, last] = within(&self.problem.scale);
        let mut least = self.promise(before, changes);
        for halving in 1..=HALVINGS {
            let by = step_s * 0.5_f64.powi(halving);
            for k in 0..changes.len() {
                let from_s = changes[k].from_s;
                for to in [from_s - by, from_s + by] {
                    let Some(moved) = self.change(to.clamp(first, last)) else {
                        continue;
                    };
                    let was = std::mem::replace(&mut changes[k], moved);
                    let there = self.promise(before, changes);
                    if there.cost < least.cost { least = there } else { changes[k] = was }
                }
            }
        }
        least
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_are_told_in_order_of_time_and_those_that_are_none_are_not() {
        let told = expression(&[0.05, 0.25, 9.0, -0.5, 3.125, 0.0, 1.0, 0.0, 2.0]);
        assert_eq!(told, "-0.5000 N m from t = 3.12 s on, +0.2500 N m from t = 9.00 s on");
        let spans = spans(&[0.05, 0.25, 9.0, -0.5, 3.125, 0.0, 1.0, 0.0, 2.0], 20.0);
        assert_eq!(spans, [[3.125, 9.0], [9.0, 20.0]]);
    }

    #[test]
    fn what_is_not_there_is_not_free() {
        let two = changes(&Scale::ANY, &[0.1, 0.2], &[0.3, 0.4]);
        assert_eq!(two.held, [5, 6, 7, 8]);
        assert_eq!(two.values[1..6], [0.1, 0.3, 0.2, 0.4, 0.0]);
    }
}
