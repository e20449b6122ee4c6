//! All that is wrong with a deployment, at once: unknown keys, types and values of the whole file, whoever reads the section.

use std::path::Path;
use std::sync::PoisonError;

use kort_complaints::{near, read_with_all};
use serde::de::DeserializeOwned;
use toml::{Table, Value};

use super::{Config, ConfigError, ControllerLoop, DEFAULT_PATH, NO_RIG, ServoLoop};
use crate::names::is_thruster_id;

impl Config {
    pub(super) fn read(text: &str, file: Option<&Path>) -> (Option<Self>, Vec<ConfigError>) {
        let name = file.map_or_else(|| "built-in configuration".into(), |f| f.display().to_string());
        let fail = |message: String| ConfigError { file: name.clone(), message: hinted(message) };
        let tree = match text.parse() {
            Ok(tree) => Value::Table(tree),
            Err(e) => return (None, vec![fail(e.to_string())]),
        };
        let (config, said) = read_with_all::<Self>(tree);
        let mut wrong: Vec<_> = said.iter().map(|words| fail(with_hint(words))).collect();
        let Some(mut config) = config else { return (None, wrong) };
        config.file = file.map(Path::to_path_buf);
        if config.thrusters.is_empty() && wrong.is_empty() {
            wrong.push(fail("`thrusters` is empty\nhint: add a section [thrusters.t1]".into()));
        }
        for (id, t) in &mut config.thrusters {
            if !is_thruster_id(id) {
                wrong.push(fail(format!(
                    "`thrusters.{id}`: an id has 1 to 16 lower-case letters, digits, `_` or `-`\nhint: t1, port, bow-2"
                )));
            }
            for (key, there, hint) in [
                ("rig", t.rig != Path::new(""), NO_RIG),
                (
                    "amplifier",
                    !t.amplifier.is_empty(),
                    "\"simulated\", or the drive's kind; docs/hardware.md has them",
                ),
            ] {
                let key = format!("thrusters.{id}.{key}");
                let told =
                    |words: &String| words.split('`').nth(1).is_some_and(|told| is_told_by(told, &key));
                if !there && !said.iter().any(told) {
                    wrong.push(fail(format!("`{key}` is missing\nhint: {hint}")));
                }
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
            // A rate that could not be read divides nothing.
            let read = |loops: &str| {
                let of_it = format!("`thrusters.{id}.{loops}");
                !said.iter().any(|words| words.starts_with(&of_it))
            };
            if read("servo") && read("controller") && (ratio - ratio.round()).abs() > 1e-6 {
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

    /// What was wrong with the sections that were read since [`Self::load_with_all`].
    pub fn noted(&self) -> Vec<ConfigError> {
        let noted =
            self.noted.iter().flat_map(|noted| noted.lock().unwrap_or_else(PoisonError::into_inner).clone());
        noted.collect()
    }

    /// Reads a section that one process owns.
    ///
    /// # Errors
    /// [`ConfigError`] names the key, what stands there, what is allowed and the nearest known one. Where all that is wrong
    /// is asked for ([`Self::load_with_all`]) it is noted, and what is left is read.
    pub fn section<T: DeserializeOwned>(&self, name: &str, table: &Table) -> Result<T, ConfigError> {
        let (read, said) = read_with_all(Value::Table(table.clone()));
        let of_section = |words: &String| {
            let placed = words.strip_prefix('`').map(|rest| format!("`{name}.{rest}"));
            self.error(with_hint(&placed.unwrap_or_else(|| format!("`{name}`: {words}"))))
        };
        let first = self.first_of(said.iter().map(of_section));
        match (read, first) {
            (Some(read), None) => Ok(read),
            (Some(read), Some(_)) if self.noted.is_some() => Ok(read),
            (_, first) => Err(first.unwrap_or_else(|| self.error(format!("`{name}` cannot be read")))),
        }
    }

    /// The first of what is wrong; all of it is noted where all that is wrong is asked for.
    pub fn first_of(&self, wrong: impl Iterator<Item = ConfigError>) -> Option<ConfigError> {
        let wrong: Vec<_> = wrong.collect();
        if let Some(noted) = &self.noted {
            noted.lock().unwrap_or_else(PoisonError::into_inner).extend(wrong.iter().cloned());
        }
        wrong.into_iter().next()
    }
}

/// Does what is told of one key tell of another too: is it that one, or misspelt in its place?
pub fn is_told_by(told: &str, key: &str) -> bool {
    match (told.rsplit_once('.'), key.rsplit_once('.')) {
        (Some((of, told)), Some((section, key))) => of == section && near(told, [key]).is_some(),
        _ => told == key,
    }
}

/// A message that says no way out points at the file that explains every key.
pub(super) fn hinted(message: String) -> String {
    if message.contains("hint:") {
        return message;
    }
    format!("{}\nhint: {DEFAULT_PATH} of the repository explains every key", message.trim_end())
}

/// Adds the nearest known word to serde's "unknown field `x`, expected one of `a`, `b`", or counts them up.
fn with_hint(message: &str) -> String {
    let message = message.trim_end();
    let of = ["unknown field", "unknown variant"];
    let Some(at) = of.iter().find_map(|of| message.find(of)) else { return message.to_owned() };
    let mut names = message[at..].split('`').skip(1).step_by(2);
    let Some(wrong) = names.next() else { return message.to_owned() };
    let known: Vec<&str> = names.collect();
    match near(wrong, known.iter().copied()) {
        Some(near) => format!("{message}\nhint: did you mean `{near}`?"),
        None if known.is_empty() => format!("{message}\nhint: this section has no keys"),
        None => format!("{message}\nhint: known are {}", known.join(", ")),
    }
}
