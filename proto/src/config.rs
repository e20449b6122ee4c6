//! `kort.toml`: one deployment. Every process reads the same file and takes its part; a section
//! that only one process understands is kept as a table and read by that process.

mod read;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

use serde::Deserialize;
use thiserror::Error;
use toml::Table;

use read::hinted;
pub use read::is_told_by;

/// Where the deployment is looked for unless `--config` says otherwise.
pub const DEFAULT_PATH: &str = "config/kort.toml";

/// The law that `kort explain --for RIG` names for a rig.
pub const DEFAULT_LAW: &str = "default";

/// The deployment and the rig it names, built in: a moved program still starts.
const BUILT_IN: &str = include_str!("../../config/kort.toml");

/// What to do where no rig is named.
const NO_RIG: &str =
    "a rig description relative to this file, for example \"thrusters/whitcomb-yoerger-1999.toml\"";

/// Rig descriptions built in, by the path that a deployment names them with.
const BUILT_IN_RIGS: &[(&str, &str)] = &[(
    "thrusters/whitcomb-yoerger-1999.toml",
    include_str!("../../config/thrusters/whitcomb-yoerger-1999.toml"),
)];

/// Why a configuration cannot be used; the message names file, key, value and what is allowed.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{file}: {message}")]
pub struct ConfigError {
    /// The file, or "built-in configuration".
    pub file: String,
    /// What is wrong, with a hint.
    pub message: String,
}

/// One deployment.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Config {
    /// The file it came from; `None` for the built-in one.
    #[serde(skip)]
    pub file: Option<PathBuf>,
    /// Where all that is wrong is asked for: what is wrong with the sections that services read.
    #[serde(skip)]
    noted: Option<Arc<Mutex<Vec<ConfigError>>>>,
    /// Shared memory.
    #[serde(default)]
    pub transport: Transport,
    /// The gateway's own section, see `kort gateway --help`.
    #[serde(default)]
    pub gateway: Table,
    /// Thrusters by id.
    #[serde(default)]
    pub thrusters: BTreeMap<String, Thruster>,
}

/// Shared memory.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Transport {
    /// Folder of the shared memory; empty chooses one of the user's.
    pub root: PathBuf,
}

/// One thruster.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Thruster {
    /// Rig description, relative to the file. Without it, and without a drive, the rest is read and told all the same.
    #[serde(default)]
    pub rig: PathBuf,
    /// Which drive: `simulated`, or the kind of a real one.
    #[serde(default)]
    pub amplifier: String,
    /// The real drive's wire and settings, read by the servo.
    #[serde(default)]
    pub drive: Table,
    /// Sources of measurements beside the drive by name, read by the servo.
    #[serde(default)]
    pub sensors: BTreeMap<String, Table>,
    /// The simulated stand, read by the servo.
    #[serde(default)]
    pub simulation: Table,
    /// The servo's loop.
    #[serde(default)]
    pub servo: ServoLoop,
    /// The controller's loop and law.
    #[serde(default)]
    pub controller: ControllerLoop,
    /// Limits that the servo enforces.
    #[serde(default)]
    pub limits: Table,
    /// Sensor checks of the servo.
    #[serde(default)]
    pub checks: Table,
}

/// The servo's loop.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoLoop {
    /// Rate, Hz, 100 to 5000.
    pub rate_hz: f64,
    /// SCHED_FIFO priority, 1 to 90; zero leaves the scheduler alone.
    pub priority: i32,
    /// Cores that the loop, and the threads of its devices, are kept on, counted from zero; none: wherever the system likes.
    pub cores: Vec<usize>,
}

impl Default for ServoLoop {
    fn default() -> Self {
        Self { rate_hz: 1000.0, priority: 80, cores: Vec::new() }
    }
}

/// The controller's loop and law.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ControllerLoop {
    /// Rate, Hz, 10 to the servo's rate; the servo's rate is a whole multiple of it.
    pub rate_hz: f64,
    /// SCHED_FIFO priority, 1 to 90; zero leaves the scheduler alone.
    pub priority: i32,
    /// Cores that the loop is kept on, as the servo's.
    pub cores: Vec<usize>,
    /// Law, observer, estimator and their options: a file of `config/controllers`, relative to
    /// this file; empty takes the defaults of the law.
    pub file: PathBuf,
    /// Law that runs at start, or [`DEFAULT_LAW`]; left out: the one of the file, without a file the default too.
    pub law: Option<String>,
    /// Time in which a setpoint may go from zero to the largest, s, 0 to 60; left out: what suits the law.
    pub setpoint_rise_s: Option<f64>,
}

impl Default for ControllerLoop {
    fn default() -> Self {
        Self {
            rate_hz: 250.0,
            priority: 70,
            cores: Vec::new(),
            file: PathBuf::new(),
            law: None,
            setpoint_rise_s: None,
        }
    }
}

impl ControllerLoop {
    /// Does the rig's own default run: is it asked for, or nothing else stated?
    pub fn takes_default(&self) -> bool {
        self.law.as_deref().map_or(self.file == Path::new(""), |law| law == DEFAULT_LAW)
    }
}

impl Thruster {
    /// Period of the servo's loop, ns.
    pub fn servo_period_ns(&self) -> u64 {
        (1e9 / self.servo.rate_hz).round() as u64
    }

    /// Servo ticks in one controller tick.
    pub fn ticks_per_command(&self) -> u64 {
        (self.servo.rate_hz / self.controller.rate_hz).round().max(1.0) as u64
    }

    /// Period of the controller's loop, ns.
    pub fn controller_period_ns(&self) -> u64 {
        self.ticks_per_command() * self.servo_period_ns()
    }
}

/// Is something there, readable or not? What stands in the place of the default file is no reason for the one built in.
pub fn is_there(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

impl Config {
    /// Reads the deployment at `path`; without one the default file if it is there, else the one
    /// built in.
    ///
    /// # Errors
    /// [`ConfigError`] if it cannot be read, holds an unknown key or a value that is not allowed.
    pub fn load(path: Option<&Path>) -> Result<Self, ConfigError> {
        sound(Self::load_any(path))
    }

    /// As [`Self::load`], with everything that is wrong, and what can be read all the same: loops that are not allowed are the
    /// usual ones there, and sections that services read are read without what is wrong with them, which [`Self::noted`] tells.
    pub fn load_with_all(path: Option<&Path>) -> (Option<Self>, Vec<ConfigError>) {
        let (mut config, wrong) = Self::load_any(path);
        if let Some(config) = &mut config {
            config.noted = Some(Arc::default());
        }
        (config, wrong)
    }

    fn load_any(path: Option<&Path>) -> (Option<Self>, Vec<ConfigError>) {
        let default = Path::new(DEFAULT_PATH);
        let path = path.or_else(|| is_there(default).then_some(default));
        let Some(path) = path else {
            return Self::read(BUILT_IN, None);
        };
        match std::fs::read_to_string(path) {
            Ok(text) => Self::read(&text, Some(path)),
            Err(e) => {
                let message = format!(
                    "cannot be read: {e}\nhint: a working example is {DEFAULT_PATH} of the repository"
                );
                (None, vec![ConfigError { file: path.display().to_string(), message }])
            }
        }
    }

    /// Reads a deployment from text.
    ///
    /// # Errors
    /// As [`Self::load`].
    pub fn parse(text: &str, file: Option<&Path>) -> Result<Self, ConfigError> {
        sound(Self::read(text, file))
    }

    /// The thruster of an id.
    ///
    /// # Errors
    /// [`ConfigError`] names the ids there are.
    pub fn thruster(&self, id: &str) -> Result<&Thruster, ConfigError> {
        self.thrusters.get(id).ok_or_else(|| {
            let known: Vec<_> = self.thrusters.keys().map(String::as_str).collect();
            self.error(format!("there is no thruster `{id}`\nhint: known are {}", known.join(", ")))
        })
    }

    /// Name and text of a thruster's rig description.
    ///
    /// # Errors
    /// [`ConfigError`] if the file is not there.
    pub fn rig_text(&self, id: &str, thruster: &Thruster) -> Result<(String, String), ConfigError> {
        self.text_of(&format!("thrusters.{id}.rig"), &thruster.rig, BUILT_IN_RIGS)
    }

    /// A file that the deployment names, relative to itself; where it is not found, the one of
    /// that name built in.
    ///
    /// # Errors
    /// [`ConfigError`] names both files.
    pub fn text_of(
        &self,
        key: &str,
        path: &Path,
        built_in: &[(&str, &'static str)],
    ) -> Result<(String, String), ConfigError> {
        if path == Path::new("") {
            return Err(self.error(format!("`{key}` is missing\nhint: {NO_RIG}")));
        }
        let folder = self.file.as_deref().and_then(Path::parent).unwrap_or(Path::new("config"));
        let full = folder.join(path);
        match std::fs::read_to_string(&full) {
            Ok(text) => Ok((full.display().to_string(), text)),
            Err(e) => {
                let known = built_in.iter().find(|(name, _)| Path::new(name) == path);
                let known = known.map(|(name, text)| (format!("built-in {name}"), (*text).to_owned()));
                known.ok_or_else(|| {
                    let names: Vec<_> = built_in.iter().map(|(name, _)| *name).collect();
                    self.error(format!(
                        "`{key}` = {}: {} cannot be read: {e}\nhint: a path relative to this file{}",
                        path.display(),
                        full.display(),
                        if names.is_empty() {
                            String::new()
                        } else {
                            format!("; built in are {}", names.join(", "))
                        }
                    ))
                })
            }
        }
    }

    /// An error about this configuration.
    pub fn error(&self, message: String) -> ConfigError {
        let file =
            self.file.as_ref().map_or_else(|| "built-in configuration".into(), |f| f.display().to_string());
        ConfigError { file, message: hinted(message) }
    }
}

/// A configuration with which nothing is wrong, or the first that is.
fn sound((config, wrong): (Option<Config>, Vec<ConfigError>)) -> Result<Config, ConfigError> {
    let nothing = || ConfigError { file: String::new(), message: String::new() };
    match wrong.into_iter().next() {
        Some(error) => Err(error),
        None => config.ok_or_else(nothing),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_built_in_deployment_is_valid() {
        let config = Config::parse(BUILT_IN, None).unwrap();
        let t1 = config.thruster("t1").unwrap();
        assert_eq!((t1.servo_period_ns(), t1.ticks_per_command()), (1_000_000, 4));
        assert!(config.thruster("t9").unwrap_err().to_string().contains("known are t1"));
    }

    #[test]
    fn errors_name_the_key_and_the_nearest_one() {
        let wrong = BUILT_IN.replace("rate_hz = 1000", "rat_hz = 1000");
        let error = Config::parse(&wrong, Some(Path::new("my.toml"))).unwrap_err().to_string();
        assert!(error.starts_with("my.toml: "), "{error}");
        assert!(error.contains("hint: did you mean `rate_hz`?"), "{error}");
        let fast = BUILT_IN.replace("rate_hz = 1000", "rate_hz = 90000");
        let error = Config::parse(&fast, None).unwrap_err().to_string();
        assert!(error.contains("thrusters.t1.servo.rate_hz") && error.contains("100 to 5000"), "{error}");
        let far = BUILT_IN.replace("rate_hz = 1000", "rate_hz = 1000\ncores = [1, 1024]");
        let error = Config::parse(&far, None).unwrap_err().to_string();
        assert!(error.contains("thrusters.t1.servo.cores") && error.contains("0 to 1023"), "{error}");
        let odd = BUILT_IN.replace("rate_hz = 250", "rate_hz = 300");
        assert!(Config::parse(&odd, None).unwrap_err().to_string().contains("does not divide"));
    }
}
