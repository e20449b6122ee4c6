//! What each effect does to the baseline's response at plausible sizes, simulated once.
//!
//! A finite size, since friction, play and limits have no slope at nothing. Later sets of effects leave other
//! residuals, but an effect's action on them is nearly the same: which effects are worth a closer look on top
//! of any set is told by these without simulating.

use kort_identify::fit::{Fit, known_of};
use kort_identify::hypothesis::{Free, Member};
use kort_identify::simulate::Problem;
use kort_identify::{Quadratic, products};
use kort_thruster::effects::{Descriptor, Scale};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// Starts of one effect with the action of each of its sizes there.
#[derive(Clone)]
pub struct Probe {
    /// The effect where it was probed.
    pub member: Member,
    /// Its sizes, by their places among the effect's values, with what each does to the response as lines.
    sizes: Vec<(usize, DVector<f64>)>,
    /// Products of those.
    products: DMatrix<f64>,
    /// What it does where it has no sizes.
    always: Option<DVector<f64>>,
    /// Larger than the catalogue's start, where what it does is not in proportion.
    bends: bool,
}

/// Whether what an effect does is not in proportion to its size: a screen then says little of it.
pub fn bends(probes: &[Probe]) -> bool {
    probes.iter().any(|probe| probe.bends)
}

impl Probe {
    fn new(problem: &Problem, member: Member, sizes: Vec<(usize, DVector<f64>)>, bends: bool) -> Self {
        let actions: Vec<&DVector<f64>> = sizes.iter().map(|s| &s.1).collect();
        let products = products(&problem.spectrum, &actions);
        Self { member, sizes, products, always: None, bends }
    }

    /// Whether the effect does nothing to the set it was probed on: a limit that does not bind there, water that
    /// the model does not hold.
    pub fn inert(&self) -> bool {
        let still = |lines: &DVector<f64>| lines.amax() < INERT;
        self.sizes.iter().all(|s| still(&s.1)) && self.always.as_ref().is_none_or(still)
    }
}

/// In how many ways an effect may act here: its forms, for each whole number that a fit holds (an order of the shaft's
/// angle). Forms of what does nothing here are none.
pub fn ways(effect: &Descriptor, scale: &Scale, probes: &[Probe]) -> usize {
    let specs = (effect.parameters)(scale);
    let acts = |j: &usize| {
        specs[*j].shape
            || probes.iter().any(|p| p.sizes.iter().any(|(size, lines)| size == j && lines.amax() >= INERT))
    };
    let mut forms: Vec<Vec<usize>> = Vec::new();
    for form in effect.forms(&specs) {
        let form: Vec<usize> = form.into_iter().filter(acts).collect();
        if form.iter().any(|j| !specs[*j].shape) && !forms.contains(&form) {
            forms.push(form);
        }
    }
    let mut held: Vec<Vec<f64>> = Vec::new();
    for probe in probes {
        let numbers =
            probe.member.values.iter().zip(&specs).filter(|(_, s)| s.held && s.shape).map(|(v, _)| *v);
        let numbers: Vec<f64> = numbers.collect();
        if !held.contains(&numbers) {
            held.push(numbers);
        }
    }
    // What does nothing to the baseline at all may act beside others, in any form.
    let forms = if forms.is_empty() { effect.forms(&specs).len() } else { forms.len() };
    forms * held.len().max(1)
}

/// Largest line of an action, in full scales, that counts as none.
const INERT: f64 = 1e-9;

/// What probes promise of an effect on top of a set.
#[derive(Clone)]
pub struct Promise {
    /// Cost of the set with it, without the prior odds of its effects.
    pub cost: f64,
    /// The effect from where it would start.
    pub member: Member,
    /// The effect where it was probed, with the same sizes free: what switches on or binds does not scale.
    pub probed: Member,
}

/// Multiples of the catalogue's start at which one size is probed.
const LARGER: [f64; 2] = [5.0, 25.0];

/// Probes an effect on top of a fitted set.
pub fn probe(problem: &Problem, baseline: &Fit, effect: &'static Descriptor) -> Vec<Probe> {
    let whole = Member::new(effect, &problem.scale);
    let specs = (effect.parameters)(&problem.scale);
    if specs.iter().any(|s| s.acts.is_some()) {
        // What changes freely with time is linear in its many sizes.
        let hypothesis = baseline.hypothesis.with(&baseline.values, whole.clone(), &problem.scale);
        let own: Vec<usize> = (baseline.values.len()..hypothesis.free.len()).collect();
        let mut columns = problem.derivatives(&hypothesis, &hypothesis.start, &own);
        columns.sort_by_key(|c| c.0);
        let places = (0..specs.len()).filter(|j| !whole.held.contains(j) && !specs[*j].shape);
        let places: Vec<usize> = places.collect();
        let shapes = own.len() - places.len();
        let sizes = places.iter().zip(columns.into_iter().skip(shapes)).map(|(j, c)| {
            let size = whole.values[*j];
            (*j, c.1 * if size == 0.0 { 1.0 } else { size })
        });
        let sizes = sizes.collect();
        return vec![Probe::new(problem, whole, sizes, false)];
    }
    let strengths: Vec<usize> = (0..specs.len()).filter(|j| !specs[*j].shape && !specs[*j].held).collect();
    let action = |values: Vec<f64>| {
        let hypothesis = baseline.hypothesis.with(&baseline.values, whole.clone().at(values), &problem.scale);
        let action = &baseline.lines - problem.residual_lines(&hypothesis, &hypothesis.start);
        action.iter().all(|v| v.is_finite()).then_some(action)
    };
    let alone = |start: &[f64], only: usize| {
        let mut values = start.to_vec();
        strengths.iter().filter(|j| **j != only).for_each(|j| values[*j] = 0.0);
        if values[only] == 0.0 { None } else { action(values) }
    };
    let mut probes: Vec<Probe> = whole
        .starts(&problem.scale)
        .into_par_iter()
        .filter_map(|start| {
            let member = whole.clone().at(start.clone());
            if strengths.is_empty() {
                // Without a size it is there or not.
                let always = Some(action(start)?);
                return Some(Probe { always, ..Probe::new(problem, member, Vec::new(), false) });
            }
            let sizes: Vec<_> = strengths.iter().filter_map(|j| Some((*j, alone(&start, *j)?))).collect();
            (!sizes.is_empty()).then(|| Probe::new(problem, member, sizes, false))
        })
        .collect();
    let Some(first) = probes.first().filter(|p| p.always.is_none()) else { return probes };
    // What is not in proportion to its size is probed at larger ones.
    let larger = |(j, small): &(usize, DVector<f64>)| {
        let mut more = Vec::new();
        for times in LARGER {
            let mut start = whole.values.clone();
            start[*j] = (times * start[*j]).clamp(0.6 * specs[*j].low, 0.6 * specs[*j].high);
            let ratio = start[*j] / whole.values[*j];
            let Some(action) = alone(&start, *j) else { break };
            let in_proportion = (&action - small * ratio).norm() < BENDS * action.norm();
            if in_proportion {
                break;
            }
            more.push(Probe::new(problem, whole.clone().at(start), vec![(*j, action)], true));
        }
        more
    };
    let more: Vec<Probe> = first.sizes.par_iter().flat_map_iter(larger).collect();
    probes.extend(more);
    probes
}

/// Departure from proportion to its size, as a share, that makes an action worth probing at larger ones.
const BENDS: f64 = 0.05;

/// Promises of one effect that are worth a closer look: where its shape is far off, a size alone shows little.
const MOST_PROMISES: usize = 3;

/// What an effect's probes promise on top of a set, each by its best form; the best few. `known` is the criterion about
/// the set.
pub fn promises(problem: &Problem, parent: &Fit, known: &Quadratic, probes: &[Probe]) -> Vec<Promise> {
    let actions: Vec<&DVector<f64>> =
        probes.iter().flat_map(|p| &p.sizes).map(|(_, action)| action).collect();
    let crossed = known.crossed(&parent.lines, &actions);
    let mut crossed = crossed.iter();
    let mut of_probe = |probe: &Probe| {
        let crossed: Vec<&DMatrix<f64>> = crossed.by_ref().take(probe.sizes.len()).collect();
        let free = with_sizes(problem, parent, probe)?;
        let whole = match &probe.always {
            Some(action) => known.about(&(&parent.lines - action), &known_of(&parent.columns), &free),
            None => known.joined(&crossed, &probe.products, &free),
        };
        by_best_form(problem, parent, (&whole, &free), probe)
    };
    let mut all: Vec<Promise> = probes.iter().filter_map(&mut of_probe).collect();
    all.sort_by(|a, b| a.cost.total_cmp(&b.cost));
    all.truncate(MOST_PROMISES);
    all
}

/// What a probe promises by its best form, of the criterion with all its sizes.
fn by_best_form(
    problem: &Problem,
    parent: &Fit,
    whole: (&Quadratic, &[Free]),
    probe: &Probe,
) -> Option<Promise> {
    let specs = (probe.member.effect.parameters)(&problem.scale);
    // Forms of the same sizes differ in their shapes, about which a size alone tells nothing: all of them are
    // free until the fit has shown which it needs ([`Search`](crate::search::Search) tries the other forms then).
    let mut forms: Vec<(Vec<usize>, Vec<usize>)> = Vec::new();
    for form in probe.member.effect.forms(&specs) {
        let sizes: Vec<usize> =
            (0..probe.sizes.len()).filter(|k| form.contains(&probe.sizes[*k].0)).collect();
        match forms.iter_mut().find(|(_, known)| *known == sizes) {
            Some((places, _)) => places.extend(form),
            None => forms.push((form, sizes)),
        }
    }
    forms
        .into_iter()
        .filter(|(_, sizes)| !sizes.is_empty() || probe.always.is_some())
        .filter_map(|(form, sizes)| of_form(problem, parent, whole, probe, &form, &sizes))
        .min_by(|a, b| a.cost.total_cmp(&b.cost))
}

/// A set's free numbers and the sizes of a probe: each in units of where it was probed; it starts from nothing.
fn with_sizes(problem: &Problem, parent: &Fit, probe: &Probe) -> Option<Vec<Free>> {
    let specs = (probe.member.effect.parameters)(&problem.scale);
    let alone = parent.hypothesis.with(&parent.values, probe.member.clone(), &problem.scale);
    let mut free = parent.hypothesis.free.clone();
    for (place, _) in &probe.sizes {
        let own = alone.free[free_len(parent)..].iter().find(|f| f.name == specs[*place].name)?;
        let value = probe.member.values[*place];
        let unit = if value == 0.0 { 1.0 } else { value };
        let (a, b) = (own.low / unit, own.high / unit);
        free.push(Free {
            mean: own.mean / unit,
            sigma: (own.sigma / unit).abs(),
            low: a.min(b),
            high: a.max(b),
            ..own.clone()
        });
    }
    Some(free)
}

/// Most sizes of an effect with a form.
const MOST_ALONE: usize = 8;
/// Standard deviations tried for what changes freely with time, over the catalogue's: how much it moves is
/// learnt from the recording.
const LIVELINESS: [f64; 3] = [1.0, 0.3, 0.1];

/// What a probe promises with the sizes of one form, of the criterion with all of them.
fn of_form(
    problem: &Problem,
    parent: &Fit,
    (whole, all): (&Quadratic, &[Free]),
    probe: &Probe,
    places: &[usize],
    form: &[usize],
) -> Option<Promise> {
    let specs = (probe.member.effect.parameters)(&problem.scale);
    let mut member = probe.member.clone();
    let kept: Vec<usize> = (0..free_len(parent)).chain(form.iter().map(|k| free_len(parent) + k)).collect();
    let free: Vec<Free> = kept.iter().map(|k| all[*k].clone()).collect();
    let mut values = parent.values.clone();
    values.resize(free.len(), 0.0);
    let part;
    let model = if kept.len() == all.len() {
        whole
    } else {
        part = whole.only(&kept);
        &part
    };
    let lively = if form.len() > MOST_ALONE { &LIVELINESS[..] } else { &LIVELINESS[..1] };
    let tried = lively.iter().map(|liveliness| {
        let mut free = free.clone();
        free[free_len(parent)..].iter_mut().for_each(|f| f.sigma *= liveliness);
        let narrowed;
        let model = if *liveliness == 1.0 {
            model
        } else {
            narrowed = model.scaled(free_len(parent), *liveliness);
            &narrowed
        };
        let found = model.minimise(&parent.floor, &free, &values, 0.0);
        let cost = model.cost(&found);
        (cost, *liveliness, found, free)
    });
    let (cost, liveliness, found, free) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
    member.liveliness = liveliness;
    for (j, spec) in specs.iter().enumerate() {
        if spec.shape || spec.held {
            // A shape that belongs to what the form leaves out says nothing.
            if !spec.held && !places.contains(&j) {
                member.held.push(j);
                member.values[j] = spec.mean;
            }
            continue;
        }
        let in_form = form.iter().position(|k| probe.sizes[*k].0 == j);
        member.values[j] = match in_form {
            Some(i) => {
                let at = free_len(parent) + i;
                let unit = if probe.member.values[j] == 0.0 { 1.0 } else { probe.member.values[j] };
                let size = found.step[at] * free[at].sigma;
                // At nothing there is no slope.
                let size =
                    if specs[j].acts.is_none() && size.abs() < 0.1 { 0.1_f64.copysign(size) } else { size };
                (unit * size).clamp(spec.low, spec.high)
            }
            None => {
                member.held.push(j);
                0.0
            }
        };
    }
    let mut probed = Member { values: probe.member.values.clone(), ..member.clone() };
    for j in &probed.held {
        probed.values[*j] = member.values[*j];
    }
    Some(Promise { cost, member, probed })
}

fn free_len(parent: &Fit) -> usize {
    parent.hypothesis.free.len()
}
