//! Scenarios with all they name, read and checked: rig, recordings, controllers.

use std::path::{Path, PathBuf};

use kort_control::{ControlModel, ControllerConfig, LawKind, ModelError, advise};
use kort_soak::{Hooked, Prepared, Replayed, Scenario, Segment};
use kort_thruster::rig::{Rig, RigError};
use thiserror::Error;

use crate::failure::{Failure, all_of};
use crate::files;

/// Why a scenario cannot be run: the file and what is wrong in it.
#[derive(Debug, Error)]
#[error("{file}: {message}")]
pub struct ScenarioError {
    /// The scenario's file.
    pub file: String,
    /// All that is wrong, with hints.
    pub message: String,
}

/// Why a soak cannot be run.
#[derive(Debug, Error)]
pub enum SoakError {
    /// A scenario or its rig.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A controller that is not known.
    #[error(
        "controller `{name}` is not known{near}\nhint: a file of config/controllers/ without .toml, a path to one, `default` (the rig's own), `drive_limits` (what no law can better), or a law: {laws}"
    )]
    UnknownController {
        /// What was asked for.
        name: String,
        /// The nearest known one.
        near: String,
        /// Known laws.
        laws: String,
    },
    /// A controller's file.
    #[error("{file}: {message}")]
    Controller {
        /// The file.
        file: String,
        /// All that is wrong.
        message: String,
    },
    /// A recording to replay.
    #[error("replay of {file}: {message}")]
    Replay {
        /// The recording.
        file: String,
        /// What is wrong.
        message: String,
    },
    /// A recording or column map that cannot be read; its words name it.
    #[error(transparent)]
    Input(#[from] Failure),
    /// No controller can be designed for the rig.
    #[error("{file}: {source}")]
    Model {
        /// The scenario.
        file: String,
        /// What is wrong.
        source: ModelError,
    },
    /// Nothing to adopt.
    #[error(
        "scenario `{scenario}` hides nothing, or compares no law: nothing to adopt\nhint: --adopt needs [hidden] in the scenario, as soak-closed-loop has it, and a law among its controllers"
    )]
    HidesNothing {
        /// The scenario.
        scenario: String,
    },
    /// The first run's recording cannot be diagnosed.
    #[error("scenario `{scenario}`: its recording cannot be diagnosed: {message}")]
    Diagnosis {
        /// The scenario.
        scenario: String,
        /// What is wrong.
        message: String,
    },
    /// The thread pool.
    #[error("no threads: {0}\nhint: a smaller --jobs")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// The name under which a rig's own default controller runs.
pub const DEFAULT: &str = "default";

/// What is compared.
#[derive(Clone, Debug, PartialEq)]
pub enum Contestant {
    /// A controller.
    Law(Box<ControllerConfig>),
    /// The law that is told everything: what the drive's limits leave.
    Limits,
}

/// A scenario with all it names, read and checked.
pub struct Loaded {
    /// The scenario.
    pub scenario: Scenario,
    /// The rig as stated.
    pub rig: Rig,
    /// The text that states it.
    pub rig_text: String,
    /// The effects at work.
    pub effects: Vec<Hooked>,
    /// Recordings to replay, by segment.
    pub replayed: Vec<Option<Replayed>>,
    /// Largest steady thrust that a share of 1 stands for, N.
    pub thrust_max_n: f64,
    /// What is compared, by name.
    pub controllers: Vec<(String, Contestant)>,
    /// How many seeds.
    pub seeds: u32,
}

impl Loaded {
    /// What every run of it shares.
    pub fn prepared(&self) -> Prepared<'_> {
        Prepared {
            scenario: &self.scenario,
            rig: &self.rig,
            effects: &self.effects,
            replayed: &self.replayed,
            thrust_max_n: self.thrust_max_n,
        }
    }
}

/// What of a scenario the command line has its own mind about.
#[derive(Clone, Copy, Debug, Default)]
pub struct Instead<'a> {
    /// Rig.
    pub rig: Option<&'a Path>,
    /// Controllers.
    pub controllers: Option<&'a [String]>,
    /// How many seeds.
    pub seeds: Option<u32>,
}

/// Reads a scenario, by path or name, its rig, its recordings and the controllers to compare.
///
/// # Errors
/// [`SoakError`] names the file, the key and what is allowed.
pub fn load(path: &Path, instead: &Instead) -> Result<Loaded, SoakError> {
    let (scenario, rig, rig_text) = read(path, instead.rig)?;
    let period_s = 1.0 / scenario.control_rate_hz;
    let model = ControlModel::from_rig(&rig, period_s)
        .map_err(|source| SoakError::Model { file: path.display().to_string(), source })?;
    let effects = kort_soak::effects(&scenario, &rig, &model)
        .map_err(|message| ScenarioError { file: path.display().to_string(), message })?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let names = instead.controllers.map_or_else(|| scenario.controllers.clone(), <[String]>::to_vec);
    let controllers = names
        .iter()
        .map(|name| {
            let contestant = match name.as_str() {
                kort_soak::limits::NAME => Contestant::Limits,
                DEFAULT => Contestant::Law(Box::new(
                    advise(&rig, period_s)
                        .map_err(|source| SoakError::Model { file: path.display().to_string(), source })?
                        .config,
                )),
                _ => Contestant::Law(Box::new(controller(name, folder)?)),
            };
            Ok((name.clone(), contestant))
        })
        .collect::<Result<_, SoakError>>()?;
    let replayed = scenario
        .references
        .iter()
        .map(|s| replay(s, folder, model.thrust_max_n))
        .collect::<Result<_, _>>()?;
    let seeds = instead.seeds.unwrap_or(scenario.seeds);
    Ok(Loaded {
        scenario,
        rig,
        rig_text,
        effects,
        replayed,
        thrust_max_n: model.thrust_max_n,
        controllers,
        seeds,
    })
}

/// A scenario, and its rig or another, with the rig's text.
fn read(path: &Path, rig: Option<&Path>) -> Result<(Scenario, Rig, String), SoakError> {
    let text = files::soak_scenario_text(path)?;
    let error = |path: &Path, message: String| ScenarioError { file: path.display().to_string(), message };
    let all = |path: &Path, wrong: Vec<String>| error(path, all_of(&path.display().to_string(), wrong));
    let parsed = |path: &Path, text: &str| {
        let words = |wrong: Vec<RigError>| wrong.iter().map(ToString::to_string).collect();
        Rig::from_toml_with_all(text).map_err(|wrong| all(path, words(wrong)))
    };
    let scenario = Scenario::from_toml(&text).map_err(|wrong| all(path, wrong))?;
    let by_name = |name: &Path| -> Result<(Rig, String), SoakError> {
        let text = files::rig_text(name)?;
        Ok((parsed(name, &text)?, text))
    };
    if let Some(rig) = rig {
        let (rig, text) = by_name(rig)?;
        return Ok((scenario, rig, text));
    }
    if !path.is_file() {
        // A scenario by name goes with a rig by name.
        let (rig, text) = by_name(Path::new(scenario.rig.file_stem().unwrap_or_default()))?;
        return Ok((scenario, rig, text));
    }
    let rig = path.parent().unwrap_or(Path::new(".")).join(&scenario.rig);
    let text = std::fs::read_to_string(&rig).map_err(|e| {
        error(&rig, format!("{e}\nhint: `rig` in {} is taken relative to that file", path.display()))
    })?;
    Ok((scenario, parsed(&rig, &text)?, text))
}

/// A controller by name: a path, a file beside the scenario or under `config/`, or a bare law.
fn controller(name: &str, folder: &Path) -> Result<ControllerConfig, SoakError> {
    let file = format!("{name}.toml");
    let places = if name.ends_with(".toml") {
        vec![PathBuf::from(name)]
    } else {
        vec![folder.join("../controllers").join(&file), Path::new("config/controllers").join(&file)]
    };
    if let Some((place, text)) = places.iter().find_map(|p| std::fs::read_to_string(p).ok().map(|t| (p, t))) {
        let file = place.display().to_string();
        return ControllerConfig::from_toml_with_all(&text)
            .map_err(|wrong| SoakError::Controller { message: all_of(&file, wrong), file });
    }
    LawKind::from_name(name).map(ControllerConfig::with_law).ok_or_else(|| {
        let laws = LawKind::ALL.map(LawKind::name);
        let near = laws
            .iter()
            .max_by(|a, b| strsim::jaro_winkler(a, name).total_cmp(&strsim::jaro_winkler(b, name)))
            .filter(|l| strsim::jaro_winkler(l, name) > 0.75)
            .map_or_else(String::new, |l| format!(", did you mean `{l}`?"));
        SoakError::UnknownController { name: name.into(), near, laws: laws.join(", ") }
    })
}

/// The column a segment replays; `None` for other segments.
fn replay(segment: &Segment, folder: &Path, thrust_max_n: f64) -> Result<Option<Replayed>, SoakError> {
    let Segment::Replay { file, columns, column, peak } = segment else { return Ok(None) };
    let error = |message: String| SoakError::Replay { file: file.clone(), message };
    let map = files::read_columns(columns.as_deref())?;
    let recording = files::replayed_recording(file, Some(folder), map.as_ref())?;
    let values = recording.column(column).ok_or_else(|| {
        let names: Vec<&str> = recording.columns.iter().map(|c| c.name.as_str()).collect();
        error(format!("there is no column `{column}`\nhint: it has {}", names.join(", ")))
    })?;
    let sampled: Vec<(f64, f64)> =
        recording.time_s.iter().copied().zip(values.iter().copied()).filter(|(_, v)| v.is_finite()).collect();
    let largest = sampled.iter().fold(0.0_f64, |m, (_, v)| m.max(v.abs()));
    if largest <= 0.0 {
        return Err(error(format!("column `{column}` has no value but zero\nhint: name another `column`")));
    }
    let scale = peak.map_or(1.0 / thrust_max_n, |peak| peak / largest);
    let start = sampled[0].0;
    Ok(Some(Replayed {
        time_s: sampled.iter().map(|(t, _)| t - start).collect(),
        share: sampled.iter().map(|(_, v)| (v * scale).clamp(-1.0, 1.0)).collect(),
    }))
}
