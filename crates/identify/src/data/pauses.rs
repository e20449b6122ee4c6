//! Pauses of a log: rows before and after it belong to one recording, but nobody looked in between.

use kort_thruster::plant::Leap;

use super::{Prepared, Series};
use crate::spectrum::median_interval;

/// A log that is silent for longer may have paused, s: whatever was fast has been forgotten by then.
const SILENT_S: f64 = 5.0;
/// Usual intervals from row to row that a pause is longer than.
const INTERVALS: f64 = 50.0;

/// The interval from row to row beyond which a log has paused, s.
pub fn pause_s(time_s: &[f64]) -> f64 {
    SILENT_S.max(INTERVALS * median_interval(time_s))
}

/// Whether a log ever paused.
pub(super) fn has_paused(time_s: &[f64]) -> bool {
    let most_s = pause_s(time_s);
    time_s.windows(2).any(|t| t[1] - t[0] > most_s)
}

/// Control ticks that nobody looks at.
pub(super) struct Pause {
    /// The first row after it.
    pub(super) row: usize,
    /// The first tick that is left out.
    pub(super) from: usize,
    /// The first one after it.
    pub(super) to: usize,
}

impl Prepared {
    /// Whether the log paused just before a row.
    pub fn after_pause(&self, row: usize) -> bool {
        row > 0 && self.time_s[row] - self.time_s[row - 1] > self.pause_s
    }

    /// Its pauses, in ticks from its start. The simulation goes on a tick before the row after each.
    pub(super) fn pauses(&self) -> Vec<Pause> {
        let at = |row: usize| (self.time_s[row] - self.time_s[0]) / self.tick_s;
        let pause = |row: usize| Pause {
            row,
            from: (at(row - 1) - 0.02).ceil().max(0.0) as usize + 1,
            to: (at(row) - 0.02).floor() as usize - 1,
        };
        (1..self.time_s.len()).filter(|row| self.after_pause(*row)).map(pause).collect()
    }
}

/// The leap to a row: the state there, where it was recorded.
pub(super) fn leap_to(series: &Series, row: usize, tick: usize) -> Leap {
    let there = |name: &str| {
        let samples = series.column(name)?.iter().skip(row).take(10);
        samples.copied().find(|v| v.is_finite())
    };
    let names = ["shaft_speed_rad_s", "flow_m_s", "current_a", "shaft_angle_rad"];
    Leap { tick, state: names.map(there), ..Leap::default() }
}

impl Prepared {
    /// What the recording's rows within its pauses say of what went on there, where somebody left rows out of it.
    pub fn lay_means(&mut self, whole: &Series) {
        let after: Vec<usize> = (0..self.time_s.len()).filter(|row| self.after_pause(*row)).collect();
        for (leap, row) in self.leaps.iter_mut().zip(after) {
            let (from_s, to_s) = (self.time_s[row - 1], self.time_s[row]);
            let rows =
                whole.time_s.partition_point(|t| *t <= from_s)..whole.time_s.partition_point(|t| *t < to_s);
            let mean = |name: &str, of: fn(f64) -> f64| {
                let samples = whole.column(name)?.get(rows.clone())?.iter().filter(|v| v.is_finite());
                let (count, sum) = samples.fold((0, 0.0), |(n, sum), v| (n + 1, sum + of(*v)));
                (count > 0).then(|| sum / f64::from(count))
            };
            leap.speed_rad_s = mean("shaft_speed_rad_s", f64::abs);
            leap.flow_m_s = mean("flow_m_s", |v| v);
            leap.current_a = mean("current_a", |v| v * v).map(f64::sqrt);
        }
    }
}
