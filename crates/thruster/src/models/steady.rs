//! Steady states: implicit steps in time that grow into Newton's method as the motion dies.

use nalgebra::{DMatrix, DVector};
use thiserror::Error;

/// The search for a steady state did not settle.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("no steady state found: the states still change at {rates:?} at {state:?}")]
pub struct NoSteadyState {
    /// Where the search stopped.
    pub state: Vec<f64>,
    /// Rates there.
    pub rates: Vec<f64>,
}

/// Follows `x' = rates(x)` to rest from `x`.
///
/// Steps `(1/h - J) dx = rates` follow the real motion while `h` is small, so the search ends in
/// the steady state that the thruster itself would reach, and double their length as it slows.
pub(super) fn search<const N: usize>(
    mut x: [f64; N],
    rates: impl Fn(&[f64; N]) -> [f64; N],
) -> Result<[f64; N], NoSteadyState> {
    let size = |r: &[f64; N]| r.iter().fold(0.0_f64, |a, b| a.max(b.abs()));
    let mut f = rates(&x);
    let mut h = 1e-3;
    for _ in 0..400 {
        if size(&f) < 1e-12 {
            return Ok(x);
        }
        let jacobian = jacobian(&x, &rates);
        let system = DMatrix::from_fn(N, N, |i, j| if i == j { 1.0 / h } else { 0.0 } - jacobian[(i, j)]);
        let Some(dx) = system.lu().solve(&DVector::from_column_slice(&f)) else { break };
        let tried: [f64; N] = std::array::from_fn(|i| x[i] + dx[i]);
        let moved = (0..N).any(|i| dx[i].abs() > 1e-14 * (1.0 + x[i].abs()));
        let after = rates(&tried);
        if size(&after) <= 2.0 * size(&f) {
            h = f64::min(2.0 * h, 1e9);
            (x, f) = (tried, after);
        } else {
            h *= 0.25;
        }
        // Rounding holds the last digits: nothing moves any more and the rates are small.
        if !moved && size(&f) < 1e-6 {
            return Ok(x);
        }
    }
    if size(&f) < 1e-8 { Ok(x) } else { Err(NoSteadyState { state: x.to_vec(), rates: f.to_vec() }) }
}

/// Central differences.
pub(super) fn jacobian<const N: usize>(x: &[f64; N], rates: &impl Fn(&[f64; N]) -> [f64; N]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(N, N);
    for j in 0..N {
        let h = 1e-6 * (1e-3 + x[j].abs());
        let at = |by: f64| {
            let mut y = *x;
            y[j] += by;
            rates(&y)
        };
        let (high, low) = (at(h), at(-h));
        for i in 0..N {
            out[(i, j)] = (high[i] - low[i]) / (2.0 * h);
        }
    }
    out
}
