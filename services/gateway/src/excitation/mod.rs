//! Test signals on a thruster: the setpoint follows a prepared signal instead of a hand, under the lease and within a
//! limit, until it is complete or anything else ends it.
//!
//! The signal itself is [`kort_scenario::Excitation`], the one that `kort simulate` runs. Pure: the caller hands in the
//! time.

mod follow;
mod prepare;
mod view;

use std::sync::Arc;
use std::time::{Duration, Instant};

pub use follow::{After, follow};
pub use prepare::{Commanded, Prepared, Wanted, from_scenario, without_replay};
pub use view::{ExcitationStep, ExcitationView};

use crate::view::Setpoint;

/// A signal at work, or the last one that was.
#[derive(Clone, Debug)]
pub struct Playing {
    /// Which one, counted from the gateway's start.
    pub number: u64,
    /// The signal.
    pub signal: Arc<Prepared>,
    /// Who began it.
    pub who: String,
    /// When it began.
    pub began: Instant,
    /// Recording that runs along.
    pub recording: Option<String>,
    /// How it ended; none while it plays.
    pub ended: Option<Ended>,
    /// Diagnosis that was begun of it.
    pub diagnosis: Option<String>,
}

/// How a signal ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Ended {
    /// After how long.
    pub after: Duration,
    /// Why, where it did not come to its end.
    pub why: Option<String>,
}

impl Playing {
    /// The setpoint at this instant; none once it is complete.
    pub fn setpoint(&self, now: Instant) -> Option<Setpoint> {
        let time_s = now.saturating_duration_since(self.began).as_secs_f64();
        (time_s < self.signal.duration_s).then(|| self.signal.setpoint(time_s))
    }

    /// How long it has played.
    pub fn elapsed_s(&self, now: Instant) -> f64 {
        let after = self.ended.as_ref().map(|ended| ended.after);
        after.unwrap_or_else(|| now.saturating_duration_since(self.began)).as_secs_f64()
    }
}
