//! The normal equations of a fit, in parameters scaled by their sizes.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use std::sync::Arc;

use crate::fit::{Columns, Free, Problem, Stack};

/// The whitened derivative and its normal matrix, priors included; rebuilt only where the derivative is.
pub struct Equations<'a> {
    free: &'a [Free],
    /// Sizes of the parameters.
    pub size: DVector<f64>,
    /// Normal matrix.
    pub normal: DMatrix<f64>,
    derivative: DMatrix<f64>,
    of: Columns,
}

impl<'a> Equations<'a> {
    /// For these parameters, before any derivative is known.
    pub fn new(free: &'a [Free]) -> Self {
        Self {
            free,
            size: DVector::from_iterator(free.len(), free.iter().map(|f| f.size)),
            normal: DMatrix::zeros(0, 0),
            derivative: DMatrix::zeros(0, 0),
            of: vec![None; free.len()],
        }
    }

    /// Takes over the derivative's columns, all of which are known.
    pub fn follow(&mut self, problem: &Problem, columns: &[Option<Arc<Stack>>], samples: usize) {
        let same = |a: &Option<Arc<Stack>>, b: &Option<Arc<Stack>>| match (a, b) {
            (Some(a), Some(b)) => Arc::ptr_eq(a, b),
            _ => false,
        };
        let n = self.free.len();
        if self.derivative.nrows() != samples {
            self.derivative = DMatrix::zeros(samples, n);
        }
        let changed: Vec<usize> = (0..n).filter(|k| !same(&self.of[*k], &columns[*k])).collect();
        if changed.is_empty() && self.normal.nrows() == n {
            return;
        }
        let whitened: Vec<(usize, DVector<f64>)> = changed
            .into_par_iter()
            .filter_map(|k| Some((k, problem.whiten(columns[k].as_ref()?) * self.size[k])))
            .collect();
        for (k, column) in whitened {
            self.derivative.set_column(k, &column);
        }
        self.of = columns.to_vec();
        // Blocked, which `tr_mul` is not: with eighty knots that counts.
        self.normal = self.derivative.transpose() * &self.derivative;
        for (k, free) in self.free.iter().enumerate() {
            if let Some((_, sigma)) = free.prior {
                self.normal[(k, k)] += (self.size[k] / sigma).powi(2);
            }
        }
    }

    /// Half the slope of the cost downhill, where the parameters have these values and leave this residual.
    pub fn gradient(&self, residual: &DVector<f64>, values: &[f64]) -> DVector<f64> {
        let mut gradient = self.derivative.tr_mul(residual);
        for (k, free) in self.free.iter().enumerate() {
            if let Some((mean, sigma)) = free.prior {
                gradient[k] += self.size[k] / sigma * (mean - values[k]) / sigma;
            }
        }
        gradient
    }
}
