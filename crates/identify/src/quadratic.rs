//! The criterion about one point, with the response taken as linear in the parameters: cheap to minimise,
//! however often the noise is learnt anew.

use nalgebra::{DMatrix, DVector, DVectorView};

use crate::hypothesis::Free;
use crate::noise::{Criterion, Floor, Noise};
use crate::spectrum::{Band, Spectrum};
use crate::step::bounded_step;

/// Products of residual and derivative by band; parameters in units of their priors' standard deviations.
pub struct Quadratic<'a> {
    spectrum: &'a Spectrum,
    criterion: &'a Criterion,
    /// Sum of squares of the residual.
    residual: Vec<f64>,
    /// Derivative times residual.
    slope: Vec<DVector<f64>>,
    /// Derivative times derivative.
    curvature: Vec<DMatrix<f64>>,
}

/// Where the criterion is least, as far as the linear response tells.
pub struct Minimum {
    /// Step from the point, in prior standard deviations.
    pub step: DVector<f64>,
    /// Misfit there (see [`Noise::misfit`]).
    pub misfit: f64,
    /// Squared distance from the priors' means there.
    pub penalty: f64,
    /// Mean square of what is left, by band.
    pub powers: Vec<f64>,
    /// Noise there.
    pub noise: Noise,
}

/// Rounds of learning the noise and stepping.
const ROUNDS: usize = 40;
/// Rounds end where the merit falls by less than this.
const ENOUGH: f64 = 0.03;

fn lines_of<'v>(all: &'v DVector<f64>, band: &Band) -> DVectorView<'v, f64> {
    all.rows(band.lines.start, band.lines.len())
}

impl<'a> Quadratic<'a> {
    /// From a residual (measured less simulated) and the response's derivatives, all as lines.
    pub fn new(
        spectrum: &'a Spectrum,
        criterion: &'a Criterion,
        residual: &DVector<f64>,
        columns: &[&DVector<f64>],
        free: &[Free],
    ) -> Self {
        Self::extended(spectrum, criterion, residual, columns, free, &[])
    }

    /// The same where the products of the first columns are known (see [`Quadratic::curvature`]).
    pub fn extended(
        spectrum: &'a Spectrum,
        criterion: &'a Criterion,
        residual: &DVector<f64>,
        columns: &[&DVector<f64>],
        free: &[Free],
        known: &[DMatrix<f64>],
    ) -> Self {
        let n = columns.len();
        let (mut squares, mut slope, mut curvature) = (Vec::new(), Vec::new(), Vec::new());
        for (k, band) in spectrum.bands.iter().enumerate() {
            // Several sums at once: one that waits for its last addend takes eight times as long.
            let r = lines_of(residual, band);
            squares.push(r.dot(&r));
            let mut gradient = DVector::zeros(n);
            let mut gram = DMatrix::zeros(n, n);
            let before = known.get(k).map_or(0, DMatrix::nrows);
            if let Some(known) = known.get(k) {
                gram.view_mut((0, 0), (before, before)).copy_from(known);
            }
            for i in 0..n {
                let a = lines_of(columns[i], band);
                gradient[i] = free[i].sigma * a.dot(&r);
                if i < before {
                    continue;
                }
                for j in 0..=i {
                    let product = free[i].sigma * free[j].sigma * a.dot(&lines_of(columns[j], band));
                    gram[(i, j)] = product;
                    gram[(j, i)] = product;
                }
            }
            slope.push(gradient);
            curvature.push(gram);
        }
        Self { spectrum, criterion, residual: squares, slope, curvature }
    }

    /// The same with the last parameters' priors wider or narrower by a factor.
    pub fn scaled(&self, from: usize, factor: f64) -> Self {
        let mut slope = self.slope.clone();
        let mut curvature = self.curvature.clone();
        for (s, c) in slope.iter_mut().zip(&mut curvature) {
            for k in from..s.len() {
                s[k] *= factor;
                c.row_mut(k).scale_mut(factor);
                c.column_mut(k).scale_mut(factor);
            }
        }
        Self { residual: self.residual.clone(), slope, curvature, ..*self }
    }

    /// Products of the derivatives by band.
    pub fn curvature(&self) -> &[DMatrix<f64>] {
        &self.curvature
    }

    /// Mean squares by band after a step.
    pub fn powers(&self, step: &DVector<f64>) -> Vec<f64> {
        self.spectrum
            .bands
            .iter()
            .enumerate()
            .map(|(b, band)| {
                let sum = self.residual[b] - 2.0 * step.dot(&self.slope[b])
                    + step.dot(&(&self.curvature[b] * step));
                (sum / band.lines.len() as f64).max(0.0)
            })
            .collect()
    }

    /// The information that the data hold, in units of the priors': the weighted normal matrix.
    pub fn information(&self, noise: &Noise) -> DMatrix<f64> {
        let n = self.slope.first().map_or(0, DVector::len);
        let mut sum = DMatrix::zeros(n, n);
        for (gram, weight) in self.curvature.iter().zip(&noise.weight) {
            sum += gram * *weight;
        }
        sum
    }

    /// Laplace's price of the numbers under a noise: `ln det(I + information)`.
    pub fn price(&self, noise: &Noise) -> f64 {
        let information = self.information(noise);
        let n = information.nrows();
        (information + DMatrix::identity(n, n))
            .cholesky()
            .map_or(f64::INFINITY, |c| 2.0 * c.l_dirty().diagonal().iter().map(|d| d.ln()).sum::<f64>())
    }

    /// What a minimum costs: misfit, priors, and the price of the numbers there.
    pub fn cost(&self, there: &Minimum) -> f64 {
        there.misfit + there.penalty + self.price(&there.noise)
    }

    /// Minimises misfit and priors from the point, where the parameters have these `values`; each step is
    /// damped by `damping`.
    pub fn minimise(&self, floor: &Floor, free: &[Free], values: &[f64], damping: f64) -> Minimum {
        let n = free.len();
        let z0 = DVector::from_fn(n, |k, _| (values[k] - free[k].mean) / free[k].sigma);
        let at = |step: &DVector<f64>| {
            let powers = self.powers(step);
            let noise = Noise::of(&self.spectrum.bands, &powers, floor, self.criterion);
            let penalty = (&z0 + step).norm_squared();
            (powers, noise, penalty)
        };
        let mut step = DVector::zeros(n);
        let (mut powers, mut noise, mut penalty) = at(&step);
        // What holds the whole step back, however many rounds it takes.
        let drag = self.information(&noise).diagonal().add_scalar(1.0) * damping;
        let held_back = |step: &DVector<f64>| step.component_mul(step).dot(&drag);
        let mut merit = noise.misfit + penalty;
        for _ in 0..ROUNDS {
            let normal = self.information(&noise) + DMatrix::from_diagonal(&drag.add_scalar(1.0));
            let mut gradient = -(&z0 + &step) - drag.component_mul(&step);
            for ((slope, curvature), weight) in self.slope.iter().zip(&self.curvature).zip(&noise.weight) {
                gradient += (slope - curvature * &step) * *weight;
            }
            let room = |k: usize| {
                let (f, at) = (&free[k], free[k].mean + (z0[k] + step[k]) * free[k].sigma);
                ((f.low - at) / f.sigma, (f.high - at) / f.sigma)
            };
            let more = bounded_step(&normal, &gradient, room);
            let better = [1.0, 0.4, 0.16, 0.06].into_iter().find_map(|part| {
                let trial = &step + &more * part;
                let found = at(&trial);
                let merit_there = found.1.misfit + found.2 + held_back(&trial);
                (merit_there < merit).then_some((trial, found, merit_there))
            });
            let Some((trial, found, lower)) = better else { break };
            let gain = merit - lower;
            step = trial;
            merit = lower;
            (powers, noise, penalty) = found;
            if gain < ENOUGH {
                break;
            }
        }
        Minimum { step, misfit: noise.misfit, penalty, powers, noise }
    }
}
