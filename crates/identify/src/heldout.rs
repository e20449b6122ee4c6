//! Scores on data that were not fitted.
//!
//! Two forms. While hypotheses compete, each is judged on blocks of the recording left out in
//! turn, to first order from one fit (the parameters move by what the block contributed). What
//! the report claims is done in full: a fit on the training blocks alone, scored on the others.

use kort_thruster::effects::{Descriptor, Scale};
use nalgebra::{DMatrix, DVector};

use crate::fit::{Fit, Problem, Stack};

/// Length of a block, s: long against the noise's memory, short against the recording.
const BLOCK_S: f64 = 2.0;
/// Blocks left out together.
const FOLDS: usize = 5;
/// Blocks of the split into training and held-out data.
const SPLIT_BLOCKS: usize = 12;

/// Share of the distance of two knots that may be left out at a time: what changes freely with
/// time can be judged between its knots only.
const OF_KNOTS: f64 = 0.4;

/// Longest block that may be left out, s, if one of the effects changes freely with time.
pub fn longest_block_s<'a>(
    effects: impl Iterator<Item = &'a &'static Descriptor>,
    scale: &Scale,
) -> Option<f64> {
    let stretches = effects.flat_map(|e| (e.parameters)(scale)).filter_map(|s| s.acts);
    stretches.map(|s| OF_KNOTS * 0.5 * s.length_s).min_by(f64::total_cmp)
}

/// Block of every joined sample, numbered over all recordings.
fn blocks(problem: &Problem, block_s: f64) -> (Vec<usize>, usize) {
    let mut of = Vec::new();
    let mut offset = 0;
    for recording in &problem.recordings {
        let count = ((recording.duration_s() / block_s).round() as usize).max(4);
        let width = recording.duration_s() / count as f64 * (1.0 + 1e-9);
        for channel in &recording.channels {
            of.extend(
                channel
                    .rows
                    .iter()
                    .map(|r| offset + ((recording.time_s[*r] - recording.time_s[0]) / width) as usize),
            );
        }
        offset += count;
    }
    (of, offset)
}

/// Sums of squares by block for two fits, each when the block's fold is left out of it, to first
/// order.
pub fn left_out(problem: &Problem, before: &mut Fit, after: &mut Fit, scale: &Scale) -> (Vec<f64>, Vec<f64>) {
    let block_s = longest_block_s(after.hypothesis.effects.iter(), scale).unwrap_or(BLOCK_S);
    (left_out_of(problem, before, block_s), left_out_of(problem, after, block_s))
}

fn left_out_of(problem: &Problem, fit: &mut Fit, block_s: f64) -> Vec<f64> {
    let (block, count) = blocks(problem, block_s);
    let n = fit.values.len();
    let size = DVector::from_iterator(n, fit.hypothesis.free.iter().map(|f| f.size));
    let mut j = problem.jacobian(fit);
    for k in 0..n {
        j.column_mut(k).scale_mut(if fit.at_bound[k] { 0.0 } else { size[k] });
    }
    let mut normals = vec![DMatrix::<f64>::zeros(n, n); FOLDS];
    let mut gradients = vec![DVector::<f64>::zeros(n); FOLDS];
    let rows_of: Vec<Vec<usize>> =
        (0..FOLDS).map(|f| (0..block.len()).filter(|i| block[*i] % FOLDS == f).collect()).collect();
    for f in 0..FOLDS {
        let part = j.select_rows(&rows_of[f]);
        let r = DVector::from_iterator(rows_of[f].len(), rows_of[f].iter().map(|i| fit.residual[*i]));
        normals[f] = part.transpose() * &part;
        gradients[f] = part.tr_mul(&r);
    }
    let mut total: DMatrix<f64> = normals.iter().sum();
    for (k, free) in fit.hypothesis.free.iter().enumerate() {
        if let Some((_, sigma)) = free.prior {
            total[(k, k)] += (size[k] / sigma).powi(2);
        }
        total[(k, k)] += 1e-6;
    }
    let mut losses = vec![0.0; count];
    for f in 0..FOLDS {
        let rest = &total - &normals[f];
        let shift = rest.cholesky().map_or_else(|| DVector::zeros(n), |c| c.solve(&gradients[f]));
        for i in &rows_of[f] {
            let left = fit.residual[*i] + j.row(*i).transpose().dot(&shift);
            losses[block[*i]] += left * left;
        }
    }
    losses
}

/// Residuals, on every row, of two fits taken further on the rows that are not held out.
pub fn trained(problem: &Problem, held: &[Vec<bool>], before: &Fit, after: &Fit) -> (Stack, Stack) {
    let training = problem.without(held);
    let residual = |fit: &Fit| problem.residual_of(&training.again(fit, 4));
    rayon::join(|| residual(before), || residual(after))
}

/// Sum of paired differences and its standard error: positive if `after` is better.
pub fn paired(before: &[f64], after: &[f64]) -> (f64, f64) {
    let d: Vec<f64> = before.iter().zip(after).map(|(b, a)| b - a).collect();
    let n = d.len() as f64;
    let mean = d.iter().sum::<f64>() / n;
    let var = d.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    (mean * n, (var * n).sqrt())
}

/// Rows that the reported held-out score leaves out of the fit: every third of twelve blocks, or
/// of ones no longer than `longest_s`. Where a fit has something change in mid-run, the blocks are
/// cut there too, and the middle ones of each stretch are left out: every level is then both fitted
/// and judged, and the rows about the change tell when it came.
pub fn held_out_rows(problem: &Problem, fits: &[&Fit], longest_s: Option<f64>) -> Vec<Vec<bool>> {
    let longest_s = longest_s.unwrap_or(f64::INFINITY);
    let mut changes: Vec<f64> = fits.iter().flat_map(|f| crate::changes::instants(f)).collect();
    changes.sort_by(f64::total_cmp);
    problem
        .recordings
        .iter()
        .map(|r| {
            let width = (r.duration_s() / SPLIT_BLOCKS as f64 * (1.0 + 1e-9)).min(longest_s);
            if !changes.is_empty() {
                return between(&changes, &r.time_s, width);
            }
            r.time_s.iter().map(|t| ((t - r.time_s[0]) / width) as usize % 3 == 2).collect()
        })
        .collect()
}

/// Middle thirds of the stretches between changes, in blocks of about `width`.
fn between(changes: &[f64], time_s: &[f64], width: f64) -> Vec<bool> {
    let end = time_s[time_s.len() - 1];
    time_s
        .iter()
        .map(|t| {
            let k = changes.partition_point(|c| c <= t);
            let from = if k == 0 { time_s[0] } else { changes[k - 1].max(time_s[0]) };
            let to = changes.get(k).map_or(end, |c| c.min(end));
            let blocks = 3.0 * ((to - from) / (3.0 * width)).round().max(1.0);
            let block = ((t - from) / (to - from).max(1e-9) * blocks * (1.0 - 1e-9)) as usize;
            block % 3 == 1
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_stretch_between_changes_is_fitted_and_judged() {
        let time_s: Vec<f64> = (0..3000).map(|k| 5.0 + 0.01 * f64::from(k)).collect();
        let held = between(&[9.0, 10.2], &time_s, 2.5);
        for (from, to) in [(5.0, 9.0), (9.0, 10.2), (10.2, 35.0)] {
            let inside: Vec<bool> =
                (0..3000).filter(|k| time_s[*k] >= from && time_s[*k] < to).map(|k| held[k]).collect();
            let share = inside.iter().filter(|h| **h).count() as f64 / inside.len() as f64;
            assert!((0.3..0.37).contains(&share), "{from}: {share}");
            assert!(!inside[0] && !inside[inside.len() - 1], "the rows about a change are fitted");
        }
    }
}
