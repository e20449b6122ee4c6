//! Measured responses.

use kort_thruster::rig::Rig;

use super::{FEWEST_ROWS, Prepared, Response, Series};
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
    /// Usual time from sample to sample, s, where that is longer than from row to row, as the log shows or the rig states.
    pub slow_s: Option<f64>,
    /// The same, where the log holds each sample until the next one comes and no row tells them apart: an analogue output
    /// read at every row adds its own noise to each.
    pub held_s: Option<f64>,
}

impl Channel {
    /// A column's samples; none where they never change, unless nothing does (`at_rest`): then that is what is to be said.
    pub(super) fn new(series: &Series, rig: &Rig, response: Response, at_rest: bool) -> Option<Self> {
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
        let held_s = sensor_s(rig, response).filter(|sensor_s| is_slow(*sensor_s, interval_s));
        let usable = values.len() >= FEWEST_ROWS && (at_rest || !constant && full_scale > 0.0);
        usable.then_some(Self {
            response,
            rows,
            values,
            full_scale: if full_scale > 0.0 { full_scale } else { 1.0 },
            slow_s: held_s.or_else(|| {
                Some(interval_s).filter(|interval_s| is_slow(*interval_s, median_interval(&series.time_s)))
            }),
            held_s,
        })
    }
}

impl Prepared {
    /// What is said of channels whose samples are held over rows that do not tell them apart.
    pub fn held_samples(&self) -> impl Iterator<Item = String> {
        let held =
            self.channels.iter().filter_map(|channel| Some((channel.response.name(), channel.held_s?)));
        held.map(|(column, held_s)| {
            format!(
                "{}: {column} has a value in every row, and the rig states {:.3} readings a second: each is taken to be held until the next one comes; better leave the cells empty where nothing new was read",
                self.name,
                1.0 / held_s
            )
        })
    }
}

/// Time from one sample of a sensor to its next, as the rig states it, s.
fn sensor_s(rig: &Rig, response: Response) -> Option<f64> {
    let rate_hz = rig.sensors.flow_rate_hz.filter(|_| response == Response::Flow)?;
    Some(1.0 / rate_hz)
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
