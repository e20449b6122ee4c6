//! Rows that a reported score leaves out of the fit: a check of what the evidence says, never its judge. A
//! structural error repeats in every block, so a wrong name holds out of sample as well.

use kort_thruster::effects::Scale;

use crate::hypothesis::Hypothesis;
use crate::simulate::Problem;

/// Blocks of the split into training and held-out data.
const SPLIT_BLOCKS: usize = 12;
/// Share of the distance of two knots that may be left out at a time: what changes freely with time can be
/// judged between its knots only.
const OF_KNOTS: f64 = 0.4;

/// Every third of twelve blocks, or of ones short against the knots of what changes freely with time.
pub fn held_out_rows(problem: &Problem, hypotheses: &[&Hypothesis]) -> Vec<Vec<bool>> {
    let longest_s = hypotheses
        .iter()
        .flat_map(|h| &h.effects)
        .filter_map(|m| longest_block_s(m, &problem.scale))
        .fold(f64::INFINITY, f64::min);
    problem
        .recordings
        .iter()
        .map(|r| {
            let width = (r.duration_s() / SPLIT_BLOCKS as f64 * (1.0 + 1e-9)).min(longest_s);
            r.time_s.iter().map(|t| ((t - r.time_s[0]) / width) as usize % 3 == 2).collect()
        })
        .collect()
}

fn longest_block_s(member: &crate::hypothesis::Member, scale: &Scale) -> Option<f64> {
    (member.effect.parameters)(scale)
        .into_iter()
        .filter_map(|s| s.acts)
        .map(|s| OF_KNOTS * 0.5 * s.length_s)
        .min_by(f64::total_cmp)
}
