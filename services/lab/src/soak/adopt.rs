//! `kort soak --adopt`: the whole loop on virtual time. Effects are hidden in the plant, a first run is diagnosed, what
//! is believed is written into the rig as `kort diagnose -o` writes it, and the run is repeated.

use std::time::Instant;

use kort_control::{ControlModel, ControllerConfig, EstimatorKind, LawKind};
use kort_diagnose::diagnose::{Options, diagnose};
use kort_identify::data::Series;
use kort_soak::{
    Drawn, Hidden, Hooked, Knows, LawResult, Log, Outcome, Prepared, ScenarioResult, hidden, run_logged,
};
use kort_thruster::models::ModelName;
use kort_thruster::rig::{KnownEffect, Rig};
use rayon::prelude::*;

use super::Watch;
use super::adoption::{Adoption, Found, LeftOut};
use super::chain::ProductionChain;
use super::load::{Contestant, Loaded, SoakError};
use super::report::Report;
use crate::believed::{DIAGNOSED, believed, left_out};

/// An adoption that makes thrust error larger by more than this factor has failed.
pub const WORSE: f64 = 1.05;

/// Runs every scenario with every seed: hidden effects, first run, diagnosis, second run.
///
/// # Errors
/// [`SoakError`] if a scenario hides nothing, a controller cannot be designed, or the threads cannot be had.
pub fn adopt(loaded: &[Loaded], seed: u64, jobs: usize, watch: &Watch) -> Result<Report, SoakError> {
    let started = Instant::now();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(jobs).build()?;
    let cases: Vec<(&Loaded, u64)> =
        loaded.iter().flat_map(|l| (0..l.seeds).map(move |k| (l, seed.wrapping_add(u64::from(k))))).collect();
    let bar = crate::progress::bar(cases.len() as u64, "cases");
    let done: Vec<Result<Done, SoakError>> = pool.install(|| {
        cases
            .par_iter()
            .map(|(loaded, seed)| {
                let done = one(loaded, *seed);
                bar.inc(1);
                done
            })
            .collect()
    });
    drop(bar);
    let mut done = done.into_iter();
    let (mut scenarios, mut adoptions, mut virtual_s) = (Vec::new(), Vec::new(), 0.0);
    for l in loaded {
        let of_scenario = done.by_ref().take(l.seeds as usize).collect::<Result<Vec<_>, _>>()?;
        let laws = laws(l);
        let mut first: Vec<Vec<Outcome>> = laws.iter().map(|_| Vec::new()).collect();
        for case in of_scenario {
            virtual_s += case.runs as f64 * l.scenario.duration_s;
            adoptions.extend(case.adoptions);
            case.first.into_iter().zip(&mut first).for_each(|(outcome, law)| law.push(outcome));
        }
        let laws =
            laws.iter().zip(first).map(|((name, _), outcomes)| LawResult::new(name, outcomes)).collect();
        scenarios.push(ScenarioResult::new(&l.prepared(), laws));
    }
    if let Some(metrics) = watch.metrics {
        for s in &scenarios {
            s.laws.iter().for_each(|law| metrics.finished(&law.name, &s.name, law));
        }
    }
    eprintln!("{} cases in {:.1} s", cases.len(), started.elapsed().as_secs_f64());
    let seconds = loaded.iter().map(|l| l.scenario.duration_s).sum();
    Ok(Report::new(seconds, virtual_s, scenarios).with_adoption(adoptions))
}

/// The controllers of a scenario that are laws.
fn laws(loaded: &Loaded) -> Vec<(&str, &ControllerConfig)> {
    let law = |(name, contestant): &'_ (String, Contestant)| match contestant {
        Contestant::Law(_) => Some(name.clone()),
        Contestant::Limits => None,
    };
    loaded
        .controllers
        .iter()
        .filter(|c| law(c).is_some())
        .filter_map(|(name, contestant)| match contestant {
            Contestant::Law(config) => Some((name.as_str(), config.as_ref())),
            Contestant::Limits => None,
        })
        .collect()
}

/// What one seed gave.
struct Done {
    adoptions: Vec<Adoption>,
    /// The first runs, law by law.
    first: Vec<Outcome>,
    runs: usize,
}

/// One seed of a scenario.
struct Case<'a> {
    loaded: &'a Loaded,
    seed: u64,
    effects: Vec<Hooked>,
    drawn: Vec<Drawn>,
}

fn one(loaded: &Loaded, seed: u64) -> Result<Done, SoakError> {
    let scenario = &loaded.scenario;
    let Some(hides) = &scenario.hidden else {
        return Err(SoakError::HidesNothing { scenario: scenario.name.clone() });
    };
    let failed = |source| SoakError::Model { file: scenario.name.clone(), source };
    let model = ControlModel::from_rig(&loaded.rig, 1.0 / scenario.control_rate_hz).map_err(failed)?;
    let drawn = hides.draw(&loaded.rig, &model, seed);
    let effects = loaded.effects.iter().cloned().chain(drawn.iter().map(|d| d.hooked.clone())).collect();
    let case = Case { loaded, seed, effects, drawn };
    let laws = laws(loaded);
    let Some((_, first_law)) = laws.first() else {
        return Err(SoakError::HidesNothing { scenario: scenario.name.clone() });
    };
    let Diagnosed { found, left_out } = case.diagnosed(hides, first_law)?;
    let adopted_rig = case.adopted(&found)?;
    let truth = hidden::told(&loaded.rig, &case.drawn);
    let mut done = Done { adoptions: Vec::new(), first: Vec::new(), runs: 1 };
    for (name, config) in laws {
        let before = case.run(config, Knows::Stated)?;
        let after = if found.is_empty() { None } else { Some(case.run(config, Knows::Rig(&adopted_rig))?) };
        let told = case.run(config, Knows::Rig(&truth))?;
        let adapting = ControllerConfig { estimator: EstimatorKind::Rls, ..*config };
        let learns = config.law != LawKind::ThrustPi && config.estimator == EstimatorKind::Off;
        let adaptive = if learns { Some(case.run(&adapting, Knows::Stated)?) } else { None };
        done.runs += 3 + usize::from(after.is_some());
        let (first, second) = (rms(&before), after.as_ref().map_or(rms(&before), rms));
        let ratio = second / first;
        let errors = Errors { first, second, told: rms(&told) };
        let cause = if ratio > WORSE { Some(case.cause(config, &found, errors)?) } else { None };
        done.adoptions.push(Adoption {
            scenario: scenario.name.clone(),
            rig: loaded.rig.name.clone(),
            seed,
            law: name.to_owned(),
            hidden: case.drawn.iter().map(Found::of_drawn).collect(),
            adopted: found.iter().map(|(known, probability)| Found::of_known(known, *probability)).collect(),
            left_out: left_out.clone(),
            before: first,
            after: second,
            truth_told: errors.told,
            adaptive: adaptive.as_ref().map(rms),
            ratio,
            cause,
        });
        done.first.push(before);
    }
    Ok(done)
}

/// Thrust error of a run, N.
fn rms(outcome: &Outcome) -> f64 {
    outcome.scores.get("thrust_rms_n").copied().unwrap_or(f64::NAN)
}

/// What a diagnosis came to.
struct Diagnosed {
    /// What is believed, and how surely.
    found: Vec<(KnownEffect, f64)>,
    left_out: Vec<LeftOut>,
}

/// Thrust errors of a law, N: with the stated rig, with what was adopted, and told the truth.
#[derive(Clone, Copy)]
struct Errors {
    first: f64,
    second: f64,
    told: f64,
}

impl Case<'_> {
    fn prepared(&self) -> Prepared<'_> {
        Prepared { effects: &self.effects, ..self.loaded.prepared() }
    }

    fn run(&self, config: &ControllerConfig, knows: Knows) -> Result<Outcome, SoakError> {
        kort_soak::run::<ProductionChain>(&self.prepared(), config, self.seed, knows, &|_, _, _| ())
            .map_err(|source| SoakError::Model { file: self.loaded.scenario.name.clone(), source })
    }

    /// The first run's recording, diagnosed with the stated rig.
    fn diagnosed(&self, hides: &Hidden, config: &ControllerConfig) -> Result<Diagnosed, SoakError> {
        let (loaded, scenario) = (self.loaded, &self.loaded.scenario);
        let mut log = Log::new(loaded.rig.amplifier.kind, scenario.control_rate_hz, hides.log_rate_hz);
        run_logged::<ProductionChain>(&self.prepared(), config, self.seed, Knows::Stated, &mut log)
            .map_err(|source| SoakError::Model { file: scenario.name.clone(), source })?;
        let columns = log.columns();
        let series =
            Series { name: format!("{} seed {}", scenario.name, self.seed), time_s: log.time_s, columns };
        let options = Options { model: ModelName::Model2, seed: self.seed, with: Vec::new() };
        let diagnosis = diagnose(&[series], &loaded.rig, &options, &|_| ())
            .map_err(|e| SoakError::Diagnosis { scenario: scenario.name.clone(), message: e.to_string() })?;
        let found = believed(&diagnosis.report);
        // Through the same writer as a rig that is adopted by hand.
        let text =
            Rig::with_effects_toml(&loaded.rig_text, &found, DIAGNOSED).map_err(|e| self.unwritten(&e))?;
        let rig = Rig::from_toml(&text).map_err(|e| self.unwritten(&e))?;
        let sure =
            |id: &str| diagnosis.report.findings.iter().find(|f| f.effect == id).map(|f| f.probability);
        let told = |(effect, why): (&str, &str)| LeftOut { effect: effect.into(), why: why.into() };
        let left_out = left_out(&diagnosis.report).map(told).collect();
        let found = rig
            .effects
            .into_iter()
            .filter(|known| found.iter().any(|f| f.effect == known.effect))
            .map(|known| (sure(known.effect).unwrap_or(0.0), known))
            .map(|(probability, known)| (known, probability))
            .collect();
        Ok(Diagnosed { found, left_out })
    }

    fn unwritten(&self, error: &dyn std::fmt::Display) -> SoakError {
        SoakError::Diagnosis { scenario: self.loaded.scenario.name.clone(), message: error.to_string() }
    }

    /// The rig with what was found.
    fn adopted(&self, found: &[(KnownEffect, f64)]) -> Result<Rig, SoakError> {
        let mut rig = self.loaded.rig.clone();
        rig.effects.retain(|known| found.iter().all(|(f, _)| f.effect != known.effect));
        rig.effects.extend(found.iter().map(|(known, _)| known.clone()));
        Ok(rig)
    }

    /// Why an adoption made thrust worse: what of it to leave out makes thrust best again, and whether it was there.
    fn cause(
        &self,
        config: &ControllerConfig,
        found: &[(KnownEffect, f64)],
        errors: Errors,
    ) -> Result<String, SoakError> {
        let mut best: Option<(f64, &KnownEffect)> = None;
        for (k, (known, _)) in found.iter().enumerate() {
            let rest: Vec<_> =
                found.iter().enumerate().filter(|(i, _)| *i != k).map(|(_, f)| f.clone()).collect();
            let without = rms(&self.run(config, Knows::Rig(&self.adopted(&rest)?))?);
            if without < best.map_or(errors.second, |(least, _)| least) {
                best = Some((without, known));
            }
        }
        let Some((without, known)) = best else {
            return Ok("no single one of the findings: they err together".into());
        };
        let truth = hidden::told(&self.loaded.rig, &self.drawn).effects;
        let what = match truth.iter().find(|truth| truth.effect == known.effect) {
            None => "is not there".to_owned(),
            // Right or wrong in size, it does the law no good.
            Some(_) if errors.told > errors.first => {
                format!("is there, and told the truth the law does worse too ({:.3} N)", errors.told)
            }
            Some(truth) => {
                let right: Vec<_> = found
                    .iter()
                    .map(|(f, sure)| (if f.effect == truth.effect { truth } else { f }.clone(), *sure))
                    .collect();
                let error = rms(&self.run(config, Knows::Rig(&self.adopted(&right)?))?);
                if error > WORSE * errors.first {
                    let missed = self.drawn.iter().map(|d| d.hooked.0.id);
                    let missed: Vec<_> =
                        missed.filter(|id| found.iter().all(|(f, _)| f.effect != *id)).collect();
                    format!(
                        "is there, and at its true size the error is {error:.3} N too: it makes up for what was not adopted ({})",
                        missed.join(", ")
                    )
                } else {
                    format!("is there, but its size is wrong (at the true one the error is {error:.3} N)")
                }
            }
        };
        Ok(format!("{} {what}: without it the error is {without:.3} N", known.effect))
    }
}
