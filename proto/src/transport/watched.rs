//! What the supervisor writes down beside the shared memory: how often it started each process, and what stood
//! latched and armed last. The first is read by the gateway for its metrics, the second by the next supervisor.

use std::collections::BTreeMap;
use std::path::Path;
use std::time::SystemTime;

use serde::{Deserialize, Serialize};

use super::error::TransportError;
use super::ours::{ours_alone, write_whole};
use crate::events::Before;

/// Processes and thrusters under a supervisor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Watched {
    /// The shared memory that all of this was seen in.
    pub generation: Option<u64>,
    /// Starts beyond the first, by process and thruster.
    pub restarts: Vec<Restarts>,
    /// What stood last, by thruster.
    pub thrusters: BTreeMap<String, Stood>,
}

/// How often a process was started anew.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Restarts {
    /// `servo`, `controller` or `gateway`.
    pub process: String,
    /// Its thruster; none for the gateway.
    pub thruster: Option<String>,
    /// Starts beyond the first.
    pub count: u64,
    /// Its process now; none while it is away.
    pub pid: Option<u32>,
}

/// How a thruster stood when it was last looked at.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Stood {
    /// Was the drive armed?
    pub armed: bool,
    /// Faults latched by the servo, bits.
    pub servo_faults: u64,
    /// Faults latched by the controller, bits.
    pub controller_faults: u64,
    /// Thrust, N; absent if not measured.
    pub thrust_n: Option<f64>,
    /// Shaft speed, rad/s; absent if not measured.
    pub shaft_speed_rad_s: Option<f64>,
    /// When the servo was last heard: wall time, RFC 3339, which a start of the machine does not set back.
    pub heard: Option<String>,
    /// What it did when it was last heard armed and not ramped down.
    pub driven: Option<Before>,
    /// How each latched fault came: whoever finds it at a later start tells it as old as it is.
    pub latched: Vec<Latched>,
}

/// A latched fault and how it came.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Latched {
    /// Code of the fault.
    pub code: u32,
    /// When it was latched: wall time, RFC 3339.
    pub since: String,
    /// What the thruster did just before, if that stopped it.
    pub before: Option<Before>,
}

impl Stood {
    /// A time as it is written here.
    pub fn time(at: SystemTime) -> String {
        humantime::format_rfc3339_micros(at).to_string()
    }
}

impl Watched {
    /// Reads the file; nothing, nothing readable, or what somebody else could have written is as good as an empty one.
    pub fn read(path: &Path) -> Self {
        let text = ours_alone(path).ok().and_then(|()| std::fs::read(path).ok());
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// [`TransportError::Foreign`] if somebody else could write there, [`TransportError::File`] if the disk refuses.
    pub fn write(&self, path: &Path) -> Result<(), TransportError> {
        let file_error =
            |error: serde_json::Error| TransportError::File { path: path.to_path_buf(), error: error.into() };
        let bytes = serde_json::to_vec(self).map_err(file_error)?;
        let mut draft = path.as_os_str().to_owned();
        draft.push(".new");
        write_whole(path, Path::new(&draft), &bytes)
    }
}
