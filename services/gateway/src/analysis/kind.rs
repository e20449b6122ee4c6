//! The kinds of analyses, and all in which they differ but what their reports say.

use std::ffi::OsString;
use std::path::Path;

use kort_proto::events::EventKind;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::JobInfo;
use super::kept::PAGE;
use crate::problem::Kind as Problems;

/// What is made of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnalysisKind {
    /// `kort diagnose`: what the model left out.
    Diagnosis,
    /// `kort fit`: the model's parameters.
    Fit,
}

/// An analysis of one kind, as the interface shows it; from its [`JobInfo`] alone while nothing came out of it.
pub trait Analysis: From<JobInfo> + Serialize + DeserializeOwned + Send + 'static {
    /// Which kind.
    const KIND: AnalysisKind;

    /// One that is done: what its report says of the rig description that it was compared with.
    fn done(job: JobInfo, report: &Value, rig: &str) -> Self;

    /// What every kind has.
    fn job(&self) -> &JobInfo;

    /// What came out of it, for the event log.
    fn words(&self) -> String;
}

/// How a kind is called, and what it is refused and told as.
#[derive(Clone, Copy, Debug)]
pub struct Entry {
    /// In words.
    pub name: &'static str,
    /// Subcommand of `kort` that makes it.
    pub command: &'static str,
    /// Last part of its route.
    pub route: &'static str,
    /// What becomes of a thruster meanwhile.
    pub being: &'static str,
    /// There is none of this name.
    pub unknown: Problems,
    /// One runs.
    pub active: Problems,
    /// The rig can take nothing over of one: why, and where to look.
    pub nothing: (&'static str, &'static str),
    /// One began.
    pub started: EventKind,
    /// One is done.
    pub done: EventKind,
    /// One came to nothing.
    pub failed: EventKind,
    /// One was ended on request.
    pub cancelled: EventKind,
    /// One was deleted.
    pub deleted: EventKind,
}

impl AnalysisKind {
    /// How it is called, and what it is refused and told as.
    pub const fn entry(self) -> Entry {
        match self {
            Self::Diagnosis => Entry {
                name: "diagnosis",
                command: "diagnose",
                route: "diagnoses",
                being: "diagnosed",
                unknown: Problems::UnknownDiagnosis,
                active: Problems::DiagnosisActive,
                nothing: (
                    "found nothing that is probable enough for the rig to take over",
                    "names of probability 0.7 and more without a rival count; its report says what is missing",
                ),
                started: EventKind::DiagnosisStarted,
                done: EventKind::DiagnosisDone,
                failed: EventKind::DiagnosisFailed,
                cancelled: EventKind::DiagnosisCancelled,
                deleted: EventKind::DiagnosisDeleted,
            },
            Self::Fit => Entry {
                name: "fit",
                command: "fit",
                route: "fits",
                being: "fitted",
                unknown: Problems::UnknownFit,
                active: Problems::FitActive,
                nothing: ("found no value that differs from the rig's", "its report lists what was fitted"),
                started: EventKind::FitStarted,
                done: EventKind::FitDone,
                failed: EventKind::FitFailed,
                cancelled: EventKind::FitCancelled,
                deleted: EventKind::FitDeleted,
            },
        }
    }

    /// Arguments that its command has beside those of every kind.
    pub fn arguments(self, folder: &Path) -> Vec<OsString> {
        match self {
            Self::Diagnosis => vec!["--html".into(), folder.join(PAGE).into()],
            Self::Fit => Vec::new(),
        }
    }
}
