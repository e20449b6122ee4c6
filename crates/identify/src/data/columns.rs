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

/// Columns that a model has no use for by itself but that may drive what is left: unknown ones,
/// and known ones that no part of the baseline reads. Every recording must have them, varying.
pub fn possible_drivers(series: &[Series]) -> Vec<String> {
    let Some(first) = series.first() else { return Vec::new() };
    let optional = ["supply_v", "temperature_c", "depth_m"];
    let varies = |column: &[f64]| {
        let known: Vec<f64> = column.iter().copied().filter(|v| v.is_finite()).collect();
        known.iter().any(|v| *v != known[0])
    };
    first
        .columns
        .iter()
        .map(|c| c.0.clone())
        .filter(|name| !KNOWN.contains(&name.as_str()) || optional.contains(&name.as_str()))
        .filter(|name| series.iter().all(|s| s.column(name).is_some_and(varies)))
        .collect()
}

impl Prepared {
    /// Lays an unknown column beside the inputs, standardised, as a possible driver.
    pub fn lay_extra(&mut self, column: &[f64]) {
        let values = filled(column);
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let deviation = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt().max(1e-12);
        let mut row = 0;
        for tick in &mut self.stimulus.ticks {
            while row + 2 < self.time_s.len() && self.time_s[row + 1] <= tick.time_s {
                row += 1;
            }
            tick.extra = (linear(&self.time_s, &values, row, tick.time_s) - mean) / deviation;
        }
    }
}
