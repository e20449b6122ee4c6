//! What may follow a diagnosis: the experiment that it proposes, and one of its recordings together with more.

use std::path::PathBuf;

use kort_scenario::Scenario;

use super::{Diagnoses, DiagnosisInfo, DiagnosisState, LAST_MINUTES};
use crate::problem::{Kind, Problem};
use crate::record::ENDING;

/// Recordings that are diagnosed together at most.
pub const FILES_MAX: usize = 6;

impl Diagnoses {
    /// The next experiment that its report proposes.
    pub fn next_experiment(&self, info: &DiagnosisInfo) -> Result<Scenario, Problem> {
        if info.state != DiagnosisState::Done {
            return Err(self.not_done(info));
        }
        let report = self.report(info);
        let scenario = &report["next_experiment"]["scenario"];
        if scenario.is_null() {
            return Err(Problem::new(Kind::Refused, format!("diagnosis {} proposes no experiment", info.id))
                .hint("it leaves nothing open that a test signal could part"));
        }
        serde_json::from_value(scenario.clone())
            .map_err(|error| Problem::new(Kind::Internal, format!("the experiment of {}: {error}", info.id)))
    }

    /// Files of all that a diagnosis was made of, first to last.
    pub(super) fn recordings_of(&self, info: &DiagnosisInfo, most: usize) -> Result<Vec<PathBuf>, Problem> {
        if most == 0 {
            return Err(Problem::new(
                Kind::Refused,
                format!("more than {FILES_MAX} recordings would be diagnosed together"),
            )
            .hint("begin anew with the last of them"));
        }
        let mut files = match &info.after {
            Some(id) => self.recordings_of(&self.find(&info.thruster, id)?, most - 1)?,
            None => Vec::new(),
        };
        let file = match &info.recording {
            Some(name) => self.recordings.join(format!("{name}.{ENDING}")),
            None => self.folder.join(&info.id).join(LAST_MINUTES),
        };
        if !file.is_file() {
            let what = info
                .recording
                .as_deref()
                .map_or("the last minutes".into(), |name| format!("recording {name:?}"));
            return Err(Problem::new(
                Kind::UnknownRecording,
                format!("{what}, which diagnosis {} was made of, is not there any more", info.id),
            )
            .hint("diagnose the new recording alone"));
        }
        files.push(file);
        Ok(files)
    }
}
