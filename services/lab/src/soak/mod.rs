//! `kort soak`: several controllers on the same plant, faults and references, on virtual time.

mod chain;
mod live;
mod metrics;
mod page;
mod reference;
mod report;
mod run;
mod scenario;
mod score;
mod sea;

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use kort_control::{ConfigError, ControlModel, ControllerConfig, LawKind, ModelError};
use kort_recording::Recording;
use kort_thruster::rig::Rig;
use rayon::prelude::*;
use thiserror::Error;

pub use live::{LiveError, live};
pub use metrics::{Metrics, MetricsError};
pub use page::page;
use reference::Replayed;
pub use report::Report;
use report::{LawResult, ScenarioResult};
use run::Prepared;
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
    #[error("{file}: {message}")]
    Replay {
        /// The recording.
        file: String,
        /// What is wrong.
        message: String,
    },
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
    replayed: Vec<Option<Replayed>>,
    thrust_max_n: f64,
    controllers: Vec<(String, ControllerConfig)>,
    seeds: u32,
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
    let folder = path.parent().unwrap_or(Path::new("."));
    let names = controllers.map_or_else(|| scenario.controllers.clone(), <[String]>::to_vec);
    let controllers = names
        .iter()
        .map(|name| Ok((name.clone(), controller(name, folder)?)))
        .collect::<Result<_, SoakError>>()?;
    let replayed = scenario.references.iter().map(|s| replay(s, folder)).collect::<Result<_, _>>()?;
    let seeds = seeds.unwrap_or(scenario.seeds);
    Ok(Loaded { scenario, rig, replayed, thrust_max_n: model.thrust_max_n, controllers, seeds })
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
fn replay(segment: &Segment, folder: &Path) -> Result<Option<Replayed>, SoakError> {
    let Segment::Replay { file, column, peak } = segment else { return Ok(None) };
    let path = folder.join(file);
    let error = |message: String| SoakError::Replay { file: path.display().to_string(), message };
    let (times, values) = replayed_column(&path, column).map_err(error)?;
    let largest = values.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    if largest <= 0.0 || times.is_empty() {
        return Err(error(format!("column `{column}` has no value but zero\nhint: name another `column`")));
    }
    let start = times[0];
    Ok(Some(Replayed {
        time_s: times.iter().map(|t| t - start).collect(),
        share: values.iter().map(|v| v * peak / largest).collect(),
    }))
}

/// Times and values of a column where it is sampled.
fn replayed_column(path: &Path, column: &str) -> Result<(Vec<f64>, Vec<f64>), String> {
    let recording = Recording::read(path, None).map_err(|e| e.to_string())?;
    let values = recording.column(column).ok_or_else(|| {
        format!("there is no column `{column}`\nhint: a recording with thrust commands has `thrust_cmd_n`")
    })?;
    Ok(recording.time_s.iter().zip(values).filter(|(_, v)| v.is_finite()).map(|(t, v)| (*t, *v)).unzip())
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
    let virtual_s: f64 = runs.iter().map(|(s, ..)| loaded[*s].scenario.duration_s).sum();
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
                    replayed: &l.replayed,
                    thrust_max_n: l.thrust_max_n,
                };
                let last = AtomicU64::new(0);
                let progress = |share: f64, rms_n: f64, energy_j: f64| {
                    let now = (share * l.scenario.duration_s * 1e3) as u64;
                    let before = last.swap(now, Ordering::Relaxed);
                    let total = done_ms.fetch_add(now - before, Ordering::Relaxed) + now - before;
                    bar.set_position(total / 1000);
                    if let Some(metrics) = watch.metrics {
                        metrics.progress(name, &l.scenario.name, k, share, rms_n, energy_j);
                    }
                };
                run::run(&prepared, config, seed.wrapping_add(u64::from(k)), &progress)
                    .map_err(|source| SoakError::Model { file: l.scenario.name.clone(), source })
            })
            .collect()
    });
    bar.finish_and_clear();
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
