//! One step of a bounded least-squares fit.

use nalgebra::{DMatrix, DVector};

/// Solves `normal * step = gradient` with every part of the step in its room. A part that would leave its
/// room goes to the edge, and the others are solved for again: cut off alone, the step would no longer be
/// a good one. Zero where the matrix is not positive.
pub fn bounded_step(
    normal: &DMatrix<f64>,
    gradient: &DVector<f64>,
    room: impl Fn(usize) -> (f64, f64),
) -> DVector<f64> {
    let n = gradient.len();
    let mut held: Vec<Option<f64>> = vec![None; n];
    loop {
        let mut a = normal.clone();
        let mut b = gradient.clone();
        for k in 0..n {
            a[(k, k)] += 1e-12;
            let Some(at) = held[k] else { continue };
            for j in 0..n {
                b[j] -= a[(j, k)] * at;
                a[(j, k)] = 0.0;
                a[(k, j)] = 0.0;
            }
            a[(k, k)] = 1.0;
            b[k] = at;
        }
        // Rows held later must not see what earlier ones wrote into their right-hand sides.
        for k in 0..n {
            if let Some(at) = held[k] {
                b[k] = at;
            }
        }
        let Some(cholesky) = a.cholesky() else { return DVector::zeros(n) };
        let step = cholesky.solve(&b);
        let beyond = |k: usize| {
            let (low, high) = room(k);
            (low - step[k]).max(step[k] - high) / (high - low).max(1e-300)
        };
        let worst = (0..n).filter(|k| held[*k].is_none()).max_by(|i, j| beyond(*i).total_cmp(&beyond(*j)));
        match worst.filter(|k| beyond(*k) > 1e-12) {
            Some(k) => {
                let (low, high) = room(k);
                held[k] = Some(step[k].clamp(low.min(0.0), high.max(0.0)));
            }
            None => return step,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn where_one_parameter_meets_its_bound_the_other_makes_up_for_it() {
        // Both do nearly the same; the first may move by 1 only, the data want 10 in all.
        let normal = DMatrix::from_row_slice(2, 2, &[1.0, 0.9, 0.9, 1.0]);
        let gradient = &normal * DVector::from_row_slice(&[9.0, 1.0]);
        let step = bounded_step(&normal, &gradient, |k| if k == 0 { (-1.0, 1.0) } else { (-100.0, 100.0) });
        assert!((step[0] - 1.0).abs() < 1e-9, "{step}");
        assert!((step[1] - (0.9 * 9.0 + 1.0 - 0.9)).abs() < 1e-6, "{step}");
    }

    #[test]
    fn a_step_of_three_with_two_at_their_bounds_solves_for_the_third() {
        let normal = DMatrix::from_row_slice(3, 3, &[2.0, 0.5, 0.3, 0.5, 2.0, 0.4, 0.3, 0.4, 2.0]);
        let gradient = &normal * DVector::from_row_slice(&[5.0, -5.0, 1.0]);
        let step = bounded_step(&normal, &gradient, |k| if k < 2 { (-1.0, 1.0) } else { (-9.0, 9.0) });
        assert!((step[0] - 1.0).abs() < 1e-9 && (step[1] + 1.0).abs() < 1e-9, "{step}");
        let third = (gradient[2] - 0.3 * step[0] - 0.4 * step[1]) / 2.0;
        assert!((step[2] - third).abs() < 1e-6, "{step}");
    }
}
