//! What is known of a recording: beside it on disk, and in every answer.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A recording, running or done.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub struct RecordingInfo {
    /// Name; the file is `NAME.mcap`. What a full file is followed by is called `NAME-2`, `NAME-3`, ….
    #[schema(example = "t1-20260101T120000Z")]
    pub name: String,
    /// The thruster.
    #[schema(example = "t1")]
    pub thruster: String,
    /// The set that it was started with, one recording of every thruster on one time; null if it was started alone.
    #[serde(default)]
    pub set: Option<String>,
    /// Who started it: name of the token, `local` where none is asked for.
    #[serde(default)]
    pub owner: String,
    /// Words to find it by, in the order given.
    #[serde(default)]
    #[schema(example = json!(["bollard", "new-propeller"]))]
    pub tags: Vec<String>,
    /// Is it running, complete, torn or failed?
    pub state: RecordingState,
    /// Why it ended by itself; null if it runs or was stopped.
    #[serde(default)]
    pub cause: Option<String>,
    /// Wall time of the first row, RFC 3339.
    pub started: String,
    /// Largest rate of rows, Hz.
    pub rate_hz: f64,
    /// Rows on the disk: of what is under way, since the last flush (every half second).
    pub rows: u64,
    /// From the first row to the last, s.
    pub duration_s: f64,
    /// Samples of the servo that are missing because the gateway or the disk came too late.
    pub lost_samples: u64,
    /// Size of the file, bytes, by its ending.
    #[serde(default)]
    pub bytes: BTreeMap<String, u64>,
}

/// State of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum RecordingState {
    /// Rows are being written.
    Recording,
    /// Ended, whole.
    Complete,
    /// The gateway was killed while it ran: readable up to its last second.
    Torn,
    /// The disk refused: readable up to what it took; `cause` says why.
    Failed,
    /// Its file was moved or removed by hand: it cannot be fetched, and DELETE takes it off the list.
    Gone,
}
