//! What the interface shows of every analysis, whatever its kind.

use std::time::Instant;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::AnalysisKind;

/// A diagnosis or a fit, running or past.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct JobInfo {
    /// Its name.
    #[schema(example = "t1-20260101T120000Z")]
    pub id: String,
    /// The thruster.
    #[schema(example = "t1")]
    pub thruster: String,
    /// Who asked for it: name of the token, `local` where none is asked for.
    pub owner: String,
    /// How far it is.
    pub state: JobState,
    /// Of what: `recording NAME`, or `the last N s`.
    #[schema(example = "the last 300 s")]
    pub of: String,
    /// Name of the recording that it is of; null for the last minutes.
    #[serde(default)]
    pub recording: Option<String>,
    /// The one before it whose recordings are fitted together with this one; null if it stands alone.
    #[serde(default)]
    pub after: Option<String>,
    /// Number of the rig's revision that it is compared with.
    pub rig_number: u32,
    /// That revision, as recordings name it.
    pub rig_revision: String,
    /// When it began, RFC 3339.
    pub started: String,
    /// What it is at; null before its first step and after its end.
    #[serde(default)]
    pub step: Option<String>,
    /// Time it took so far, s.
    pub elapsed_s: f64,
    /// Why it failed; null else.
    #[serde(default)]
    pub cause: Option<String>,
    /// Rows were lost in reading, or left out because a sensor misbehaves there: the report's notes say which.
    #[serde(default)]
    pub lossy: bool,
    /// Is there something in it that the rig can take over (`POST …/rig` with its id)?
    #[serde(default)]
    pub usable: bool,
}

/// How far a diagnosis or a fit is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum JobState {
    /// Its process runs.
    Running,
    /// There is a report.
    Done,
    /// There is none; `cause` says why.
    Failed,
    /// Somebody ended it.
    Cancelled,
}

/// The one that runs, as its thruster's state knows it.
#[derive(Clone, Debug)]
pub struct Underway {
    /// Which kind.
    pub kind: AnalysisKind,
    /// Its name.
    pub id: String,
    /// What it is at.
    pub step: String,
    /// When it began.
    pub began: Instant,
}

/// How far the diagnosis or the fit of a thruster is.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct JobStep {
    /// Its name.
    #[schema(example = "t1-20260101T120000Z")]
    pub id: String,
    /// What it is at.
    #[schema(example = "trying every effect")]
    pub step: String,
    /// Time it took so far, s.
    pub elapsed_s: f64,
}
