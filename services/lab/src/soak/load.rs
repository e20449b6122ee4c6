//! Scenarios with all they name, read and checked: rig, recordings, controllers.

use std::path::{Path, PathBuf};

use kort_control::{ControlModel, ControllerConfig, LawKind, ModelError, advise};
use kort_soak::{CONTROL_RATES_HZ, Hooked, Prepared, Replayed, Scenario, Segment};
use kort_thruster::rig::{Rig, RigError};
use thiserror::Error;

use crate::check::Kind;
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

impl ScenarioError {
    /// In the file of a scenario or its rig.
    fn of(file: &Path, message: String) -> SoakError {
        SoakError::Scenario(Self { file: file.display().to_string(), message })
    }
}

/// Why a soak cannot be run.
#[derive(Debug, Error)]
pub enum SoakError {
    /// Several things at once.
    #[error("{}", all_lines(.0))]
    Several(Vec<SoakError>),
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

impl SoakError {
    /// All that is wrong, as one.
    fn all(mut wrong: Vec<Self>) -> Self {
        if wrong.len() == 1 { wrong.remove(0) } else { Self::Several(wrong) }
    }
}

/// Each on lines of its own.
fn all_lines(wrong: &[SoakError]) -> String {
    wrong.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
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
/// [`SoakError`] names the file, the key and what is allowed; all that is wrong.
pub fn load(path: &Path, instead: &Instead) -> Result<Loaded, SoakError> {
    let text = files::soak_scenario_text(path)?;
    // One without references or controllers has no other mark of `kort simulate` than what only that has.
    let simulated = |table: &toml::Table| Kind::of(table) == Kind::Scenario && table.contains_key("segments");
    if text.parse().is_ok_and(|table| simulated(&table)) {
        let words = format!(
            "this is a scenario of kort simulate, a test signal; kort soak takes what controllers are asked for, [[reference]]\nhint: kort simulate --rig RIG --scenario {} -o REC.csv",
            path.display()
        );
        return Err(ScenarioError::of(path, words));
    }
    of_text(&text, path, instead).map_err(SoakError::all)
}

/// The same from the scenario's text, and all that is wrong one by one.
///
/// # Errors
/// At least one [`SoakError`].
pub fn of_text(text: &str, path: &Path, instead: &Instead) -> Result<Loaded, Vec<SoakError>> {
    let file = path.display().to_string();
    let of_scenario = |wrong: Vec<String>| -> Vec<SoakError> {
        wrong.into_iter().map(|words| ScenarioError::of(path, words)).collect()
    };
    let (scenario, said) = Scenario::read(text);
    let mut wrong = of_scenario(said);
    let Some(mut scenario) = scenario else { return Err(wrong) };
    // What stands empty in the place of a key that is missing is told already.
    if !wrong.is_empty() {
        scenario.effects.retain(|effect| !effect.id.is_empty());
        scenario
            .references
            .retain(|segment| !matches!(segment, Segment::Replay { file, .. } if file.is_empty()));
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    // A rig that it lacks is told as missing.
    let named = instead.rig.is_some() || scenario.rig != Path::new("");
    let found = if named {
        rig(&scenario, path, instead.rig).map_err(|errors| wrong.extend(errors)).ok()
    } else {
        None
    };
    let period_s = 1.0 / scenario.control_rate_hz;
    // At a rate that is none nothing can be designed, and the rate is told already.
    let rated = found.as_ref().filter(|_| CONTROL_RATES_HZ.contains(&scenario.control_rate_hz));
    let model = rated.and_then(|(rig, _)| {
        let model = ControlModel::from_rig(rig, period_s);
        model.map_err(|source| wrong.push(SoakError::Model { file: file.clone(), source })).ok()
    });
    let with_model = found.as_ref().zip(model.as_ref());
    let effects = with_model.and_then(|((rig, _), model)| {
        let effects = kort_soak::effects(&scenario, rig, model);
        effects.map_err(|words| wrong.extend(of_scenario(words))).ok()
    });
    let names = instead.controllers.map_or_else(|| scenario.controllers.clone(), <[String]>::to_vec);
    let mut controllers = Vec::new();
    for name in names {
        let contestant = match name.as_str() {
            kort_soak::limits::NAME => Ok(Contestant::Limits),
            // Without a model for its rig nothing more is to be said of it.
            DEFAULT => match with_model.map(|((rig, _), _)| advise(rig, period_s)) {
                Some(advice) => advice
                    .map(|advice| Contestant::Law(Box::new(advice.config)))
                    .map_err(|source| SoakError::Model { file: file.clone(), source }),
                None => continue,
            },
            _ => controller(&name, folder).map(|config| Contestant::Law(Box::new(config))),
        };
        match contestant {
            Ok(contestant) => controllers.push((name, contestant)),
            Err(error) => wrong.push(error),
        }
    }
    // What can be replayed does not go by how large a thrust is.
    let thrust_max_n = model.map_or(1.0, |model| model.thrust_max_n);
    let mut replayed = Vec::new();
    for segment in &scenario.references {
        match replay(segment, folder, thrust_max_n) {
            Ok(one) => replayed.push(one),
            Err(error) => wrong.push(error),
        }
    }
    let seeds = instead.seeds.unwrap_or(scenario.seeds);
    match (found, effects) {
        (Some((rig, rig_text)), Some(effects)) if wrong.is_empty() => {
            Ok(Loaded { scenario, rig, rig_text, effects, replayed, thrust_max_n, controllers, seeds })
        }
        _ => Err(wrong),
    }
}

/// The rig of a scenario, or another, with its text.
fn rig(scenario: &Scenario, path: &Path, instead: Option<&Path>) -> Result<(Rig, String), Vec<SoakError>> {
    let parsed = |file: &Path, text: String| {
        let of_rig = |error: RigError| ScenarioError::of(file, error.to_string());
        let rig = Rig::from_toml_with_all(&text);
        let rig = rig.map_err(|wrong| wrong.into_iter().map(of_rig).collect::<Vec<_>>())?;
        Ok((rig, text))
    };
    // A scenario by name goes with a rig by name.
    let named = (!path.is_file()).then(|| Path::new(scenario.rig.file_stem().unwrap_or_default()));
    if let Some(name) = instead.or(named) {
        return parsed(name, files::rig_text(name).map_err(|error| vec![error.into()])?);
    }
    let file = path.parent().unwrap_or(Path::new(".")).join(&scenario.rig);
    let text = if file.is_file() {
        std::fs::read_to_string(&file).map_err(|error| error.to_string())
    } else {
        Err("there is no such file".into())
    };
    match text {
        Ok(text) => parsed(&file, text),
        Err(why) => {
            let words = format!(
                "`rig` = {:?}: {}: {why}\nhint: it is taken relative to the scenario's file",
                scenario.rig.display().to_string(),
                file.display()
            );
            Err(vec![ScenarioError::of(path, words)])
        }
    }
}

/// A controller by name: a path, a file beside the scenario or under `config/`, one built in, or a bare law.
fn controller(name: &str, folder: &Path) -> Result<ControllerConfig, SoakError> {
    let file = format!("{name}.toml");
    let places = if name.ends_with(".toml") {
        vec![PathBuf::from(name)]
    } else {
        vec![folder.join("../controllers").join(&file), Path::new("config/controllers").join(&file)]
    };
    let on_disk =
        places.iter().find_map(|p| Some((p.display().to_string(), std::fs::read_to_string(p).ok()?)));
    let built_in = || Some((file, files::controller_text(name)?));
    if let Some((file, text)) = on_disk.or_else(built_in) {
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
