//! What was written and lost since the gateway started: counted as it happens, so that it only grows.

use super::{Recorder, RecordingInfo, RecordingState, Running};
use crate::thruster::lock;

/// Rows and losses of a thruster since the gateway started.
#[derive(Clone, Copy, Debug, Default)]
pub struct Totals {
    /// Recordings that run.
    pub running: u64,
    /// Rows on the disk: of what is under way, since the last flush (every half second).
    pub rows: u64,
    /// Samples lost.
    pub lost: u64,
    /// Recordings that ended by themselves.
    pub failed: u64,
}

impl Recorder {
    /// How many run, and what was written and lost since the gateway started.
    pub fn totals(&self, thruster: &str) -> Totals {
        self.reap();
        let counted = lock(&self.totals).get(thruster).copied().unwrap_or_default();
        let runs = |running: &&Running| {
            running.thruster == thruster && lock(&running.info).state == RecordingState::Recording
        };
        Totals { running: lock(&self.running).iter().filter(runs).count() as u64, ..counted }
    }

    pub(super) fn count(&self, thruster: &str, add: impl FnOnce(&mut Totals)) {
        add(lock(&self.totals).entry(thruster.to_owned()).or_default());
    }

    /// Samples of a recording are missing.
    pub(super) fn count_lost(&self, info: &mut RecordingInfo, lost: u64) {
        info.lost_samples += lost;
        self.count(&info.thruster, |totals| totals.lost += lost);
    }

    /// The disk has so much of a recording now.
    pub(super) fn count_rows(&self, info: &mut RecordingInfo, rows: u64, duration_s: f64) {
        self.count(&info.thruster, |totals| totals.rows += rows - info.rows);
        (info.rows, info.duration_s) = (rows, duration_s);
    }
}
