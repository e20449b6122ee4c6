//! A scenario: which truth runs under which test signals, and what is recorded of it.
//!
//! Pure: the same scenario, rig and seed give the same rows. Written as TOML or JSON;
//! `kort simulate` runs it, a diagnosis report carries one as its next experiment.

mod check;
mod excitation;
mod measuring;
mod run;
mod segment;

pub use excitation::{Excitation, NoReplays, Replayed, Replays};
pub use measuring::Measuring;
pub use run::{Run, Used, scale, used_effect};
pub use segment::Segment;

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameter;
use kort_thruster::place;

/// What the segments of a scenario's command mean.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Command {
    /// Motor current, A (current drive).
    CurrentCmdA,
    /// Motor voltage, V (voltage drive).
    VoltageCmdV,
    /// Share of the supply, -1 to 1 (voltage drive).
    DutyCmd,
    /// Shaft speed, rad/s (speed drive).
    SpeedCmdRadS,
    /// Motor torque, N m, through the stated torque constant (current drive).
    TorqueCmdNM,
    /// Thrust, N, through the stated steady map in bollard pull (any drive).
    ThrustCmdN,
    /// Share of the drive's largest command, -1 to 1 (any drive with a stated limit).
    #[default]
    Share,
}

impl Command {
    /// Name in a scenario.
    pub const fn name(self) -> &'static str {
        match self {
            Command::CurrentCmdA => "current_cmd_a",
            Command::VoltageCmdV => "voltage_cmd_v",
            Command::DutyCmd => "duty_cmd",
            Command::SpeedCmdRadS => "speed_cmd_rad_s",
            Command::TorqueCmdNM => "torque_cmd_n_m",
            Command::ThrustCmdN => "thrust_cmd_n",
            Command::Share => "share",
        }
    }
}

/// A scenario as written.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name.
    #[serde(default)]
    pub name: String,
    /// What it is for.
    #[serde(default)]
    pub what: String,
    /// The true model.
    #[serde(default = "model2")]
    pub model: ModelName,
    /// What the command's values mean.
    #[serde(default)]
    pub command: Command,
    /// Length, s; that of the command if left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub duration_s: Option<f64>,
    /// Seed of noise and random segments; `--seed` goes before it.
    #[serde(default = "seed")]
    pub seed: u64,
    /// Factor on the usual sensor noise; 0 switches noise off, quantisation stays.
    #[serde(default = "one")]
    pub noise: f64,
    /// The command, segment after segment.
    pub segments: Vec<Segment>,
    /// Ambient axial flow, m/s, positive when it feeds the propeller ahead; none if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub ambient: Vec<Segment>,
    /// Random part of the ambient flow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub turbulence: Option<Turbulence>,
    /// Supply, V; the rig's nominal one if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub supply: Vec<Segment>,
    /// Depth of the propeller, m; not recorded if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub depth: Vec<Segment>,
    /// Temperature, degrees Celsius; not recorded if empty.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub temperature: Vec<Segment>,
    /// True parameters where they differ from the rig's stated ones, by name.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub parameters: BTreeMap<Parameter, f64>,
    /// Physics at work beyond the model.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<EffectUse>,
}

impl Default for Scenario {
    fn default() -> Self {
        Self {
            name: String::new(),
            what: String::new(),
            model: model2(),
            command: Command::default(),
            duration_s: None,
            seed: seed(),
            noise: one(),
            segments: Vec::new(),
            ambient: Vec::new(),
            turbulence: None,
            supply: Vec::new(),
            depth: Vec::new(),
            temperature: Vec::new(),
            parameters: BTreeMap::new(),
            effects: Vec::new(),
        }
    }
}

fn model2() -> ModelName {
    ModelName::Model2
}

fn seed() -> u64 {
    1
}

fn one() -> f64 {
    1.0
}

/// Random ambient flow: first-order (Gauss-Markov) noise.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Turbulence {
    /// Standard deviation, m/s.
    pub sigma_m_s: f64,
    /// Correlation time, s.
    pub time_constant_s: f64,
}

/// One effect and its parameters, all of them by name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectUse {
    /// Identifier in the catalogue.
    pub effect: String,
    /// Values by parameter name.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
}

/// Why a scenario cannot be run.
#[derive(Debug, Error, Clone, PartialEq)]
pub enum ScenarioError {
    /// Not TOML or JSON, a key unknown, a value of the wrong kind.
    #[error("{message}\nhint: docs/recordings.md lists the keys of a scenario")]
    Syntax {
        /// The parser's words.
        message: String,
    },
    /// A value out of range.
    #[error("`{key}` = {found} is outside what is allowed: {allowed}\nhint: correct the value")]
    Value {
        /// The key.
        key: String,
        /// What stands there.
        found: String,
        /// What may stand there.
        allowed: String,
    },
    /// The command does not fit the rig's drive.
    #[error("`command` = \"{command}\" does not fit this rig: {why}\nhint: {hint}")]
    Command {
        /// The scenario's command.
        command: &'static str,
        /// Why not.
        why: String,
        /// What would.
        hint: String,
    },
    /// An effect or a parameter of one that does not exist.
    #[error("`{key}` = {found} is not known\nhint: {hint}")]
    Unknown {
        /// The key.
        key: String,
        /// What stands there.
        found: String,
        /// Nearest known, or the list.
        hint: String,
    },
    /// A parameter of an effect without a value.
    #[error("`{key}` is missing\nhint: {hint}")]
    Missing {
        /// The key.
        key: String,
        /// Range and a usual value.
        hint: String,
    },
    /// A replay that cannot be had.
    #[error("{at}: {message}")]
    Replay {
        /// The segment.
        at: String,
        /// Why, with a hint.
        message: String,
    },
}

impl Scenario {
    /// Reads a scenario from TOML.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`] with line or key; of several the first.
    pub fn from_toml(text: &str) -> Result<Self, ScenarioError> {
        Self::from_toml_with_all(text).map_err(first)
    }

    /// As [`Self::from_toml`], with everything that cannot be read.
    ///
    /// # Errors
    /// What is wrong; at least one.
    pub fn from_toml_with_all(text: &str) -> Result<Self, Vec<ScenarioError>> {
        place::from_toml_with_all(text).map_err(syntax)
    }

    /// A scenario as far as its text can be read, and all that is wrong with it, whatever the rig: `more` looks at what [`Self::check`]
    /// does not. Nothing where it is sound.
    pub fn all_wrong(text: &str, more: impl Fn(&Self) -> Vec<ScenarioError>) -> Vec<String> {
        let mut read = place::text_as_far_as_it_goes::<Self>(text);
        let scenario = read.value.take();
        let values = scenario.iter().flat_map(|scenario| [scenario.check(), more(scenario)].concat());
        let values: Vec<String> = values.filter_map(|error| read.in_file(&error.to_string())).collect();
        syntax(read.said).iter().map(ToString::to_string).chain(values).collect()
    }

    /// Reads a scenario file as people have it: TOML, JSON, or the JSON report of a diagnosis, whose next experiment it
    /// is then.
    ///
    /// # Errors
    /// [`ScenarioError::Syntax`] with line or key, or that the report asks for no further run; of several the first.
    pub fn from_text(text: &str) -> Result<Self, ScenarioError> {
        Self::from_text_with_all(text).map_err(first)
    }

    /// As [`Self::from_text`], with everything that cannot be read.
    ///
    /// # Errors
    /// What is wrong; at least one.
    pub fn from_text_with_all(text: &str) -> Result<Self, Vec<ScenarioError>> {
        if !text.trim_start().starts_with('{') {
            return Self::from_toml_with_all(text);
        }
        let fail = |message: String| syntax(vec![message]);
        let mut json: serde_json::Value = serde_json::from_str(text).map_err(|e| fail(e.to_string()))?;
        if let Some(next) = json.get_mut("next_experiment") {
            json = next.get_mut("scenario").map(serde_json::Value::take).ok_or_else(|| {
                fail("`next_experiment` is null: this report asks for no further run".into())
            })?;
        }
        serde_json::from_value(json.clone()).map_err(|e| {
            let said = toml::Value::try_from(json).map(place::complaints::<Self>).unwrap_or_default();
            if said.is_empty() { fail(e.to_string()) } else { syntax(said) }
        })
    }
}

fn syntax(said: Vec<String>) -> Vec<ScenarioError> {
    said.into_iter().map(|message| ScenarioError::Syntax { message }).collect()
}

/// There is at least one where there is no scenario.
fn first(wrong: Vec<ScenarioError>) -> ScenarioError {
    wrong.into_iter().next().unwrap_or_else(|| ScenarioError::Syntax { message: String::new() })
}
