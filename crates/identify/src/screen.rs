//! A cheap look at every effect: how far would it go, to first order, in explaining what is left?
//!
//! A score test. The baseline's parameters stay free: each effect's direction is projected off
//! everything a re-fit could do. A screen only, never the judge: what scores well is simulated
//! and fitted.

use kort_thruster::effects::{Descriptor, Scale, Stretch};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;

use crate::baseline::with_effect;
use crate::fit::{Fit, Problem, Stack, Target, difference};
use crate::together::groups;

/// An effect's first-order promise.
#[derive(Clone)]
pub struct Screened {
    /// The effect.
    pub effect: &'static Descriptor,
    /// Values from which a fit should start.
    pub start: Vec<f64>,
    /// Values at which the effect was simulated for the screen.
    pub origin: Vec<f64>,
    /// Expected fall of the sum of squares.
    pub gain: f64,
    /// Fall of the sum of squares at the simulated values themselves.
    pub plain: f64,
    /// Degrees of freedom behind that gain.
    pub directions: usize,
    /// Upper bound of its response: root mean square over full scale, largest channel.
    pub size: f64,
}

/// The inverse of the current fit's normal matrix, and its gradient.
pub struct Projector {
    inverse: DMatrix<f64>,
    gradient: DVector<f64>,
    scale: DVector<f64>,
    jacobian: DMatrix<f64>,
}

impl Projector {
    /// From a fit, with its priors; refreshes the fit's derivative.
    pub fn new(problem: &Problem, fit: &mut Fit) -> Self {
        let jacobian = problem.jacobian(fit);
        let n = fit.values.len();
        let scale = DVector::from_iterator(n, fit.hypothesis.free.iter().map(|f| f.size));
        let mut scaled = jacobian.clone();
        for k in 0..n {
            scaled.column_mut(k).scale_mut(scale[k]);
        }
        let mut normal = scaled.transpose() * &scaled;
        let mut gradient = scaled.tr_mul(&fit.residual);
        for (k, free) in fit.hypothesis.free.iter().enumerate() {
            if let Some((mean, sigma)) = free.prior {
                let s = scale[k] / sigma;
                normal[(k, k)] += s * s;
                gradient[k] += s * (mean - fit.values[k]) / sigma;
            }
            normal[(k, k)] *= 1.0 + 1e-9;
            normal[(k, k)] += 1e-9;
        }
        // Parameters at a bound cannot move.
        for k in 0..n {
            if fit.at_bound[k] {
                for j in 0..n {
                    normal[(k, j)] = 0.0;
                    normal[(j, k)] = 0.0;
                }
                normal[(k, k)] = 1.0;
                gradient[k] = 0.0;
            }
        }
        let inverse = normal.clone().cholesky().map_or_else(|| DMatrix::zeros(n, n), |c| c.inverse());
        Self { inverse, gradient, scale, jacobian }
    }

    /// Standard error of every free parameter; zero for one at its bound.
    pub fn std_errors(&self) -> Vec<f64> {
        (0..self.scale.len()).map(|k| self.inverse[(k, k)].max(0.0).sqrt() * self.scale[k]).collect()
    }

    /// Covariance of the free parameters.
    pub fn covariance(&self) -> DMatrix<f64> {
        let n = self.scale.len();
        DMatrix::from_fn(n, n, |i, j| self.inverse[(i, j)] * self.scale[i] * self.scale[j])
    }

    /// Gram matrix and gradient of directions after the projection.
    pub fn project(&self, fit: &Fit, directions: &[DVector<f64>]) -> (DMatrix<f64>, DVector<f64>) {
        let d = DMatrix::from_columns(directions);
        let mut cross = self.jacobian.transpose() * &d;
        for (k, s) in self.scale.iter().enumerate() {
            let factor = if fit.at_bound[k] { 0.0 } else { *s };
            cross.row_mut(k).scale_mut(factor);
        }
        let solved = &self.inverse * &cross;
        let gram = d.transpose() * &d - cross.tr_mul(&solved);
        let gradient = d.tr_mul(&fit.residual) - solved.tr_mul(&self.gradient);
        (gram, gradient)
    }
}

/// Responses to the starts of effects, one stack a strength; they change little while further
/// effects are found, so a search computes them once.
pub type Known = HashMap<(&'static str, usize), Arc<Vec<Stack>>>;

/// Screens effects on top of a fit, best first.
pub fn screen(
    problem: &Problem,
    fit: &mut Fit,
    effects: &[&'static Descriptor],
    scale: &Scale,
    known: &mut Known,
) -> Vec<Screened> {
    let projector = Projector::new(problem, fit);
    let fit = &*fit;
    let starts: Vec<(&'static Descriptor, usize, Vec<f64>)> = effects
        .iter()
        .flat_map(|effect| {
            let default: Vec<f64> = (effect.parameters)(scale).iter().map(|s| s.start).collect();
            std::iter::once(default)
                .chain((effect.starts)(scale))
                .enumerate()
                .map(|(k, start)| (*effect, k, start))
                .collect::<Vec<_>>()
        })
        .collect();
    let base = problem.respond(&fit.hypothesis, &fit.values);
    let fresh: Vec<_> = starts
        .par_iter()
        .filter(|(effect, k, _)| !known.contains_key(&(effect.id, *k)))
        .map(|(effect, k, start)| {
            ((effect.id, *k), Arc::new(respond_to(problem, fit, &base, effect, start, scale)))
        })
        .collect();
    known.extend(fresh);
    let known = &*known;
    let mut found: Vec<Screened> = starts
        .into_par_iter()
        .filter_map(|(effect, k, start)| {
            score(problem, fit, &projector, &known[&(effect.id, k)], effect, start, scale)
        })
        .collect();
    found.sort_by(|a, b| b.gain.total_cmp(&a.gain).then(a.effect.id.cmp(b.effect.id)));
    found
}

/// What changes when one strength of an effect is at its start and the others are zero, for
/// every strength.
fn respond_to(
    problem: &Problem,
    fit: &Fit,
    base: &Stack,
    effect: &'static Descriptor,
    start: &[f64],
    scale: &Scale,
) -> Vec<Stack> {
    let specs = (effect.parameters)(scale);
    let strengths: Vec<usize> = (0..specs.len()).filter(|j| !specs[*j].shape).collect();
    let hypothesis = with_effect(&fit.hypothesis, &fit.values, effect, scale, Some(start));
    // Place of each of the effect's values among the free parameters (fixed ones have none).
    let slot = hypothesis.effects.len() - 1;
    let place = |j: usize| hypothesis.free.iter().position(|f| f.target == Target::Effect(slot, j));
    let always = Stretch { from_s: 0.0, length_s: 0.0, period_s: 0.0 };
    let (some, all): (Vec<usize>, Vec<usize>) =
        (0..strengths.len()).partition(|k| specs[strengths[*k]].acts.is_some());
    let together = groups(some.iter().filter_map(|k| Some((*k, specs[strengths[*k]].acts?))).collect());
    let mut responses: Vec<Stack> = vec![Stack::new(); strengths.len()];
    for group in all.into_iter().map(|k| vec![(k, always)]).chain(together) {
        let mut values = hypothesis.start.clone();
        for (_, j) in strengths.iter().enumerate().filter(|(k, _)| group.iter().all(|m| m.0 != *k)) {
            if let Some(free) = place(*j) {
                values[free] = 0.0_f64.clamp(specs[*j].low, specs[*j].high);
            }
        }
        let change = difference(problem.respond(&hypothesis, &values), base);
        for ((k, _), share) in group.iter().zip(problem.shares(change, &group)) {
            responses[*k] = share;
        }
    }
    responses
}

fn score(
    problem: &Problem,
    fit: &Fit,
    projector: &Projector,
    responses: &[Stack],
    effect: &'static Descriptor,
    start: Vec<f64>,
    scale: &Scale,
) -> Option<Screened> {
    let specs = (effect.parameters)(scale);
    let mut strengths: Vec<usize> = (0..specs.len()).filter(|j| !specs[*j].shape).collect();
    let sizes: Vec<f64> = responses.iter().map(|r| problem.size(r)).collect();
    let directions: Vec<DVector<f64>> = responses.iter().map(|r| problem.whiten(r)).collect();
    if directions.is_empty() || directions.iter().any(|d| !d.iter().all(|v| v.is_finite())) {
        return None;
    }
    let (gram, gradient) = projector.project(fit, &directions);
    let plain = 2.0 * gradient.sum() - gram.sum();
    let mut active: Vec<usize> = (0..strengths.len())
        .filter(|k| gram[(*k, *k)] > 1e-6 * directions[*k].norm_squared().max(1e-9))
        .collect();
    loop {
        if active.is_empty() {
            return None;
        }
        let n = active.len();
        let g = DMatrix::from_fn(n, n, |i, j| {
            gram[(active[i], active[j])] * if i == j { 1.0 + 1e-6 } else { 1.0 }
        });
        let b = DVector::from_fn(n, |i, _| gradient[active[i]]);
        let a = g.cholesky()?.solve(&b);
        // A strength pushed past its bound is left out, the worst one first.
        let past = (0..n).filter(|i| {
            let spec = specs[strengths[active[*i]]];
            let wanted = a[*i] * start[strengths[active[*i]]];
            wanted < spec.low - 1e-12 && spec.low >= 0.0
        });
        if let Some(worst) = past.min_by(|i, j| (a[*i] * b[*i]).abs().total_cmp(&(a[*j] * b[*j]).abs())) {
            active.remove(worst);
            continue;
        }
        let gain = a.dot(&b);
        let size = (0..n).map(|i| a[i].abs() * sizes[active[i]]).sum();
        let origin = start.clone();
        let mut from = start;
        for (k, s) in strengths.drain(..).enumerate() {
            let factor = active.iter().position(|i| *i == k).map_or(0.0, |i| a[i]);
            let value = factor * from[s];
            // The first-order amplitude may be far off: stay within a few starts.
            let reach = 8.0 * from[s].abs();
            from[s] = value.clamp(-reach, reach).clamp(specs[s].low, specs[s].high);
        }
        return Some(Screened { effect, start: from, origin, gain, plain, directions: n, size });
    }
}
