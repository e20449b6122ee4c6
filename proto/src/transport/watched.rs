//! What the supervisor writes down beside the shared memory: how often it started each process, and what stood
//! latched and armed last. The first is read by the gateway for its metrics, the second by the next supervisor.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Processes and thrusters under a supervisor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Watched {
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
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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
}

impl Watched {
    /// Reads the file; nothing, or nothing readable, is as good as an empty one.
    pub fn read(path: &Path) -> Self {
        std::fs::read(path).ok().and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or_default()
    }

    /// Writes the file whole or not at all.
    ///
    /// # Errors
    /// The disk refuses.
    pub fn write(&self, path: &Path) -> std::io::Result<()> {
        let draft = path.with_extension("draft");
        std::fs::write(&draft, serde_json::to_vec(self)?)?;
        std::fs::rename(draft, path)
    }
}
