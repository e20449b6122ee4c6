//! What the interface shows of a test signal.

use std::time::Instant;

use serde::Serialize;
use utoipa::ToSchema;

use super::{Commanded, Playing, Prepared};

/// Points of a preview.
const PREVIEW_POINTS: u32 = 1000;

/// A test signal: as it would be, as it plays, or as it ended.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ExcitationView {
    /// Its name: the scenario's, or the kinds of its segments.
    #[schema(example = "prbs")]
    pub name: String,
    /// What it commands.
    pub command: Commanded,
    /// No setpoint goes beyond this either way, N or rad/s.
    pub limit: f64,
    /// Largest size that it reaches, N or rad/s.
    pub peak: f64,
    /// Length, s.
    pub duration_s: f64,
    /// How long it has played, s.
    pub elapsed_s: f64,
    /// Where it stands.
    pub state: ExcitationState,
    /// Why it ended before its time; null else.
    pub ended_by: Option<String>,
    /// Recording made along with it; null if none is.
    pub recording: Option<String>,
    /// Diagnosis that was begun of it; null if none was.
    pub diagnosis: Option<String>,
    /// What its scenario says of the plant, which a thruster brings itself.
    pub left_out: Vec<String>,
    /// Its course: pairs of time, s, and value, N or rad/s.
    #[schema(value_type = Vec<Vec<f64>>)]
    pub preview: Vec<[f64; 2]>,
}

/// Where a test signal stands.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum ExcitationState {
    /// It was only asked what it would do.
    Preview,
    /// It plays.
    Playing,
    /// It came to its end.
    Complete,
    /// It was ended before.
    Ended,
}

/// The test signal that plays, in the state.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ExcitationStep {
    /// Its name.
    #[schema(example = "prbs")]
    pub name: String,
    /// How long it has played, s.
    pub elapsed_s: f64,
    /// Its length, s.
    pub duration_s: f64,
}

impl ExcitationView {
    /// What it would do.
    pub fn preview(signal: &Prepared) -> ExcitationView {
        let step_s = signal.duration_s / f64::from(PREVIEW_POINTS);
        let at = |i: u32| [f64::from(i) * step_s, signal.value(f64::from(i) * step_s)];
        ExcitationView {
            name: signal.name.clone(),
            command: signal.commanded,
            limit: signal.limit,
            peak: signal.peak,
            duration_s: signal.duration_s,
            elapsed_s: 0.0,
            state: ExcitationState::Preview,
            ended_by: None,
            recording: None,
            diagnosis: None,
            left_out: signal.left_out.clone(),
            preview: (0..PREVIEW_POINTS).map(at).collect(),
        }
    }

    /// How far it is, or how it ended.
    pub fn of(playing: &Playing, now: Instant) -> ExcitationView {
        let (state, ended_by) = match &playing.ended {
            None => (ExcitationState::Playing, None),
            Some(ended) if ended.why.is_none() => (ExcitationState::Complete, None),
            Some(ended) => (ExcitationState::Ended, ended.why.clone()),
        };
        ExcitationView {
            elapsed_s: playing.elapsed_s(now),
            state,
            ended_by,
            recording: playing.recording.clone(),
            diagnosis: playing.diagnosis.clone(),
            ..ExcitationView::preview(&playing.signal)
        }
    }
}
