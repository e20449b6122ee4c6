//! `kort.toml`: one deployment. Every process reads the same file and takes its part; a section
//! that only one process understands is kept as a table and read by that process.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use serde::de::DeserializeOwned;
use thiserror::Error;
use toml::Table;

use crate::names::is_thruster_id;

/// Where the deployment is looked for unless `--config` says otherwise.
pub const DEFAULT_PATH: &str = "config/kort.toml";

/// The deployment and the rig it names, built in: a moved program still starts.
const BUILT_IN: &str = include_str!("../../config/kort.toml");

/// Rig descriptions built in, by the path that a deployment names them with.
const BUILT_IN_RIGS: &[(&str, &str)] = &[(
    "thrusters/whitcomb-yoerger-1999.toml",
    include_str!("../../config/thrusters/whitcomb-yoerger-1999.toml"),
)];

/// Why a configuration cannot be used; the message names file, key, value and what is allowed.
#[derive(Debug, Error)]
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
    /// Shared memory.
    #[serde(default)]
    pub transport: Transport,
    /// The gateway's own section, see `kort gateway --help`.
    #[serde(default)]
    pub gateway: Table,
    /// Thrusters by id.
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
    /// Rig description, relative to the file.
    pub rig: PathBuf,
    /// Which drive: `simulated`, or the kind of a real one.
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
    /// Law that runs at start; empty takes the one of the file.
    pub law: String,
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
            law: String::new(),
            setpoint_rise_s: None,
        }
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
        sound(Self::load_with_all(path))
    }

    /// As [`Self::load`], with everything that is wrong, and what can be read all the same: loops that are not allowed are the
    /// usual ones there.
    pub fn load_with_all(path: Option<&Path>) -> (Option<Self>, Vec<ConfigError>) {
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

    fn read(text: &str, file: Option<&Path>) -> (Option<Self>, Vec<ConfigError>) {
        let name = file.map_or_else(|| "built-in configuration".into(), |f| f.display().to_string());
        let fail = |message: String| ConfigError { file: name.clone(), message: hinted(message) };
        let mut config: Self = match toml::from_str(text) {
            Ok(config) => config,
            Err(e) => return (None, vec![fail(with_hint(&e.to_string()))]),
        };
        config.file = file.map(Path::to_path_buf);
        let mut wrong = Vec::new();
        if config.thrusters.is_empty() {
            wrong.push(fail("`thrusters` is empty\nhint: add a section [thrusters.t1]".into()));
        }
        for (id, t) in &mut config.thrusters {
            if !is_thruster_id(id) {
                wrong.push(fail(format!(
                    "`thrusters.{id}`: an id has 1 to 16 lower-case letters, digits, `_` or `-`\nhint: t1, port, bow-2"
                )));
            }
            let mut check = |key: &str, value: f64, low: f64, high: f64, hint: &str| {
                if !(low..=high).contains(&value) {
                    wrong.push(fail(format!(
                        "`thrusters.{id}.{key}` = {value} is outside {low} to {high}\nhint: {hint}"
                    )));
                }
            };
            check("servo.rate_hz", t.servo.rate_hz, 100.0, 5000.0, "1000 suits most drives");
            check("servo.priority", t.servo.priority.into(), 0.0, 90.0, "80; 0 leaves the scheduler alone");
            check("controller.priority", t.controller.priority.into(), 0.0, 90.0, "70, below the servo's");
            check(
                "controller.rate_hz",
                t.controller.rate_hz,
                10.0,
                t.servo.rate_hz,
                "at most the servo's rate",
            );
            for (key, cores) in [("servo.cores", &t.servo.cores), ("controller.cores", &t.controller.cores)] {
                for core in cores {
                    check(
                        key,
                        *core as f64,
                        0.0,
                        1023.0,
                        "cores are counted from 0; leave it out for all of them",
                    );
                }
            }
            if let Some(rise_s) = t.controller.setpoint_rise_s {
                check("controller.setpoint_rise_s", rise_s, 0.0, 60.0, "leave it out for what suits the law");
            }
            let ratio = t.servo.rate_hz / t.controller.rate_hz;
            if (ratio - ratio.round()).abs() > 1e-6 {
                wrong.push(fail(format!(
                    "`thrusters.{id}.controller.rate_hz` = {} does not divide servo.rate_hz = {}\nhint: {} does",
                    t.controller.rate_hz,
                    t.servo.rate_hz,
                    t.servo.rate_hz / ratio.ceil()
                )));
            }
            // Who looks at the rest must be able to count with these.
            let (servo, controller) = (t.servo.rate_hz, t.controller.rate_hz);
            if !(100.0..=5000.0).contains(&servo) || !(10.0..=servo).contains(&controller) {
                (t.servo.rate_hz, t.controller.rate_hz) =
                    (ServoLoop::default().rate_hz, ControllerLoop::default().rate_hz);
            }
            t.controller.setpoint_rise_s = t.controller.setpoint_rise_s.filter(|s| (0.0..=60.0).contains(s));
        }
        (Some(config), wrong)
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

    /// Reads a section that one process owns.
    ///
    /// # Errors
    /// [`ConfigError`] names the section, the unknown key and the nearest known one.
    pub fn section<T: DeserializeOwned>(&self, name: &str, table: &Table) -> Result<T, ConfigError> {
        table.clone().try_into().map_err(|e: toml::de::Error| {
            self.error(with_hint(&format!("section [{name}]: {}", e.to_string().trim_end())))
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

/// A message that says no way out points at the file that explains every key.
fn hinted(message: String) -> String {
    if message.contains("hint:") {
        return message;
    }
    format!("{}\nhint: {DEFAULT_PATH} of the repository explains every key", message.trim_end())
}

/// Adds the nearest known key to serde's "unknown field `x`, expected one of `a`, `b`".
fn with_hint(message: &str) -> String {
    let message = message.trim_end();
    let Some(at) = message.find("unknown field") else { return message.to_owned() };
    let mut names = message[at..].split('`').skip(1).step_by(2);
    let Some(wrong) = names.next() else { return message.to_owned() };
    match names.max_by(|a, b| strsim::jaro_winkler(a, wrong).total_cmp(&strsim::jaro_winkler(b, wrong))) {
        Some(near) => format!("{message}\nhint: did you mean `{near}`?"),
        None => format!("{message}\nhint: this section has no keys"),
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
