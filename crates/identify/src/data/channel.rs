//! Measured responses.

use super::{FEWEST_ROWS, Response, Series};
use crate::spectrum::{is_slow, median_interval};

/// Samples of one response.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Which response.
    pub response: Response,
    /// Log rows where it was sampled.
    pub rows: Vec<usize>,
    /// The samples.
    pub values: Vec<f64>,
    /// Largest magnitude (99.5 % quantile), the full scale that errors are compared with.
    pub full_scale: f64,
    /// Usual time from sample to sample, s, where that is longer than from row to row.
    pub slow_s: Option<f64>,
}

impl Channel {
    pub(super) fn new(series: &Series, response: Response) -> Option<Self> {
        let column = series.column(response.name())?;
        let rows: Vec<usize> = (0..column.len()).filter(|k| column[*k].is_finite()).collect();
        let mut values: Vec<f64> = rows.iter().map(|k| column[*k]).collect();
        if response == Response::ShaftAngle {
            rates(&mut values, &rows, &series.time_s);
        }
        let mut size: Vec<f64> = values.iter().map(|v| v.abs()).collect();
        size.sort_by(f64::total_cmp);
        let full_scale = size.get(((size.len() as f64) * 0.995) as usize).copied().unwrap_or(0.0);
        let constant = values.iter().all(|v| *v == values[0]);
        let times: Vec<f64> = rows.iter().map(|row| series.time_s[*row]).collect();
        let interval_s = median_interval(&times);
        (values.len() >= FEWEST_ROWS && !constant && full_scale > 0.0).then_some(Self {
            response,
            rows,
            values,
            full_scale,
            slow_s: Some(interval_s)
                .filter(|interval_s| is_slow(*interval_s, median_interval(&series.time_s))),
        })
    }
}

/// Samples turned into mean rates since the sample before; the first has none and is zero.
pub fn rates(values: &mut [f64], rows: &[usize], time_s: &[f64]) {
    for k in (1..values.len()).rev() {
        values[k] = (values[k] - values[k - 1]) / (time_s[rows[k]] - time_s[rows[k - 1]]);
    }
    if let Some(first) = values.first_mut() {
        *first = 0.0;
    }
}
