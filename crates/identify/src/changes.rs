//! Changes in mid-run: a load, a gain, an inflow or a reading that is another from some instant on.
//!
//! Nobody announces a brake that is switched on. A step of unknown size is sought at every instant
//! to first order, several steps together; those that stay are simulated and fitted with their
//! instants. Colour learned from a model without them would hide them (a step is slow noise), so
//! they are sought under flat noise, and judged under the noise that they leave.

use kort_thruster::both;
use kort_thruster::effects::{
    Available, Descriptor, Effect, Hooks, Path, Scale, Spec, free_shaft, one_start, wet,
};
use kort_thruster::plant::{Balance, Drive, Local, Sensed, Tick};
use kort_thruster::real::Real;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use crate::baseline::{members, with_effect};
use crate::errors;
use crate::fit::{Fit, Hypothesis, Problem, Target};
use crate::heldout::{held_out_rows, trained};
use crate::library::{commanded, thrust_measured};
use crate::noise::Whitener;
use crate::rules;
use crate::screen::Projector;
use crate::search::{Search, criterion};

/// Most changes in one recording.
const MOST: usize = 6;
/// Instants tried first, evenly over the recording.
const INSTANTS: usize = 60;
/// A further change must bring this share of what the first brings.
const LEAST_SHARE: f64 = 0.02;
/// Families that come this near to the best are simulated as well.
const NEAR: f64 = 0.8;
/// Two changes are at least this far apart, s: nearer ones are one that takes a while.
const APART_S: f64 = 1.0;
/// Values of a term before its steps: reference speed and rise time.
const HEAD: usize = 2;
/// A load and a gain of the drive differ at one speed only in how fast they act, which hangs on lags
/// that nobody knows well: within this share of the gain they cannot be told apart.
const LOAD_OR_GAIN: f64 = 0.15;
/// Share of the error above the noise on left-out rows that changes must take away.
const HOLDS: f64 = 0.3;

/// The steps of one term: size and instant each, how long one takes, and the speed that counts as large.
struct Steps<T> {
    reference: T,
    rise_s: T,
    at: Vec<(T, T)>,
}

impl<T: Real> Steps<T> {
    fn new(v: &[T]) -> Self {
        let at = v[HEAD..].chunks_exact(2).map(|c| (c[0], c[1])).collect();
        Self { reference: v[0], rise_s: v[1], at }
    }

    /// Sum of the steps so far.
    fn level(&self, time_s: f64) -> T {
        let passed = |t: T| ((T::from(time_s) - t) / self.rise_s).tanh() + 1.0;
        self.at.iter().map(|(size, t)| *size * 0.5 * passed(*t)).sum()
    }
}

struct Load<T>(Steps<T>);
struct Gain<T>(Steps<T>);
struct Inflow<T>(Steps<T>);
struct Reading<T>(Steps<T>);

impl<T: Real> Effect<T> for Load<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }
    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.shaft_torque_n_m -=
            self.0.level(at.time_s) * (at.shaft_speed_rad_s * 10.0 / self.0.reference).tanh();
    }
}

impl<T: Real> Effect<T> for Gain<T> {
    fn hooks(&self) -> Hooks {
        Hooks::DRIVE
    }
    fn drive(&mut self, tick: &Tick, drive: &mut Drive<T>) {
        drive.command *= self.0.level(tick.time_s) + 1.0;
    }
}

impl<T: Real> Effect<T> for Inflow<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }
    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.ambient_m_s += self.0.level(at.time_s);
    }
}

impl<T: Real> Effect<T> for Reading<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }
    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        sensed.thrust_n += self.0.level(tick.time_s);
    }
}

const ONSETS: [&str; MOST] = ["onset_1_s", "onset_2_s", "onset_3_s", "onset_4_s", "onset_5_s", "onset_6_s"];

fn specs(names: &[&'static str], unit: &'static str, typical: f64, reach: f64, scale: &Scale) -> Vec<Spec> {
    let reference = scale.shaft_speed_rad_s;
    let mut list = vec![
        Spec::held("reference", "SI", reference, reference, reference),
        Spec::shape("rise_s", "s", 0.05, 0.02, 0.6),
    ];
    for (name, onset) in names.iter().zip(ONSETS) {
        list.push(Spec::strength(name, unit, 0.02 * typical, -reach * typical, reach * typical));
        // An instant may lie anywhere: the log's clock need not start at zero.
        list.push(Spec::shape(onset, "s", 0.5 * scale.duration_s, -1e7, 1e7));
    }
    list
}

macro_rules! family {
    ($all:ident, $path:expr, $equation:literal, $needs:expr, $build:expr, $unit:literal, $typical:expr, $reach:literal,
     [$($id:literal $name:literal),+]) => {
        static $all: [Descriptor; MOST] = {
            const NAMES: [&str; MOST] = [$($name),+];
            const IDS: [&str; MOST] = [$($id),+];
            const fn one<const N: usize>() -> Descriptor {
                Descriptor {
                    id: IDS[N - 1],
                    path: $path,
                    what: "a term without a name",
                    equation: $equation,
                    signature: "",
                    confused_with: &[],
                    separated_by: "",
                    reference: "",
                    parameters: |s| specs(&NAMES[..N], $unit, $typical(s), $reach, s),
                    starts: one_start,
                    needs: $needs,
                    build: both!($build),
                }
            }
            [one::<1>(), one::<2>(), one::<3>(), one::<4>(), one::<5>(), one::<6>()]
        };
    };
}

family!(
    LOADS, Path::Shaft, "shaft torque - k1 from t1 on, - k2 from t2 on, ...", free_shaft,
    |v, _| Box::new(Load(Steps::new(v))), "N m", |s: &Scale| s.torque_n_m, 2.0,
    ["term_shaft_changes_1" "load_torque_1_n_m", "term_shaft_changes_2" "load_torque_2_n_m",
     "term_shaft_changes_3" "load_torque_3_n_m", "term_shaft_changes_4" "load_torque_4_n_m",
     "term_shaft_changes_5" "load_torque_5_n_m", "term_shaft_changes_6" "load_torque_6_n_m"]
);
family!(
    GAINS, Path::Drive, "command (1 + k1 from t1 on + k2 from t2 on ...)", commanded,
    |v, _| Box::new(Gain(Steps::new(v))), "1", |_: &Scale| 1.0, 0.9,
    ["term_drive_changes_1" "gain_change_1", "term_drive_changes_2" "gain_change_2",
     "term_drive_changes_3" "gain_change_3", "term_drive_changes_4" "gain_change_4",
     "term_drive_changes_5" "gain_change_5", "term_drive_changes_6" "gain_change_6"]
);
family!(
    INFLOWS, Path::Flow, "ambient flow + k1 from t1 on, + k2 from t2 on, ...", wet,
    |v, _| Box::new(Inflow(Steps::new(v))), "m/s", |s: &Scale| s.flow_m_s, 3.0,
    ["term_flow_changes_1" "ambient_step_1_m_s", "term_flow_changes_2" "ambient_step_2_m_s",
     "term_flow_changes_3" "ambient_step_3_m_s", "term_flow_changes_4" "ambient_step_4_m_s",
     "term_flow_changes_5" "ambient_step_5_m_s", "term_flow_changes_6" "ambient_step_6_m_s"]
);
family!(
    READINGS, Path::Sensor, "thrust reading + k1 from t1 on, + k2 from t2 on, ...", thrust_measured,
    |v, _| Box::new(Reading(Steps::new(v))), "N", |s: &Scale| s.thrust_n, 2.0,
    ["term_sensor_changes_1" "thrust_step_1_n", "term_sensor_changes_2" "thrust_step_2_n",
     "term_sensor_changes_3" "thrust_step_3_n", "term_sensor_changes_4" "thrust_step_4_n",
     "term_sensor_changes_5" "thrust_step_5_n", "term_sensor_changes_6" "thrust_step_6_n"]
);

/// The load first: at one speed a load that comes on and a drive that loses gain look alike, and
/// the load is the likelier of the two.
static FAMILIES: [&[Descriptor; MOST]; 4] = [&LOADS, &GAINS, &INFLOWS, &READINGS];

/// Is this term one of changes in mid-run?
pub fn is_change(effect: &Descriptor) -> bool {
    FAMILIES.iter().any(|family| family.iter().any(|d| d.id == effect.id))
}

/// Steps of a change term from its values: size and instant, in order of time.
pub fn steps(values: &[f64]) -> Vec<(f64, f64)> {
    let mut list = Steps::new(values).at;
    list.sort_by(|a, b| a.1.total_cmp(&b.1));
    list
}

/// Spans in which the level differs clearly from that before the first step, up to `end_s`.
pub fn spans(values: &[f64], end_s: f64) -> Vec<[f64; 2]> {
    let list = steps(values);
    let mut levels = Vec::new();
    let mut level = 0.0;
    for (k, (size, at)) in list.iter().enumerate() {
        level += size;
        levels.push((level, [*at, list.get(k + 1).map_or(end_s, |s| s.1)]));
    }
    let top = levels.iter().fold(0.0_f64, |m, l| m.max(l.0.abs()));
    levels.into_iter().filter(|l| l.0.abs() > 0.25 * top).map(|l| l.1).collect()
}

/// Instants at which a fitted hypothesis changes, in order.
pub fn instants(fit: &Fit) -> Vec<f64> {
    let of_change = |target: Target| match target {
        Target::Effect(i, j) => j >= HEAD && j % 2 == 1 && is_change(fit.hypothesis.effects[i]),
        Target::Base(_) => false,
    };
    let mut list: Vec<f64> = fit
        .hypothesis
        .free
        .iter()
        .zip(&fit.values)
        .filter(|(free, _)| of_change(free.target))
        .map(|(_, v)| *v)
        .collect();
    list.sort_by(f64::total_cmp);
    list
}

/// Changes that were found.
pub struct Found {
    /// The term.
    pub effect: &'static Descriptor,
    /// The baseline under the noise that the changes leave.
    pub before: Fit,
    /// The fit with them.
    pub fit: Fit,
    /// The same changes on another path, and by how much they are worse in the criterion.
    pub rival: Option<(&'static Descriptor, f64)>,
}

/// Seeks changes on top of a baseline. On success the problem's noise is what they leave; a recording
/// without any leaves the problem as it was.
pub fn find(search: &mut Search, baseline: &Fit, offered: &Available) -> Option<Found> {
    // Instants belong to one recording; several have none in common.
    let [recording] = search.problem.recordings.as_slice() else { return None };
    let (from_s, duration_s) = (recording.time_s[0], recording.duration_s());
    let saved = search.problem.whiteners.clone();
    let plain = flat(&search.problem, baseline);
    let mut start = plain.fit(&baseline.resume(), &[], 8);
    let projector = Projector::new(&plain, &mut start);
    let seeker = Seeker { plain: &plain, start: &start, projector: &projector, scale: &search.scale };

    let spacing = duration_s / INSTANTS as f64;
    let grid: Vec<f64> = (1..INSTANTS).map(|k| from_s + k as f64 * spacing).collect();
    let sketches: Vec<(usize, Sketch)> = FAMILIES
        .iter()
        .enumerate()
        .filter(|(_, family)| (family[0].needs)(search.problem.rig, offered).is_ok())
        .filter_map(|(k, family)| Some((k, seeker.sketch(family, &grid)?)))
        .collect();
    // What one path finds, the others may try: a wrong first pick can spoil a sketch.
    let instants: Vec<f64> = sketches
        .iter()
        .max_by(|a, b| a.1.gain.total_cmp(&b.1.gain))
        .map_or_else(Vec::new, |s| s.1.steps.iter().map(|s| s.1).collect());
    let sketches: Vec<(usize, Sketch)> = sketches
        .into_iter()
        .map(|(k, own)| match seeker.sketch(FAMILIES[k], &instants) {
            Some(other) if other.gain > (1.0 - LOAD_OR_GAIN) * own.gain => (k, other),
            _ => (k, own),
        })
        .collect();
    let top = sketches.iter().map(|s| s.1.gain).fold(0.0, f64::max);
    let mut fits: Vec<(&'static Descriptor, Fit)> = sketches
        .into_iter()
        .filter(|s| s.1.gain > NEAR * top && s.1.gain > rules::TERM_LEAST)
        .map(|(k, sketch)| seeker.simulate(FAMILIES[k], sketch, spacing))
        .collect();
    let best = |fits: &[(&'static Descriptor, Fit)]| {
        (0..fits.len()).min_by(|a, b| criterion(&fits[*a].1).total_cmp(&criterion(&fits[*b].1)))
    };
    for _ in 0..2 {
        let lead = best(&fits)?;
        search.problem.learn_noise(&fits[lead].1.hypothesis, &fits[lead].1.values);
        fits = fits.into_iter().map(|(d, f)| prune(search, d, &f)).collect();
    }
    let before = search.again(&start);
    let lead = best(&fits)?;
    let gain = criterion(&before) - criterion(&fits[lead].1);
    let doubt = rules::TERM_LEAST.max(LOAD_OR_GAIN * gain);
    let chosen = (0..fits.len())
        .filter(|k| fits[*k].0.path == Path::Shaft && fits[lead].0.path == Path::Drive)
        .find(|k| criterion(&fits[*k].1) < criterion(&fits[lead].1) + doubt)
        .unwrap_or(lead);
    let rival = (0..fits.len())
        .filter(|k| *k != chosen)
        .map(|k| (fits[k].0, criterion(&fits[k].1) - criterion(&fits[chosen].1)))
        .min_by(|a, b| a.1.total_cmp(&b.1));
    let (effect, fit) = fits.swap_remove(chosen);
    let found = Found { effect, before, fit, rival };
    if gain > rules::BELIEVE
        && search.size(&found.before, &found.fit) > rules::LEAST_SIZE
        && held(&search.problem, &found) > HOLDS
    {
        return Some(found);
    }
    search.problem.whiteners = saved;
    None
}

/// The problem with flat noise, as large as what the baseline leaves.
fn flat<'a>(problem: &Problem<'a>, baseline: &Fit) -> Problem<'a> {
    let residual = problem.residual(&problem.respond(&baseline.hypothesis, &baseline.values));
    let mut plain = problem.clone();
    plain.whiteners = problem
        .recordings
        .iter()
        .zip(&residual)
        .map(|(recording, channels)| {
            let each = recording.channels.iter().zip(channels);
            each.map(|(c, r)| {
                let rms = (r.iter().map(|v| v * v).sum::<f64>() / r.len().max(1) as f64).sqrt();
                Whitener::flat(rms.max(1e-6 * c.full_scale), r.len())
            })
            .collect()
        })
        .collect();
    plain
}

/// Where changes of one family lie, to first order.
struct Sketch {
    /// Size and instant.
    steps: Vec<(f64, f64)>,
    /// Fall of the sum of squares.
    gain: f64,
}

struct Seeker<'a> {
    plain: &'a Problem<'a>,
    start: &'a Fit,
    projector: &'a Projector,
    scale: &'a Scale,
}

impl Seeker<'_> {
    /// The best few steps among instants.
    fn sketch(&self, family: &'static [Descriptor; MOST], grid: &[f64]) -> Option<Sketch> {
        let (gram, gradient) = self.directions(family, grid);
        let apart = |a: usize, b: usize| (grid[a] - grid[b]).abs() >= APART_S;
        let picked = pick(&gram, &gradient, MOST, apart);
        let (sizes, gain) = solve(&gram, &gradient, &picked)?;
        Some(Sketch {
            steps: picked.iter().map(|k| grid[*k]).zip(sizes).map(|(t, s)| (s, t)).collect(),
            gain,
        })
    }

    /// What a step of unit size at each instant does to the residual, after any re-fit of the baseline.
    fn directions(&self, family: &'static [Descriptor; MOST], grid: &[f64]) -> (DMatrix<f64>, DVector<f64>) {
        let base = self.plain.respond(&self.start.hypothesis, &self.start.values);
        let list: Vec<DVector<f64>> = grid
            .par_iter()
            .map(|t| {
                let specs = (family[0].parameters)(self.scale);
                let size = specs[HEAD].start;
                let h = with_effect(
                    &self.start.hypothesis,
                    &self.start.values,
                    &family[0],
                    self.scale,
                    Some(&[specs[0].start, specs[1].start, size, *t]),
                );
                let mut response = self.plain.respond(&h, &h.start);
                for (a, b) in response.iter_mut().flatten().flatten().zip(base.iter().flatten().flatten()) {
                    *a = (*a - b) / size;
                }
                self.plain.whiten(&response)
            })
            .collect();
        self.projector.project(self.start, &list)
    }

    /// The sketch with finer instants, simulated and fitted.
    fn simulate(
        &self,
        family: &'static [Descriptor; MOST],
        mut sketch: Sketch,
        mut spacing: f64,
    ) -> (&'static Descriptor, Fit) {
        while spacing > 0.08 {
            spacing /= 4.0;
            let mut grid: Vec<f64> = sketch
                .steps
                .iter()
                .flat_map(|(_, t)| (-4..=4).map(move |k| t + f64::from(k) * spacing))
                .collect();
            grid.sort_by(f64::total_cmp);
            grid.dedup_by(|a, b| *a - *b < 0.5 * spacing);
            match self.sketch(family, &grid) {
                Some(finer) if finer.gain >= sketch.gain => sketch = finer,
                _ => break,
            }
        }
        sketch.steps.sort_by(|a, b| a.1.total_cmp(&b.1));
        let effect = &family[sketch.steps.len() - 1];
        let values: Vec<f64> = (effect.parameters)(self.scale)[..HEAD]
            .iter()
            .map(|spec| spec.start)
            .chain(sketch.steps.iter().flat_map(|(s, t)| [*s, *t]))
            .collect();
        let h = with_effect(&self.start.hypothesis, &self.start.values, effect, self.scale, Some(&values));
        // Sizes first: an instant moves well only once its step has the right size.
        let (sized, at) = (hold_shapes(&h), h);
        let first = self.plain.fit(&sized, &[], 6);
        let mut h = at;
        for (free, start) in h.free.iter().zip(&mut h.start) {
            if let Some(k) = first.hypothesis.free.iter().position(|f| f.target == free.target) {
                *start = first.values[k];
            }
        }
        (effect, self.plain.fit(&h, &[], 10))
    }
}

/// The hypothesis with instants and rise time held where they start.
fn hold_shapes(h: &Hypothesis) -> Hypothesis {
    let mut held = h.clone();
    (held.free, held.start) = (Vec::new(), Vec::new());
    for (free, start) in h.free.iter().zip(&h.start) {
        match free.target {
            Target::Effect(i, j) if j == 1 || j >= HEAD && j % 2 == 1 => held.fixed.push((i, j, *start)),
            _ => {
                held.free.push(free.clone());
                held.start.push(*start);
            }
        }
    }
    held
}

/// Forward selection of steps that together explain most; each may still move when another comes.
fn pick(
    gram: &DMatrix<f64>,
    gradient: &DVector<f64>,
    most: usize,
    apart: impl Fn(usize, usize) -> bool,
) -> Vec<usize> {
    let gain_of = |list: &[usize]| solve(gram, gradient, list).map_or(0.0, |s| s.1);
    let mut picked: Vec<usize> = Vec::new();
    let mut first = 0.0;
    let mut so_far = 0.0;
    while picked.len() < most {
        let free = |k: &usize| picked.iter().all(|p| apart(*p, *k));
        let Some(fresh) = (0..gradient.len()).find(free) else { break };
        let mut trial = picked.clone();
        trial.push(fresh);
        let mut now = gain_of(&trial);
        for round in 0..3 {
            let slots = if round == 0 { trial.len() - 1..trial.len() } else { 0..trial.len() };
            for slot in slots {
                for k in 0..gradient.len() {
                    let old = trial[slot];
                    if (0..trial.len()).any(|other| other != slot && !apart(trial[other], k)) {
                        continue;
                    }
                    trial[slot] = k;
                    let gain = gain_of(&trial);
                    if gain > now * (1.0 + 1e-9) { now = gain } else { trial[slot] = old }
                }
            }
        }
        if picked.is_empty() {
            first = now;
        } else if now - so_far < LEAST_SHARE * first {
            break;
        }
        (picked, so_far) = (trial, now);
    }
    picked.sort_unstable();
    picked
}

/// Sizes of chosen directions, and the fall of the sum of squares that they bring together.
fn solve(gram: &DMatrix<f64>, gradient: &DVector<f64>, list: &[usize]) -> Option<(Vec<f64>, f64)> {
    let n = list.len();
    let mut a = DMatrix::from_fn(n, n, |i, j| gram[(list[i], list[j])]);
    for i in 0..n {
        a[(i, i)] += 1e-9 * a[(i, i)] + 1e-300;
    }
    let b = DVector::from_fn(n, |i, _| gradient[list[i]]);
    let x = a.cholesky()?.solve(&b);
    let gain = x.dot(&b);
    Some((x.iter().copied().collect(), gain))
}

/// Fits again under the present noise and drops steps that do not stand far out of their doubt.
fn prune(search: &Search, effect: &'static Descriptor, fit: &Fit) -> (&'static Descriptor, Fit) {
    let mut fit = search.again(fit);
    let mut effect = effect;
    loop {
        let mut probe = fit.clone();
        let std = Projector::new(&search.problem, &mut probe).std_errors();
        let heights: Vec<f64> = fit
            .hypothesis
            .free
            .iter()
            .enumerate()
            .filter(|(_, f)| matches!(f.target, Target::Effect(_, j) if j >= HEAD && j % 2 == 0))
            .map(|(k, _)| (fit.values[k] / std[k].max(1e-300)).powi(2))
            .collect();
        let top = heights.iter().copied().fold(0.0, f64::max);
        let Some(weakest) = (0..heights.len()).min_by(|a, b| heights[*a].total_cmp(&heights[*b])) else {
            return (effect, fit);
        };
        if heights.len() < 2 || heights[weakest] > rules::BELIEVE.max(LEAST_SHARE * top) {
            return (effect, fit);
        }
        let Some((_, values)) = members(&search.problem, &fit).into_iter().next_back() else {
            return (effect, fit);
        };
        let mut values = values;
        values.drain(HEAD + 2 * weakest..HEAD + 2 + 2 * weakest);
        let Some(smaller) = FAMILIES
            .iter()
            .find_map(|family| family.iter().position(|d| d.id == effect.id).map(|k| &family[k - 1]))
        else {
            return (effect, fit);
        };
        effect = smaller;
        let (bare, _) = crate::baseline::recompose(&fit, &[], &search.scale);
        let h = with_effect(&bare, &bare.start, effect, &search.scale, Some(&values));
        fit = search.problem.fit(&h, &[], 6);
    }
}

/// Share of the error above the noise that the changes take away on rows left out of their fit.
fn held(problem: &Problem, found: &Found) -> f64 {
    let rows = held_out_rows(problem, &[&found.fit], None);
    let (before, after) = trained(problem, &rows, &found.before, &found.fit);
    let floor = errors::noise_floor(problem, &after);
    errors::held_out(problem, &rows, &before, &after, &floor, 1).excess_error_removed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_add_up_in_time() {
        let steps = Steps::new(&[50.0, 0.05, 2.0, 10.0, -1.5, 20.0]);
        for (t, level) in [(5.0, 0.0), (15.0, 2.0), (25.0, 0.5)] {
            assert!((steps.level(t) - level).abs() < 1e-9, "{t}");
        }
    }

    #[test]
    fn picks_the_directions_that_made_the_data() {
        // Steps at 20 instants of a ramp-free record of 200 rows; 3 and 14 made it.
        let column = |k: usize| DVector::from_fn(200, |i, _| if i > 10 * k { 1.0 } else { 0.0 });
        let list: Vec<DVector<f64>> = (1..20).map(column).collect();
        let data = &list[2] * 3.0 - &list[13] * 2.0;
        let d = DMatrix::from_columns(&list);
        let picked = pick(&d.tr_mul(&d), &d.tr_mul(&data), MOST, |a, b| a != b);
        assert_eq!(picked, [2, 13]);
    }
}
