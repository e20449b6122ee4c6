//! `kort soak`: the engine of `kort-soak` with the production ticks, on all cores or against a
//! running service, and what is shown of it.

mod adopt;
mod adoption;
mod chain;
mod live;
mod load;
mod markdown;
mod metrics;
mod page;
mod report;

use std::sync::atomic::{AtomicU64, Ordering};

use kort_soak::{Knows, LawResult, Outcome, ScenarioResult};
use rayon::prelude::*;

pub use adopt::adopt;
pub use adoption::Adoption;
use chain::ProductionChain;
pub use live::{LiveError, live};
pub use load::{Contestant, DEFAULT, Instead, Loaded, SoakError, load, of_text};
pub use markdown::put_into;
pub use metrics::{Metrics, MetricsError};
pub use page::page;
pub use report::Report;

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
    let virtual_s: f64 = runs.iter().map(|(s, ..)| loaded[*s].scenario.virtual_s()).sum();
    let bar = crate::progress::bar(virtual_s as u64, "virtual seconds");
    let done_ms = AtomicU64::new(0);
    let outcomes: Vec<Result<Outcome, SoakError>> = pool.install(|| {
        runs.par_iter()
            .map(|&(s, c, k)| {
                let l = &loaded[s];
                let (name, contestant) = &l.controllers[c];
                let prepared = l.prepared();
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
                let run = kort_soak::run::<ProductionChain>;
                let Contestant::Law(config) = contestant else {
                    return kort_soak::limits::limits(&prepared, seed, &progress).map_err(failed);
                };
                let mut outcome = run(&prepared, config, seed, Knows::Stated, &progress).map_err(failed)?;
                if l.scenario.against_true_parameters {
                    let progress = |share: f64, _: f64, _: f64| moved((1.0 + share) * l.scenario.duration_s);
                    let told = run(&prepared, config, seed, Knows::Truth, &progress).map_err(failed)?;
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
        scenarios.push(ScenarioResult::new(&l.prepared(), laws));
    }
    let took = started.elapsed().as_secs_f64();
    let threads = pool.current_num_threads().min(runs.len());
    eprintln!(
        "{virtual_s:.0} virtual seconds in {took:.1} s: {:.0} times real time on {threads} threads",
        virtual_s / took.max(1e-9)
    );
    Ok(Report::new(loaded.iter().map(|l| l.scenario.duration_s).sum(), virtual_s, scenarios))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use kort_control::{ControllerConfig, LawKind};

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
        let loaded = load(&path, &Instead::default()).unwrap_or_else(|e| panic!("{e}"));
        let Contestant::Law(config) = &loaded.controllers[1].1 else { panic!("{:?}", loaded.controllers) };
        assert_eq!(config.law, named("model2_inversion").law);
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
                let loaded = load(&path, &Instead::default()).unwrap_or_else(|e| panic!("{e}"));
                names.push(loaded.scenario.name);
            }
        }
        names.sort();
        let count = names.len();
        names.dedup();
        assert!(count >= 12 && names.len() == count, "{names:?}");
    }
}
