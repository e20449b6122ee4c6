//! What the interface shows of a diagnosis.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use super::{Analysis, AnalysisKind, JobInfo};

/// A diagnosis, running or past.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct DiagnosisInfo {
    #[serde(flatten)]
    pub job: JobInfo,
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
    /// Why a rig description does not take it over; null where it does.
    #[serde(default)]
    pub not_adopted: Option<String>,
}

impl From<JobInfo> for DiagnosisInfo {
    fn from(job: JobInfo) -> DiagnosisInfo {
        DiagnosisInfo { job, verdict: None, summary: None, findings: Vec::new() }
    }
}

impl Analysis for DiagnosisInfo {
    const KIND: AnalysisKind = AnalysisKind::Diagnosis;

    fn done(job: JobInfo, report: &Value, _rig: &str) -> DiagnosisInfo {
        let text = |value: &Value| value.as_str().map(str::to_owned);
        let findings = report["findings"].as_array().into_iter().flatten();
        DiagnosisInfo {
            job,
            verdict: text(&report["verdict"]),
            summary: text(&report["summary"]),
            findings: findings
                .map(|finding| FindingView {
                    effect: text(&finding["effect"]).unwrap_or_default(),
                    path: text(&finding["path"]).unwrap_or_default(),
                    probability: finding["probability"].as_f64().unwrap_or(0.0),
                    statement: text(&finding["statement"]).unwrap_or_default(),
                    excess_error_removed: finding["heldout"]["excess_error_removed"].as_f64(),
                    not_adopted: text(&finding["not_adopted"]),
                })
                .collect(),
        }
    }

    fn job(&self) -> &JobInfo {
        &self.job
    }

    fn words(&self) -> String {
        let names: Vec<String> =
            self.findings.iter().map(|f| format!("{} ({:.2})", f.effect, f.probability)).collect();
        let names = if names.is_empty() { "no name".into() } else { names.join(", ") };
        format!("{}, {names}", self.verdict.as_deref().unwrap_or("no verdict"))
    }
}
