//! What may follow an analysis: the experiment that a diagnosis proposes, and another with its recordings too.

use std::path::PathBuf;

use kort_scenario::Scenario;

use super::kept::{LAST_MINUTES, not_done};
use super::{Analyses, Analysis, DiagnosisInfo, JobState};
use crate::problem::{Kind, Problem};
use crate::record::ENDING;

/// Recordings that are fitted together at most.
pub const FILES_MAX: usize = 6;

impl Analyses {
    /// The next experiment that its report proposes.
    pub fn next_experiment(&self, info: &DiagnosisInfo) -> Result<Scenario, Problem> {
        if info.job.state != JobState::Done {
            return Err(not_done(info));
        }
        let report = self.report(info);
        let scenario = &report["next_experiment"]["scenario"];
        if scenario.is_null() {
            return Err(Problem::new(
                Kind::Refused,
                format!("diagnosis {} proposes no experiment", info.job.id),
            )
            .hint("it leaves nothing open that a test signal could part"));
        }
        serde_json::from_value(scenario.clone()).map_err(|error| {
            Problem::new(Kind::Internal, format!("the experiment of {}: {error}", info.job.id))
        })
    }

    /// Files of all that an analysis was made of, first to last.
    pub(super) fn recordings_of<A: Analysis>(&self, of: &A, most: usize) -> Result<Vec<PathBuf>, Problem> {
        if most == 0 {
            return Err(Problem::new(
                Kind::Refused,
                format!("more than {FILES_MAX} recordings would be fitted together"),
            )
            .hint("begin anew with the last of them"));
        }
        let job = of.job();
        let mut files = match &job.after {
            Some(id) => self.recordings_of(&self.find::<A>(&job.thruster, id)?, most - 1)?,
            None => Vec::new(),
        };
        let file = match &job.recording {
            Some(name) => self.recordings.join(format!("{name}.{ENDING}")),
            None => self.folder_of(A::KIND).join(&job.id).join(LAST_MINUTES),
        };
        if !file.is_file() {
            let what = job
                .recording
                .as_deref()
                .map_or("the last minutes".into(), |name| format!("recording {name:?}"));
            return Err(Problem::new(
                Kind::UnknownRecording,
                format!(
                    "{what}, which {} {} was made of, is not there any more",
                    A::KIND.entry().name,
                    job.id
                ),
            )
            .hint("leave `after` out: the new recording alone"));
        }
        files.push(file);
        Ok(files)
    }
}
