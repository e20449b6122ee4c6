//! Output-error identification: simulate, compare with every channel, improve the parameters.
//!
//! Gauss-Newton with Levenberg-Marquardt damping on whitened residuals, stated values as priors
//! (sigma = half the stated tolerance), bounds by freezing. The derivative is exact: the plant runs on
//! numbers that carry it along, several free parameters a simulation.

use kort_thruster::dual::{Dual, LANES};
use kort_thruster::effects::{Descriptor, Stretch};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Sensed, simulate_each};
use kort_thruster::real::Real;
use kort_thruster::rig::Rig;
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

use crate::data::Prepared;
use crate::equations::Equations;
use crate::noise::Whitener;
use crate::step::damped_step;
use crate::together::{groups, last_acting};

/// First damping of a step. Where nothing absolute is measured, all forces and masses may scale together,
/// held by what is stated alone: a damping that outweighs that would stop a fit anywhere in this valley.
const DAMPING: f64 = 1e-8;
const LEAST_DAMPING: f64 = 1e-12;

/// A fit ends when a step lowers the sum of whitened squares by less than this: far below what
/// any decision turns on.
const ENOUGH: f64 = 0.3;

/// What a free parameter changes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Target {
    /// A parameter of the baseline.
    Base(Parameter),
    /// A value of an effect: which effect of the hypothesis, which value.
    Effect(usize, usize),
}

/// A free parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct Free {
    /// What it changes.
    pub target: Target,
    /// Name for reports.
    pub name: &'static str,
    /// Unit for reports.
    pub unit: &'static str,
    /// Prior mean and standard deviation, if stated.
    pub prior: Option<(f64, f64)>,
    /// Bounds.
    pub low: f64,
    /// Bounds.
    pub high: f64,
    /// A typical size.
    pub size: f64,
    /// When it acts, if only for a while.
    pub acts: Option<Stretch>,
}

/// A baseline model with effects added to it.
#[derive(Clone)]
pub struct Hypothesis {
    /// Effects in order.
    pub effects: Vec<&'static Descriptor>,
    /// Free parameters: baseline first, then the effects' in order.
    pub free: Vec<Free>,
    /// Values where a fit starts.
    pub start: Vec<f64>,
    /// Values of effects that do not move: effect, value's place, value.
    pub fixed: Vec<(usize, usize, f64)>,
}

/// Everything that stays the same while hypotheses are compared.
#[derive(Clone)]
pub struct Problem<'a> {
    /// Baseline model.
    pub model: ModelName,
    /// The stated rig.
    pub rig: &'a Rig,
    /// Stated parameters.
    pub stated: Parameters,
    /// Recordings.
    pub recordings: Vec<Prepared>,
    /// Whiteners, one a recording and channel.
    pub whiteners: Vec<Vec<Whitener>>,
    /// Rows left out of every comparison (flagged data, run-in), by recording.
    pub masked: Vec<Vec<bool>>,
}

/// Residuals and responses of all channels: `[recording][channel][sample]`.
pub type Stack = Vec<Vec<Vec<f64>>>;

/// Derivative columns of a fit, one a free parameter, as far as they are known.
pub type Columns = Vec<Option<Arc<Stack>>>;

/// A fitted hypothesis.
#[derive(Clone)]
pub struct Fit {
    /// The hypothesis.
    pub hypothesis: Hypothesis,
    /// Values of its free parameters.
    pub values: Vec<f64>,
    /// Sum of squares of the whitened residual over the samples in use.
    pub chi2: f64,
    /// Sum of squares of the priors' residuals.
    pub penalty: f64,
    /// Whitened residual, all channels joined.
    pub residual: DVector<f64>,
    /// Derivative of the response by free parameter, where it is known; perhaps from nearby.
    pub columns: Columns,
    /// Parameters held at a bound.
    pub at_bound: Vec<bool>,
}

impl Fit {
    /// The hypothesis, to start from where this fit ended.
    pub fn resume(&self) -> Hypothesis {
        Hypothesis { start: self.values.clone(), ..self.hypothesis.clone() }
    }
}

impl<'a> Problem<'a> {
    /// The response of a hypothesis at values of its free parameters.
    pub fn respond(&self, hypothesis: &Hypothesis, values: &[f64]) -> Stack {
        let [stack] = self.stacks(hypothesis, values, |v| [v]);
        stack
    }

    /// Simulated rows of all recordings.
    pub fn rows(&self, hypothesis: &Hypothesis, values: &[f64]) -> Vec<Vec<Sensed>> {
        let mut all: Vec<Vec<Sensed>> = vec![Vec::new(); self.recordings.len()];
        self.simulate(hypothesis, values, |r, _, sensed| all[r].push(*sensed));
        all
    }

    /// Simulates all recordings; what the sensors show goes on by recording and row.
    fn simulate<T: Real>(
        &self,
        hypothesis: &Hypothesis,
        values: &[T],
        mut show: impl FnMut(usize, usize, &Sensed<T>),
    ) {
        let (parameters, effects) = self.assemble(hypothesis, values);
        let hooked: Vec<(&Descriptor, &[T])> =
            hypothesis.effects.iter().copied().zip(effects.iter().map(Vec::as_slice)).collect();
        for (r, recording) in self.recordings.iter().enumerate() {
            let mut plant = Plant::new(self.model, self.rig, &parameters, &hooked, recording.tick_s);
            let [speed, flow, current, angle] = recording.start;
            plant.start(recording.time_s[0], speed, flow, current, angle);
            simulate_each(&mut plant, &recording.stimulus, |row, sensed| show(r, row, sensed));
        }
    }

    /// Some numbers of every sample of every channel, a stack each.
    fn stacks<T: Real, const K: usize>(
        &self,
        hypothesis: &Hypothesis,
        values: &[T],
        numbers: impl Fn(T) -> [f64; K],
    ) -> [Stack; K] {
        let room = |r: &Prepared| r.channels.iter().map(|c| Vec::with_capacity(c.rows.len())).collect();
        let mut stacks: [Stack; K] = std::array::from_fn(|_| self.recordings.iter().map(room).collect());
        self.simulate(hypothesis, values, |r, row, sensed| {
            for (c, channel) in self.recordings[r].channels.iter().enumerate() {
                // Samples come in order of their rows; a row may have none.
                if channel.rows.get(stacks[0][r][c].len()) == Some(&row) {
                    let all = numbers(channel.response.of(sensed));
                    stacks.iter_mut().zip(all).for_each(|(stack, one)| stack[r][c].push(one));
                }
            }
        });
        stacks
    }

    /// Parameters and effect values from the vector of free ones.
    pub fn assemble<T: Real>(&self, hypothesis: &Hypothesis, values: &[T]) -> (Parameters<T>, Vec<Vec<T>>) {
        let mut parameters = Parameters::lift(&self.stated);
        let mut effects: Vec<Vec<T>> = vec![Vec::new(); hypothesis.effects.len()];
        let mut put = |i: usize, j: usize, value: T| {
            if effects[i].len() <= j {
                effects[i].resize(j + 1, T::ZERO);
            }
            effects[i][j] = value;
        };
        for (free, value) in hypothesis.free.iter().zip(values) {
            match free.target {
                Target::Base(p) => parameters.set(p, *value),
                Target::Effect(i, j) => put(i, j, *value),
            }
        }
        for (i, j, value) in &hypothesis.fixed {
            put(*i, *j, T::from(*value));
        }
        (parameters, effects)
    }

    /// Measured minus simulated.
    pub fn residual(&self, response: &Stack) -> Stack {
        self.recordings
            .iter()
            .zip(response)
            .map(|(recording, channels)| {
                recording
                    .channels
                    .iter()
                    .zip(channels)
                    .map(|(c, simulated)| c.values.iter().zip(simulated).map(|(m, s)| m - s).collect())
                    .collect()
            })
            .collect()
    }

    /// Root mean square over full scale, on the channel where that is largest.
    pub fn size(&self, stack: &Stack) -> f64 {
        let mut size = 0.0_f64;
        for (recording, channels) in self.recordings.iter().zip(stack) {
            for (channel, samples) in recording.channels.iter().zip(channels) {
                let sum: f64 = samples.iter().map(|v| v * v).sum();
                size = size.max((sum / samples.len() as f64).sqrt() / channel.full_scale);
            }
        }
        size
    }

    /// Whitens and joins a stack; masked samples become zero before whitening.
    pub fn whiten(&self, stack: &Stack) -> DVector<f64> {
        let mut joined = Vec::new();
        for (r, channels) in stack.iter().enumerate() {
            for (c, values) in channels.iter().enumerate() {
                let rows = &self.recordings[r].channels[c].rows;
                let masked: Vec<f64> = values
                    .iter()
                    .zip(rows)
                    .map(|(v, row)| if self.masked[r][*row] { 0.0 } else { *v })
                    .collect();
                joined.extend(self.whiteners[r][c].apply(&masked));
            }
        }
        DVector::from_vec(joined)
    }

    /// Derivatives of the response to free parameters, by one simulation: a lane a group of parameters
    /// that do not meet in time.
    fn columns(
        &self,
        hypothesis: &Hypothesis,
        values: &[f64],
        groups: &[Vec<(usize, Stretch)>],
    ) -> Vec<(usize, Stack)> {
        let mut moved: Vec<Dual> = values.iter().map(|v| Dual::from(*v)).collect();
        for (lane, group) in groups.iter().enumerate() {
            for (k, _) in group {
                moved[*k] = Dual::parameter(values[*k], lane);
            }
        }
        let changes = self.stacks(hypothesis, &moved, Dual::slopes);
        let one = |(group, change): (&Vec<(usize, Stretch)>, Stack)| {
            group.iter().map(|(k, _)| *k).zip(self.shares(change, group)).collect::<Vec<_>>()
        };
        groups.iter().zip(changes).flat_map(one).collect()
    }

    /// Splits the change that a group made together: each sample to the member that acted last.
    pub fn shares(&self, change: Stack, group: &[(usize, Stretch)]) -> Vec<Stack> {
        if group.len() == 1 {
            return vec![change];
        }
        let mut shares: Vec<Stack> =
            vec![
                change.iter().map(|r| r.iter().map(|c| vec![0.0; c.len()]).collect()).collect();
                group.len()
            ];
        for (r, recording) in self.recordings.iter().enumerate() {
            for (c, channel) in recording.channels.iter().enumerate() {
                for (i, row) in channel.rows.iter().enumerate() {
                    let owner = last_acting(group, recording.time_s[*row]);
                    shares[owner][r][c][i] = change[r][c][i];
                }
            }
        }
        shares
    }

    /// Computes the columns that are missing.
    fn complete(&self, hypothesis: &Hypothesis, values: &[f64], columns: &mut [Option<Arc<Stack>>]) {
        let always = Stretch { from_s: 0.0, length_s: 0.0, period_s: 0.0 };
        let missing = |k: &usize| columns[*k].is_none();
        let (some, all): (Vec<usize>, Vec<usize>) =
            (0..columns.len()).filter(missing).partition(|k| hypothesis.free[*k].acts.is_some());
        let tasks: Vec<Vec<(usize, Stretch)>> = all
            .into_iter()
            .map(|k| vec![(k, always)])
            .chain(groups(some.iter().filter_map(|k| Some((*k, hypothesis.free[*k].acts?))).collect()))
            .collect();
        let done: Vec<(usize, Stack)> = tasks
            .par_chunks(LANES)
            .flat_map_iter(|groups| self.columns(hypothesis, values, groups))
            .collect();
        for (k, stack) in done {
            columns[k] = Some(Arc::new(stack));
        }
    }

    /// The whitened derivative, one column a free parameter.
    fn whiten_columns(&self, columns: &[Option<Arc<Stack>>], samples: usize) -> DMatrix<f64> {
        let whitened: Vec<DVector<f64>> = columns.par_iter().flatten().map(|c| self.whiten(c)).collect();
        if whitened.is_empty() { DMatrix::zeros(samples, 0) } else { DMatrix::from_columns(&whitened) }
    }

    /// Fits a hypothesis from its start. `known` holds derivative columns from a nearby fit (by
    /// free parameter); they are used until a step falls short of what they promise, which saves
    /// most simulations while hypotheses are compared.
    pub fn fit(&self, hypothesis: &Hypothesis, known: &[Option<Arc<Stack>>], iterations: usize) -> Fit {
        let free = &hypothesis.free;
        let n = free.len();
        let mut values = hypothesis.start.clone();
        let mut residual = self.whiten(&self.residual(&self.respond(hypothesis, &values)));
        let mut cost = residual.norm_squared() + penalty(free, &values);
        let iterations = if cost.is_finite() { iterations } else { 0 };
        let mut damping = DAMPING;
        let mut columns = known.to_vec();
        columns.resize(n, None);
        let mut fresh = columns.iter().all(Option::is_none);
        let mut equations = Equations::new(free);
        for _ in 0..iterations {
            self.complete(hypothesis, &values, &mut columns);
            equations.follow(self, &columns, residual.len());
            let gradient = equations.gradient(&residual, &values);
            let (normal, size) = (&equations.normal, &equations.size);
            let mut outcome = None;
            for _ in 0..6 {
                let step = damped_step(normal, &gradient, damping, free, &values);
                let trial: Vec<f64> = (0..n)
                    .map(|k| (values[k] + step[k] * size[k]).clamp(free[k].low, free[k].high))
                    .collect();
                let trial_residual = self.whiten(&self.residual(&self.respond(hypothesis, &trial)));
                let trial_cost = trial_residual.norm_squared() + penalty(free, &trial);
                if trial_cost < cost {
                    let promised = 2.0 * gradient.dot(&step) - (normal * &step).dot(&step);
                    outcome = Some((cost - trial_cost, promised));
                    (values, residual, cost) = (trial, trial_residual, trial_cost);
                    damping = (damping * 0.1).max(LEAST_DAMPING);
                    break;
                }
                if !fresh {
                    break;
                }
                damping *= 100.0;
            }
            match outcome {
                Some((gain, promised)) if gain > 0.75 * promised => {
                    if gain < ENOUGH {
                        break;
                    }
                    fresh = false;
                }
                // The derivative no longer tells: refresh the effects' first, then everything.
                Some((gain, promised)) if gain > 0.3 * promised && !fresh && gain > ENOUGH => {
                    for k in 0..n {
                        if matches!(free[k].target, Target::Effect(..)) {
                            columns[k] = None;
                        }
                    }
                }
                other => {
                    if fresh && other.is_none_or(|(gain, _)| gain < ENOUGH) {
                        break;
                    }
                    columns.fill(None);
                    fresh = true;
                }
            }
        }
        Fit {
            at_bound: (0..n).map(|k| near_bound(&free[k], values[k])).collect(),
            hypothesis: hypothesis.clone(),
            chi2: residual.norm_squared(),
            penalty: penalty(free, &values),
            values,
            residual,
            columns,
        }
    }

    /// A fit taken further under the present noise, edges and masks.
    pub fn again(&self, fit: &Fit, iterations: usize) -> Fit {
        self.fit(&fit.resume(), &fit.columns, iterations)
    }

    /// Residual of a fit on every row.
    pub fn residual_of(&self, fit: &Fit) -> Stack {
        self.residual(&self.respond(&fit.hypothesis, &fit.values))
    }

    /// The problem without some rows: its training part.
    pub fn without(&self, held: &[Vec<bool>]) -> Self {
        let mut training = self.clone();
        for (mask, held) in training.masked.iter_mut().zip(held) {
            mask.iter_mut().zip(held).for_each(|(m, h)| *m |= *h);
        }
        training
    }

    /// The whitened derivative at a fit, every column computed anew.
    pub fn jacobian(&self, fit: &mut Fit) -> DMatrix<f64> {
        fit.columns = vec![None; fit.values.len()];
        self.complete(&fit.hypothesis, &fit.values, &mut fit.columns);
        self.whiten_columns(&fit.columns, fit.residual.len())
    }
}

/// One response less another.
pub fn difference(mut response: Stack, base: &Stack) -> Stack {
    for (channels, base) in response.iter_mut().zip(base) {
        for (samples, base) in channels.iter_mut().zip(base) {
            samples.iter_mut().zip(base).for_each(|(v, b)| *v -= b);
        }
    }
    response
}

/// Sum of squares of the priors' residuals.
pub fn penalty(free: &[Free], values: &[f64]) -> f64 {
    free.iter()
        .zip(values)
        .filter_map(|(f, v)| f.prior.map(|(mean, sigma)| ((v - mean) / sigma).powi(2)))
        .sum()
}

fn near_bound(free: &Free, value: f64) -> bool {
    let slack = 1e-6 * (free.high - free.low);
    value <= free.low + slack || value >= free.high - slack
}
