//! What the interface shows of a diagnosis.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A diagnosis, running or past.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DiagnosisInfo {
    /// Its name.
    #[schema(example = "t1-20260101T120000Z")]
    pub id: String,
    /// The thruster.
    #[schema(example = "t1")]
    pub thruster: String,
    /// Who asked for it: name of the token, `local` where none is asked for.
    pub owner: String,
    /// How far it is.
    pub state: DiagnosisState,
    /// Of what: `recording NAME`, or `the last N s`.
    #[schema(example = "the last 300 s")]
    pub of: String,
    /// Name of the recording that it is of; null for the last minutes.
    #[serde(default)]
    pub recording: Option<String>,
    /// Diagnosis whose recordings are fitted together with this one; null if it stands alone.
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
    /// Its verdict; null until it is done.
    #[serde(default)]
    #[schema(example = "explained")]
    pub verdict: Option<String>,
    /// Its summary; null until it is done.
    #[serde(default)]
    pub summary: Option<String>,
    /// Effects that it names, best first.
    #[serde(default)]
    pub findings: Vec<FindingView>,
    /// Is there something in it that the rig can take over (`POST …/rig` with its id)?
    #[serde(default)]
    pub usable: bool,
}

/// An effect that a diagnosis names.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct FindingView {
    /// Its identifier in the catalogue.
    #[schema(example = "coulomb_friction")]
    pub effect: String,
    /// drive, shaft, blade, flow or sensor.
    pub path: String,
    /// Probability that it is present.
    #[schema(minimum = 0, maximum = 1)]
    pub probability: f64,
    /// In an engineer's words.
    pub statement: String,
    /// Share of the held-out squared error above the noise that it removes.
    pub excess_error_removed: Option<f64>,
}

/// How far a diagnosis is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum DiagnosisState {
    /// Its process runs.
    Running,
    /// There is a report.
    Done,
    /// There is none; `cause` says why.
    Failed,
    /// Somebody ended it.
    Cancelled,
}

impl DiagnosisInfo {
    /// For the event log, once it is done.
    pub fn done_words(&self) -> String {
        let names: Vec<String> =
            self.findings.iter().map(|f| format!("{} ({:.2})", f.effect, f.probability)).collect();
        let names = if names.is_empty() { "no name".into() } else { names.join(", ") };
        format!("diagnosis {}: {}, {names}", self.id, self.verdict.as_deref().unwrap_or("no verdict"))
    }
}
