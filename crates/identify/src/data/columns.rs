//! Columns that no part of the model reads, as possible drivers of what is left.

use super::fill::{filled, linear};
use super::{Prepared, Series};

/// Columns of the contract, and those that drive where no command is logged; any other is a possible driver of what is left.
pub const KNOWN: [&str; 18] = [
    "time_s",
    "current_cmd_a",
    "current_a",
    "voltage_cmd_v",
    "duty_cmd",
    "speed_cmd_rad_s",
    "thrust_cmd_n",
    "shaft_angle_rad",
    "shaft_speed_rad_s",
    "thrust_n",
    "torque_n_m",
    "flow_m_s",
    "ambient_m_s",
    "supply_v",
    "temperature_c",
    "depth_m",
    "power_w",
    "supply_current_a",
];

/// Columns beside the contract's that another part of the model reads.
const READ: [&str; 1] = ["torque_enable"];

/// Columns that no part of the model reads but that may drive what is left. Every recording must have them,
/// varying. What a controller asks for is no physics: in a closed loop it follows whatever is wrong.
pub fn possible_drivers(series: &[Series]) -> Vec<String> {
    let Some(first) = series.first() else { return Vec::new() };
    let unknown = |name: &str| !KNOWN.contains(&name) && !READ.contains(&name) && !name.contains("_cmd");
    first
        .columns
        .iter()
        .map(|c| c.0.clone())
        .filter(|name| unknown(name))
        .filter(|name| series.iter().all(|s| s.column(name).is_some_and(varies)))
        .collect()
}

/// Whether a column shows more than one value.
pub(super) fn varies(column: &[f64]) -> bool {
    let mut known = column.iter().filter(|v| v.is_finite());
    known.next().is_some_and(|first| known.any(|v| v != first))
}

/// A column over all recordings: mean and standard deviation of its samples.
pub fn spread(series: &[Series], name: &str) -> (f64, f64) {
    let samples = || series.iter().filter_map(|s| s.column(name)).flatten().filter(|v| v.is_finite());
    let n = samples().count().max(1) as f64;
    let mean = samples().sum::<f64>() / n;
    let variance = samples().map(|v| (v - mean).powi(2)).sum::<f64>() / n;
    (mean, variance.sqrt().max(1e-12))
}

impl Prepared {
    /// Lays a column beside the inputs as a possible driver, in standard deviations from its mean.
    pub fn lay_extra(&mut self, name: &str, column: &[f64], (mean, deviation): (f64, f64)) {
        let values = filled(column);
        let mut row = 0;
        for tick in &mut self.stimulus.ticks {
            while row + 2 < self.time_s.len() && self.time_s[row + 1] <= tick.time_s {
                row += 1;
            }
            tick.extra = (linear(&self.time_s, &values, row, tick.time_s) - mean) / deviation;
            tick.extra_at_zero = -mean / deviation;
        }
        self.extra = Some(name.into());
    }
}
