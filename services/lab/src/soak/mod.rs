//! `kort soak`: several controllers on the same plant, faults and references, on virtual time.

mod chain;
mod check;
mod disc;
mod live;
mod metrics;
mod page;
mod reference;
mod report;
mod run;
mod scenario;
mod score;
mod sea;
mod truth;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use kort_control::{ConfigError, ControlModel, ControllerConfig, LawKind, ModelError};
use kort_thruster::rig::Rig;
use rayon::prelude::*;
use thiserror::Error;

use crate::failure::Failure;
use crate::files;

pub use live::{LiveError, live};
pub use metrics::{Metrics, MetricsError};
pub use page::page;
use reference::Replayed;
pub use report::Report;
use report::{LawResult, ScenarioResult};
use run::{Knows, Prepared};
use scenario::{Scenario, ScenarioError, Segment};
use score::Outcome;

/// Why a soak cannot be run.
#[derive(Debug, Error)]
pub enum SoakError {
    /// A scenario or its rig.
    #[error(transparent)]
    Scenario(#[from] ScenarioError),
    /// A controller that is not known.
    #[error(
        "controller `{name}` is not known{near}\nhint: a file of config/controllers/ without .toml, a path to one, or a law: {laws}"
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
    #[error("{file}: {source}")]
    Controller {
        /// The file.
        file: String,
        /// What is wrong.
        source: ConfigError,
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
    /// The thread pool.
    #[error("no threads: {0}\nhint: a smaller --jobs")]
    Threads(#[from] rayon::ThreadPoolBuildError),
}

/// A scenario with all it names, read and checked.
pub struct Loaded {
    scenario: Scenario,
    rig: Rig,
    effects: Vec<truth::Hooked>,
    replayed: Vec<Option<Replayed>>,
    thrust_max_n: f64,
    controllers: Vec<(String, ControllerConfig)>,
    seeds: u32,
}

impl Loaded {
    /// Virtual time that one law takes with one seed, s.
    fn virtual_s(&self) -> f64 {
        self.scenario.duration_s * if self.scenario.against_true_parameters { 2.0 } else { 1.0 }
    }
}

/// Reads a scenario, its rig, its recordings and the controllers to compare.
///
/// # Errors
/// [`SoakError`] names the file, the key and what is allowed.
pub fn load(path: &Path, controllers: Option<&[String]>, seeds: Option<u32>) -> Result<Loaded, SoakError> {
    let (scenario, rig) = Scenario::read(path)?;
    let period_s = 1.0 / scenario.control_rate_hz;
    let model = ControlModel::from_rig(&rig, period_s)
        .map_err(|source| SoakError::Model { file: path.display().to_string(), source })?;
    let effects = truth::effects(&scenario, &rig, &model)
        .map_err(|message| ScenarioError { file: path.display().to_string(), message })?;
    let folder = path.parent().unwrap_or(Path::new("."));
    let names = controllers.map_or_else(|| scenario.controllers.clone(), <[String]>::to_vec);
    let controllers = names
        .iter()
        .map(|name| Ok((name.clone(), controller(name, folder)?)))
        .collect::<Result<_, SoakError>>()?;
    let replayed = scenario
        .references
        .iter()
        .map(|s| replay(s, folder, model.thrust_max_n))
        .collect::<Result<_, _>>()?;
    let seeds = seeds.unwrap_or(scenario.seeds);
    Ok(Loaded { scenario, rig, effects, replayed, thrust_max_n: model.thrust_max_n, controllers, seeds })
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
        return ControllerConfig::from_toml(&text)
            .map_err(|source| SoakError::Controller { file: place.display().to_string(), source });
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

/// Where a run stands, for whoever looks on.
pub struct Watch<'a> {
    /// Metrics that can be scraped.
    pub metrics: Option<&'a Metrics>,
}

/// Runs every controller of every scenario with every seed.
///
/// # Errors
/// [`SoakError`] if the threads cannot be had.
pub fn soak(loaded: &[Loaded], seed: u64, jobs: usize, watch: &Watch) -> Result<Report, SoakError> {
    let started = std::time::Instant::now();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
    let runs: Vec<(usize, usize, u32)> = loaded
        .iter()
        .enumerate()
        .flat_map(|(s, l)| (0..l.controllers.len()).flat_map(move |c| (0..l.seeds).map(move |k| (s, c, k))))
        .collect();
    let virtual_s: f64 = runs.iter().map(|(s, ..)| loaded[*s].virtual_s()).sum();
    let bar = crate::progress::bar(virtual_s as u64, "virtual seconds");
    let done_ms = AtomicU64::new(0);
    let outcomes: Vec<Result<Outcome, SoakError>> = pool.install(|| {
        runs.par_iter()
            .map(|&(s, c, k)| {
                let l = &loaded[s];
                let (name, config) = &l.controllers[c];
                let prepared = Prepared {
                    scenario: &l.scenario,
                    rig: &l.rig,
                    effects: &l.effects,
                    replayed: &l.replayed,
                    thrust_max_n: l.thrust_max_n,
                };
                let last = AtomicU64::new(0);
                let moved = |virtual_s: f64| {
                    let now = (virtual_s * 1e3) as u64;
                    let before = last.swap(now, Ordering::Relaxed);
                    let total = done_ms.fetch_add(now - before, Ordering::Relaxed) + now - before;
                    bar.set_position(total / 1000);
                };
                let progress = |share: f64, rms_n: f64, energy_j: f64| {
                    moved(share * l.scenario.duration_s);
                    if let Some(metrics) = watch.metrics {
                        metrics.progress(name, &l.scenario.name, k, share, rms_n, energy_j);
                    }
                };
                let seed = seed.wrapping_add(u64::from(k));
                let failed = |source| SoakError::Model { file: l.scenario.name.clone(), source };
                let mut outcome =
                    run::run(&prepared, config, seed, Knows::Stated, &progress).map_err(failed)?;
                if l.scenario.against_true_parameters {
                    let progress = |share: f64, _: f64, _: f64| moved((1.0 + share) * l.scenario.duration_s);
                    let told = run::run(&prepared, config, seed, Knows::Truth, &progress).map_err(failed)?;
                    outcome.compare(&told);
                }
                Ok(outcome)
            })
            .collect()
    });
    drop(bar);
    let mut outcomes = outcomes.into_iter();
    let mut scenarios = Vec::with_capacity(loaded.len());
    for l in loaded {
        let mut laws = Vec::with_capacity(l.controllers.len());
        for (name, _) in &l.controllers {
            let runs = outcomes.by_ref().take(l.seeds as usize).collect::<Result<Vec<_>, _>>()?;
            let law = LawResult::new(name, runs);
            if let Some(metrics) = watch.metrics {
                metrics.finished(name, &l.scenario.name, &law);
            }
            laws.push(law);
        }
        scenarios.push(ScenarioResult::new(&l.scenario.name, &l.scenario.what, l.thrust_max_n, laws));
    }
    let took = started.elapsed().as_secs_f64();
    eprintln!(
        "{virtual_s:.0} virtual seconds in {took:.1} s: {:.0} times real time",
        virtual_s / took.max(1e-9)
    );
    Ok(Report::new(loaded.iter().map(|l| l.scenario.duration_s).sum(), virtual_s, scenarios))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The example that lists every key is one that runs.
    #[test]
    fn the_example_in_the_docs_loads() {
        let docs = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/control.md");
        let docs = std::fs::read_to_string(docs).unwrap();
        let example = docs.split("```toml").nth(1).and_then(|t| t.split("```").next()).unwrap();
        let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/../../config/thrusters/t200.toml");
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.toml");
        std::fs::write(&path, example.replace("../thrusters/t200.toml", rig)).unwrap();
        let named = |name: &str| ControllerConfig::with_law(LawKind::from_name(name).unwrap());
        let loaded = load(&path, None, None).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(loaded.controllers[1].1.law, named("model2_inversion").law);
        let watch = Watch { metrics: None };
        let report = soak(&[loaded], 1, 1, &watch).unwrap();
        assert_eq!(report.virtual_seconds, 480.0);
    }

    #[test]
    fn every_shipped_scenario_loads() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/scenarios");
        let mut names = Vec::new();
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.file_name().is_some_and(|n| n.to_string_lossy().starts_with("soak-")) {
                let loaded = load(&path, None, None).unwrap_or_else(|e| panic!("{e}"));
                names.push(loaded.scenario.name);
            }
        }
        names.sort();
        let count = names.len();
        names.dedup();
        assert!(count >= 12 && names.len() == count, "{names:?}");
    }
}
