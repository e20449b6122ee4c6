//! What the interface shows of a calibration.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A calibration, running or past.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct CalibrationInfo {
    /// Its name.
    #[schema(example = "t1-20260101T120000Z")]
    pub id: String,
    /// The thruster.
    #[schema(example = "t1")]
    pub thruster: String,
    /// Who asked for it: name of the token, `local` where none is asked for.
    pub owner: String,
    /// How far it is.
    pub state: CalibrationState,
    /// Share of the largest drive that it goes up to.
    pub share: f64,
    /// Number of the rig's revision that it begins from.
    pub rig_number: u32,
    /// That revision, as recordings name it.
    pub rig_revision: String,
    /// When it began, RFC 3339.
    pub started: String,
    /// What it is at: a stage of the session, then a step of the estimation; null before and after.
    pub stage: Option<String>,
    /// What this stage is about to do and how far the shaft will turn, while it waits for `…/go-on`; null else.
    pub asks: Option<String>,
    /// Does it hold the thruster? Else the session is over, or not begun.
    pub drives: bool,
    /// Time it took so far, s.
    pub elapsed_s: f64,
    /// Why it did not come to its end; null else.
    pub cause: Option<String>,
}

/// How far a calibration is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum CalibrationState {
    /// It runs.
    Running,
    /// It is done: there are a rig description, a recording and a report.
    Done,
    /// It stopped by itself, because something was not as it should be.
    Stopped,
    /// Somebody ended it, or its lease did.
    Aborted,
    /// It could not be made.
    Failed,
}

impl CalibrationState {
    /// As the interface names it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Done => "done",
            Self::Stopped => "stopped",
            Self::Aborted => "aborted",
            Self::Failed => "failed",
        }
    }
}

/// How far the calibration of a thruster is.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct CalibrationStep {
    /// Its name.
    #[schema(example = "t1-20260101T120000Z")]
    pub id: String,
    /// What it is at.
    #[schema(example = "first_movement")]
    pub stage: String,
    /// What this stage is about to do and how far the shaft will turn, while it waits for `…/go-on`; null else.
    pub asks: Option<String>,
    /// Does it hold the thruster?
    pub drives: bool,
    /// Time it took so far, s.
    pub elapsed_s: f64,
}
