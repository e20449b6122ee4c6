//! What a re-fit of the base parameters could absorb: small dense least squares by normal equations.

/// One Gauss-Newton step on `residual` from `values`, with a Gaussian prior of inverse standard
/// deviation `precision` (per relative change, zero for none) around `values`.
pub fn gauss_newton_step(
    values: Vec<f64>,
    residual: &mut dyn FnMut(&[f64]) -> Vec<f64>,
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
