//! How much a set of effects leaves, against noise.

use std::collections::BTreeMap;

use kort_identify::scores;
use kort_identify::simulate::{Problem, Stack};

use crate::constants::Constants;

/// Noise variance from sample to sample, by channel.
type Floor = BTreeMap<&'static str, f64>;

/// Squared error above the noise over full scale, all channels.
pub fn excess(problem: &Problem, residual: &Stack, floor: &Floor) -> f64 {
    let full = scores::full_scales(problem);
    scores::sums(problem, residual, |r, row| !problem.masked[r][row])
        .into_iter()
        .map(|(name, (sum, n))| {
            let noise = floor.get(name).copied().unwrap_or(0.0);
            (sum / n.max(1) as f64 - noise).max(0.0) / full[name].powi(2)
        })
        .sum()
}

/// The channel on which a residual is largest against what noise of such a sensor can be, with its size over
/// full scale, if it is more than that.
pub fn more_than_noise(problem: &Problem, residual: &Stack, floor: &Floor) -> Option<(&'static str, f64)> {
    let constants = Constants::built_in().remainder;
    let full = scores::full_scales(problem);
    scores::sums(problem, residual, |r, row| !problem.masked[r][row])
        .into_iter()
        .map(|(name, (sum, n))| {
            let noise = floor.get(name).copied().unwrap_or(0.0);
            let size = (sum / n.max(1) as f64 - noise).max(0.0).sqrt() / full[name];
            let allowed = if name == "flow_m_s" { constants.practical_flow } else { constants.practical };
            (name, size, size / allowed)
        })
        .filter(|(_, _, ratio)| *ratio > 1.0)
        .max_by(|a, b| a.2.total_cmp(&b.2))
        .map(|(name, size, _)| (name, size))
}
