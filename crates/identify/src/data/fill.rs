//! Cells between samples.

pub(super) fn median_step(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|w| w[1] - w[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}

/// The column with empty cells filled by the value before; the first known one stands before it too.
pub(super) fn held(column: &[f64]) -> Vec<f64> {
    let mut at = column.iter().copied().find(|v| v.is_finite()).unwrap_or(0.0);
    column
        .iter()
        .map(|v| {
            if v.is_finite() {
                at = *v;
            }
            at
        })
        .collect()
}

/// The column with empty cells filled: straight between samples, held at the ends.
pub(super) fn filled(column: &[f64]) -> Vec<f64> {
    let mut out = column.to_vec();
    let known: Vec<usize> = (0..column.len()).filter(|k| column[*k].is_finite()).collect();
    let (Some(first), Some(last)) = (known.first().copied(), known.last().copied()) else {
        out.fill(0.0);
        return out;
    };
    out[..first].fill(column[first]);
    out[last..].fill(column[last]);
    for w in known.windows(2) {
        for (k, cell) in out.iter_mut().enumerate().take(w[1]).skip(w[0] + 1) {
            let u = (k - w[0]) as f64 / (w[1] - w[0]) as f64;
            *cell = column[w[0]] + (column[w[1]] - column[w[0]]) * u;
        }
    }
    out
}

pub(super) fn linear(time_s: &[f64], column: &[f64], row: usize, t: f64) -> f64 {
    let next = (row + 1).min(time_s.len() - 1);
    let width = time_s[next] - time_s[row];
    let u = if width > 0.0 { (t - time_s[row]) / width } else { 0.0 };
    column[row] + (column[next] - column[row]) * u.clamp(0.0, 1.5)
}

pub(super) fn catmull_rom(p0: f64, p1: f64, p2: f64, p3: f64, u: f64) -> f64 {
    0.5 * (2.0 * p1
        + (p2 - p0) * u
        + (2.0 * p0 - 5.0 * p1 + 4.0 * p2 - p3) * u * u
        + (3.0 * p1 - p0 - 3.0 * p2 + p3) * u * u * u)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_command_with_empty_cells_is_held_and_a_response_joined() {
        let column = [f64::NAN, 2.0, f64::NAN, f64::NAN, 8.0, f64::NAN];
        assert_eq!(held(&column), [2.0, 2.0, 2.0, 2.0, 8.0, 8.0]);
        assert_eq!(filled(&column), [2.0, 2.0, 4.0, 6.0, 8.0, 8.0]);
    }
}
