//! One recording of every thruster, on one time: begun at one instant, ended by one word.

use std::sync::Arc;
use std::time::SystemTime;

use kort_proto::transport::monotonic_ns;
use serde::Serialize;
use utoipa::ToSchema;

use super::{Recorder, RecordingInfo, Subject, check_new_name};
use crate::problem::{Kind, Problem};
use crate::token::Identity;

/// The instant at which the recordings of a set begin, all of them.
#[derive(Clone, Debug)]
pub struct Together {
    /// Name of the set.
    pub name: String,
    /// On the wall.
    pub began: SystemTime,
    /// On CLOCK_MONOTONIC, ns: zero of every recording's time.
    pub first_ns: u64,
}

/// A recording of every thruster.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct RecordingSet {
    /// Name of the set; its recordings are called `NAME-THRUSTER`.
    #[schema(example = "dive-1")]
    pub name: String,
    /// In the order of the configuration.
    pub recordings: Vec<RecordingInfo>,
}

impl Recorder {
    /// Starts one of every thruster; all of them, or none.
    pub fn start_set(
        self: &Arc<Self>,
        subjects: Vec<Subject>,
        who: &Identity,
        name: Option<String>,
        tags: &[String],
        rate_hz: f64,
    ) -> Result<RecordingSet, Problem> {
        let began = SystemTime::now();
        let name = name.unwrap_or_else(|| {
            let stamp = humantime::format_rfc3339_seconds(began).to_string().replace(['-', ':'], "");
            format!("all-{stamp}")
        });
        let names: Vec<String> =
            subjects.iter().map(|subject| format!("{name}-{}", subject.thruster.id)).collect();
        names.iter().try_for_each(|name| check_new_name("name", name))?;
        let together = Together { name, began, first_ns: monotonic_ns() };
        let mut recordings = Vec::new();
        for (subject, name) in subjects.into_iter().zip(names) {
            match self.start(subject, who, Some(name), tags.to_vec(), rate_hz, Some(&together)) {
                Ok(info) => recordings.push(info),
                Err(problem) => {
                    recordings.iter().for_each(|info| drop(self.stop(&info.name, who)));
                    return Err(problem);
                }
            }
        }
        Ok(RecordingSet { name: together.name, recordings })
    }

    /// Stops those of a set that still run; the first that the disk refused is the answer then, and the others are stopped all
    /// the same.
    pub fn stop_set(&self, name: &str, who: &Identity) -> Result<RecordingSet, Problem> {
        let running = self.names_running_of(name);
        if running.is_empty() {
            return Err(Problem::new(
                Kind::NoRecording,
                format!("no recording of a set {name:?} is running"),
            )
            .hint("POST /v1/recording-sets starts one of every thruster"));
        }
        let stopped: Vec<_> = running.iter().map(|name| self.stop(name, who)).collect();
        let recordings = stopped.into_iter().collect::<Result<_, _>>()?;
        Ok(RecordingSet { name: name.to_owned(), recordings })
    }
}
