//! What a re-fit of the base parameters could absorb: small dense least squares by normal equations.

/// One Gauss-Newton step on `residual` from `values`, with a Gaussian prior of inverse standard
/// deviation `precision` (per relative change, zero for none) around `values`.
pub fn gauss_newton_step(
    values: Vec<f64>,
    residual: &dyn Fn(&[f64]) -> Vec<f64>,
    precision: &[f64],
) -> Vec<f64> {
    let base = residual(&values);
    let columns: Vec<Vec<f64>> = (0..values.len())
        .map(|index| {
            let mut moved = values.clone();
            moved[index] *= 1.0 + 1e-4;
            residual(&moved).iter().zip(&base).map(|(m, b)| (m - b) / 1e-4).collect()
        })
        .collect();
    let step = project(&columns, &base, precision);
    values.iter().zip(step).map(|(value, change)| value * (1.0 - change)).collect()
}

/// Coefficients of `target` on `columns` (least squares with a ridge of squared `precision`).
pub fn project(columns: &[Vec<f64>], target: &[f64], precision: &[f64]) -> Vec<f64> {
    let size = columns.len();
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum::<f64>();
    let mut rows: Vec<Vec<f64>> = (0..size)
        .map(|i| {
            let mut row: Vec<f64> = (0..size).map(|j| dot(&columns[i], &columns[j])).collect();
            row[i] = row[i] * (1.0 + 1e-12) + precision[i].powi(2) + 1e-300;
            row.push(dot(&columns[i], target));
            row
        })
        .collect();
    // Elimination with partial pivoting: at most eight unknowns.
    for pivot in 0..size {
        let best = (pivot..size)
            .max_by(|&a, &b| rows[a][pivot].abs().total_cmp(&rows[b][pivot].abs()))
            .unwrap_or(pivot);
        rows.swap(pivot, best);
        let lead = rows[pivot].clone();
        for row in rows.iter_mut().skip(pivot + 1) {
            let factor = row[pivot] / lead[pivot];
            for (cell, top) in row.iter_mut().zip(&lead).skip(pivot) {
                *cell -= factor * top;
            }
        }
    }
    let mut solution = vec![0.0; size];
    for row in (0..size).rev() {
        let known: f64 = (row + 1..size).map(|column| rows[row][column] * solution[column]).sum();
        solution[row] = (rows[row][size] - known) / rows[row][row];
    }
    solution
}

/// What remains of `target` after the best combination of `columns` whose coefficients stay within
/// plus and minus `bounds` (active set: the worst offender is fixed at its bound, one at a time).
pub fn residual_within(columns: &[Vec<f64>], target: &[f64], bounds: &[f64]) -> Vec<f64> {
    let mut rest = target.to_vec();
    let mut free: Vec<usize> = (0..columns.len()).collect();
    loop {
        let chosen: Vec<Vec<f64>> = free.iter().map(|&index| columns[index].clone()).collect();
        let precision: Vec<f64> = free.iter().map(|&index| 2.0 / bounds[index]).collect();
        let found = project(&chosen, &rest, &precision);
        let excess = |place: usize| found[place].abs() / bounds[free[place]];
        let worst = (0..free.len()).max_by(|&a, &b| excess(a).total_cmp(&excess(b)));
        match worst.filter(|&place| excess(place) > 1.0) {
            Some(place) => {
                let index = free.remove(place);
                subtract(&mut rest, &columns[index], found[place].signum() * bounds[index]);
            }
            None => {
                for (column, value) in chosen.iter().zip(&found) {
                    subtract(&mut rest, column, *value);
                }
                return rest;
            }
        }
    }
}

fn subtract(rest: &mut [f64], column: &[f64], factor: f64) {
    for (value, slope) in rest.iter_mut().zip(column) {
        *value -= factor * slope;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bounded_refit_leaves_what_lies_beyond_the_bound() {
        let columns = [vec![1.0, 0.0, 1.0], vec![0.0, 1.0, 0.0]];
        let rest = residual_within(&columns, &[3000.0, 0.1, 3000.0], &[1000.0, 1000.0]);
        assert!((rest[0] - 2000.0).abs() < 1e-6 && rest[1].abs() < 1e-6, "{rest:?}");
    }

    #[test]
    fn a_step_solves_a_linear_problem() {
        let solved = gauss_newton_step(vec![1.0, 2.0], &|v| vec![v[0] - 3.0, v[1] - 5.0], &[0.0, 0.0]);
        assert!((solved[0] - 3.0).abs() < 1e-6 && (solved[1] - 5.0).abs() < 1e-6, "{solved:?}");
    }
}
