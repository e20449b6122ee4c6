//! The criterion about one point, with the response taken as linear in the parameters: cheap to minimise,
//! however often the noise is learnt anew.

#[cfg(test)]
mod tests;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector, DVectorView};

use crate::hypothesis::Free;
use crate::noise::{Criterion, Floor, Noise};
use crate::spectrum::{Band, Spectrum};
use crate::step::bounded_step;

/// Products of residual and derivative by band; parameters in units of their priors' standard deviations.
///
/// A derivative that stands again beside another residual, or beside other derivatives, has most of its products already:
/// they are not summed again.
pub struct Quadratic<'a> {
    spectrum: &'a Spectrum,
    criterion: &'a Criterion,
    /// What the products are of, where they may serve again.
    columns: Vec<Arc<DVector<f64>>>,
    sigmas: Vec<f64>,
    /// Sum of squares of the residual.
    residual: DVector<f64>,
    /// Derivative times residual, a column for each band.
    slope: DMatrix<f64>,
    /// Derivative times derivative: of each band the lower triangle, row by row, in one column.
    curvature: DMatrix<f64>,
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

/// Lines summed at once where many derivatives meet the same few: those stay in the processor's cache.
const PIECE: usize = 512;

/// Products among derivatives, in their own units: of each band the lower triangle, row by row, in one column.
pub fn products(spectrum: &Spectrum, columns: &[&DVector<f64>]) -> DMatrix<f64> {
    let mut all = DMatrix::zeros(place(columns.len(), 0), spectrum.bands.len());
    for (b, band) in spectrum.bands.iter().enumerate() {
        for (i, column) in columns.iter().enumerate() {
            let a = lines_of(column, band);
            (0..=i).for_each(|j| all[(place(i, j), b)] = a.dot(&lines_of(columns[j], band)));
        }
    }
    all
}

/// Place of a product in its triangle; the row comes first.
const fn place(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

impl<'a> Quadratic<'a> {
    /// From a residual (measured less simulated) and the response's derivatives, all as lines.
    pub fn new(
        spectrum: &'a Spectrum,
        criterion: &'a Criterion,
        residual: &DVector<f64>,
        columns: &[Arc<DVector<f64>>],
        free: &[Free],
    ) -> Self {
        let bands = spectrum.bands.len();
        let nothing = Self {
            spectrum,
            criterion,
            columns: Vec::new(),
            sigmas: Vec::new(),
            residual: DVector::zeros(bands),
            slope: DMatrix::zeros(0, bands),
            curvature: DMatrix::zeros(0, bands),
        };
        nothing.about(residual, columns, free)
    }

    /// About another point. Where it has the same derivatives in the same places, their products are known.
    pub fn about(&self, residual: &DVector<f64>, columns: &[Arc<DVector<f64>>], free: &[Free]) -> Self {
        self.made(residual, columns, free, false)
    }

    /// About the same point, of the same `residual`, with other derivatives: those in the same places as here have their
    /// products already.
    pub fn beside(&self, residual: &DVector<f64>, columns: &[Arc<DVector<f64>>], free: &[Free]) -> Self {
        self.made(residual, columns, free, true)
    }

    fn made(
        &self,
        residual: &DVector<f64>,
        columns: &[Arc<DVector<f64>>],
        free: &[Free],
        same_residual: bool,
    ) -> Self {
        let (n, bands) = (columns.len(), self.spectrum.bands.len());
        let sigmas: Vec<f64> = free.iter().take(n).map(|f| f.sigma).collect();
        let known = |k: &usize| {
            let was = self.columns.get(*k).zip(self.sigmas.get(*k));
            was.is_some_and(|(column, sigma)| Arc::ptr_eq(column, &columns[*k]) && *sigma == sigmas[*k])
        };
        let known: Vec<bool> = (0..n).map(|k| known(&k)).collect();
        let mut squares = if same_residual { self.residual.clone() } else { DVector::zeros(bands) };
        let mut slope = DMatrix::zeros(n, bands);
        let mut curvature = DMatrix::zeros(place(n, 0), bands);
        for (b, band) in self.spectrum.bands.iter().enumerate() {
            let r = lines_of(residual, band);
            if !same_residual {
                squares[b] = r.dot(&r);
            }
            let (mut slope, mut products) = (slope.column_mut(b), curvature.column_mut(b));
            for i in 0..n {
                let a = lines_of(&columns[i], band);
                slope[i] = if known[i] && same_residual { self.slope[(i, b)] } else { sigmas[i] * a.dot(&r) };
                for j in 0..=i {
                    products[place(i, j)] = if known[i] && known[j] {
                        self.curvature[(place(i, j), b)]
                    } else {
                        sigmas[i] * sigmas[j] * a.dot(&lines_of(&columns[j], band))
                    };
                }
            }
        }
        Self {
            spectrum: self.spectrum,
            criterion: self.criterion,
            columns: columns.to_vec(),
            sigmas,
            residual: squares,
            slope,
            curvature,
        }
    }

    /// Products of each of these with every derivative here and, in the last row, with the `residual`, in their own units; a
    /// column for each band.
    pub fn crossed(&self, residual: &DVector<f64>, others: &[&DVector<f64>]) -> Vec<DMatrix<f64>> {
        let n = self.columns.len();
        let firsts: Vec<&DVector<f64>> = self.columns.iter().map(AsRef::as_ref).chain([residual]).collect();
        let mut crossed = vec![DMatrix::zeros(n + 1, self.spectrum.bands.len()); others.len()];
        for (b, band) in self.spectrum.bands.iter().enumerate() {
            for from in band.lines.clone().step_by(PIECE) {
                let lines = PIECE.min(band.lines.end - from);
                for (other, crossed) in others.iter().zip(&mut crossed) {
                    let a = other.rows(from, lines);
                    for (k, first) in firsts.iter().enumerate() {
                        crossed[(k, b)] += a.dot(&first.rows(from, lines));
                    }
                }
            }
        }
        crossed
    }

    /// About the same point, with more derivatives: what [`crossed`](Self::crossed) says of each, and their [`products`].
    pub fn joined(&self, crossed: &[&DMatrix<f64>], own: &DMatrix<f64>, free: &[Free]) -> Self {
        let (n, all, bands) = (self.sigmas.len(), free.len(), self.spectrum.bands.len());
        let sigmas: Vec<f64> = free.iter().map(|f| f.sigma).collect();
        let mut slope = DMatrix::zeros(all, bands);
        let mut curvature = DMatrix::zeros(place(all, 0), bands);
        slope.rows_mut(0, n).copy_from(&self.slope);
        curvature.rows_mut(0, place(n, 0)).copy_from(&self.curvature);
        for b in 0..bands {
            let (mut slope, mut products) = (slope.column_mut(b), curvature.column_mut(b));
            for (i, (row, crossed)) in (n..all).zip(crossed).enumerate() {
                slope[row] = sigmas[row] * crossed[(n, b)];
                for column in 0..=row {
                    let product =
                        if column < n { crossed[(column, b)] } else { own[(place(i, column - n), b)] };
                    products[place(row, column)] = sigmas[row] * sigmas[column] * product;
                }
            }
        }
        let (residual, columns) = (self.residual.clone(), Vec::new());
        Self { columns, sigmas, residual, slope, curvature, ..*self }
    }

    /// The same with these parameters only.
    pub fn only(&self, kept: &[usize]) -> Self {
        let pairs = (0..kept.len()).flat_map(|i| (0..=i).map(move |j| (kept[i], kept[j])));
        let products: Vec<usize> = pairs.map(|(i, j)| place(i.max(j), i.min(j))).collect();
        Self {
            columns: Vec::new(),
            sigmas: kept.iter().map(|k| self.sigmas[*k]).collect(),
            residual: self.residual.clone(),
            slope: self.slope.select_rows(kept),
            curvature: self.curvature.select_rows(&products),
            ..*self
        }
    }

    /// The same with the last parameters' priors wider or narrower by a factor.
    pub fn scaled(&self, from: usize, factor: f64) -> Self {
        let scale = |k: usize| if k < from { 1.0 } else { factor };
        let (mut slope, mut curvature) = (self.slope.clone(), self.curvature.clone());
        for i in from..self.sigmas.len() {
            slope.row_mut(i).scale_mut(factor);
            (0..=i).for_each(|j| curvature.row_mut(place(i, j)).scale_mut(factor * scale(j)));
        }
        Self {
            columns: Vec::new(),
            sigmas: self.sigmas.iter().enumerate().map(|(k, sigma)| sigma * scale(k)).collect(),
            residual: self.residual.clone(),
            slope,
            curvature,
            ..*self
        }
    }

    /// Mean squares by band after a step.
    pub fn powers(&self, step: &DVector<f64>) -> Vec<f64> {
        let n = step.len();
        // Of the lower triangle what is off the diagonal stands for two.
        let times = |i: usize, j: usize| if i == j { 1.0 } else { 2.0 } * step[i] * step[j];
        let pairs = (0..n).flat_map(|i| (0..=i).map(move |j| times(i, j)));
        let pairs = DVector::from_iterator(place(n, 0), pairs);
        let sums = &self.residual - 2.0 * self.slope.tr_mul(step) + self.curvature.tr_mul(&pairs);
        let bands = self.spectrum.bands.iter();
        bands.zip(sums.iter()).map(|(band, sum)| (sum / band.lines.len() as f64).max(0.0)).collect()
    }

    /// The information that the data hold, in units of the priors': the weighted normal matrix.
    pub fn information(&self, noise: &Noise) -> DMatrix<f64> {
        let sum = &self.curvature * DVectorView::from_slice(&noise.weight, noise.weight.len());
        let n = self.sigmas.len();
        DMatrix::from_fn(n, n, |i, j| sum[place(i.max(j), i.min(j))])
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
            let information = self.information(&noise);
            let slope = &self.slope * DVectorView::from_slice(&noise.weight, noise.weight.len());
            let gradient = slope - &information * &step - (&z0 + &step) - drag.component_mul(&step);
            let normal = information + DMatrix::from_diagonal(&drag.add_scalar(1.0));
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
