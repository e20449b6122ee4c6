//! One step of a bounded least-squares fit.

use nalgebra::{DMatrix, DVector};

use crate::fit::Free;

/// The damped step in scaled parameters. A parameter that it would take out of its bounds goes to the
/// bound, and the others are solved for again: cut off alone, the step would no longer be a good one.
pub fn damped_step(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    damping: f64,
    free: &[Free],
    values: &[f64],
) -> DVector<f64> {
    let n = free.len();
    let mut held: Vec<Option<f64>> = vec![None; n];
    loop {
        let mut a = normal.clone();
        let mut b = gradient.clone();
        for k in 0..n {
            a[(k, k)] += damping * a[(k, k)] + 1e-12;
        }
        for k in 0..n {
            let Some(at) = held[k] else { continue };
            for j in 0..n {
                b[j] -= a[(j, k)] * at;
                a[(j, k)] = 0.0;
                a[(k, j)] = 0.0;
            }
            a[(k, k)] = 1.0;
            b[k] = at;
        }
        let Some(cholesky) = a.cholesky() else { return DVector::zeros(n) };
        let step = cholesky.solve(&b);
        let room =
            |k: usize| ((free[k].low - values[k]) / free[k].size, (free[k].high - values[k]) / free[k].size);
        let beyond = |k: usize| {
            let (low, high) = room(k);
            (low - step[k]).max(step[k] - high) / (high - low).max(1e-300)
        };
        let worst = (0..n).filter(|k| held[*k].is_none()).max_by(|i, j| beyond(*i).total_cmp(&beyond(*j)));
        match worst.filter(|k| beyond(*k) > 1e-12) {
            Some(k) => held[k] = Some(step[k].clamp(room(k).0.min(0.0), room(k).1.max(0.0))),
            None => return step,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fit::Target;

    #[test]
    fn where_one_parameter_meets_its_bound_the_other_makes_up_for_it() {
        // Both do nearly the same; the first may move by 1 only, the data want 10 in all.
        let normal = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let gradient = &normal * DVector::from_row_slice(&[9.0, 1.0]);
        let free = |high: f64| Free {
            target: Target::Effect(0, 0),
            name: "size",
            unit: "1",
            prior: None,
            low: -high,
            high,
            size: 1.0,
            acts: None,
        };
        let step = damped_step(&normal, &gradient, 0.0, &[free(1.0), free(100.0)], &[0.0, 0.0]);
        assert!((step[0] - 1.0).abs() < 1e-9, "{step}");
        assert!((step[1] - (0.9 * 9.0 + 1.0 - 0.9)).abs() < 1e-6, "{step}");
    }
}
