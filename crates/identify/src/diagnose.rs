//! The diagnosis: prepare, check, fit the baseline, search, judge, and write the report.

use kort_thruster::effects::Descriptor;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::rig::Rig;

use crate::baseline::{self, Member, members, recompose};
use crate::changes::{self, is_change};
use crate::checks;
use crate::data::{DataError, Driving, Prepared, Series, available, scale};
use crate::errors;
use crate::experiment;
use crate::fit::{Fit, Problem, Stack, Target};
use crate::heldout::{held_out_rows, longest_block_s};
use crate::judge::{self, Outcome, margin, mates};
use crate::library::is_term;
use crate::locate::{locate, since_edge};
use crate::report::{
    Alternative, Baseline, EmpiricalTerm, Finding, HeldOut, Mismatch, ParameterReport, Report, Verdict,
};
use crate::rules;
use crate::search::Search;
use crate::verdict::{doubt_kin, least_beside_others, verdict};
use crate::words;

/// How to diagnose.
#[derive(Clone, Debug)]
pub struct Options {
    /// Baseline model.
    pub model: ModelName,
    /// Seed of the bootstrap.
    pub seed: u64,
}

/// What plots need beyond the report.
pub struct Traces {
    /// One entry a recording and channel.
    pub channels: Vec<Trace>,
}

/// One channel of one recording, measured and simulated.
pub struct Trace {
    /// Recording's name.
    pub recording: String,
    /// Column.
    pub channel: &'static str,
    /// Time of each sample, s.
    pub time_s: Vec<f64>,
    /// Measured.
    pub measured: Vec<f64>,
    /// Simulated by the re-fitted baseline.
    pub baseline: Vec<f64>,
    /// Simulated with everything found.
    pub explained: Vec<f64>,
    /// Shaft speed simulated at each sample, rad/s.
    pub shaft_speed_rad_s: Vec<f64>,
    /// Time since the last step of the command at each sample, s; infinite before the first.
    pub since_step_s: Vec<f64>,
}

/// A diagnosis: the report, and traces for its plots.
pub struct Diagnosis {
    /// The report.
    pub report: Report,
    /// For plots.
    pub traces: Traces,
}

/// Diagnoses recordings of one rig together.
///
/// # Errors
/// [`DataError`] if a recording cannot be compared with a model at all.
pub fn diagnose(
    series: &[Series],
    rig: &Rig,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, DataError> {
    let setup = Setup::new(series, rig, options.model)?;
    let Setup { problem, hypothesis, notes, thin } = setup;
    let scale = scale(&problem.recordings, rig);
    let offered = available(options.model, series, &problem.recordings);
    let mut search = Search::new(problem, scale, &offered);
    let outcome = judge::run(&mut search, &hypothesis, series, progress);
    progress("scoring on held-out data");
    Ok(write(&search, outcome, series, rig, options, notes, thin))
}

/// A problem ready to fit, shared by `diagnose` and `fit`.
pub struct Setup<'a> {
    /// The problem, with flat whiteners.
    pub problem: Problem<'a>,
    /// The baseline's free parameters.
    pub hypothesis: crate::fit::Hypothesis,
    /// Words from the checks.
    pub notes: Vec<String>,
    /// Why the recording cannot tell anything, if so.
    pub thin: Option<String>,
}

impl<'a> Setup<'a> {
    /// Prepares recordings for a model.
    ///
    /// # Errors
    /// [`DataError`] if a recording cannot be compared with a model at all.
    pub fn new(series: &[Series], rig: &'a Rig, model: ModelName) -> Result<Self, DataError> {
        let mut recordings: Vec<Prepared> = series
            .iter()
            .map(|s| Prepared::new(s, rig, model == ModelName::Model3))
            .collect::<Result<_, _>>()?;
        let mut notes = Vec::new();
        let mut masked = Vec::new();
        for (one, prepared) in series.iter().zip(&recordings) {
            let checked = checks::check(one, rig);
            notes.extend(checked.notes);
            let mut rows = checked.masked;
            if prepared.start[0] != 0.0 {
                // The state before the first row is not known: let it settle.
                let until = prepared.time_s[0] + (0.1 * prepared.duration_s()).min(2.0);
                prepared.time_s.iter().zip(&mut rows).for_each(|(t, m)| *m |= *t < until);
            }
            masked.push(rows);
        }
        if baseline::nothing_stated(rig) {
            notes.push(format!(
                "the rig description states no tolerance: coefficients are taken as uncertain by {:.0} % (two sigma)",
                100.0 * baseline::UNSTATED_TOL
            ));
        }
        if settled(&recordings) {
            notes.push(
                "a table of settled points: nothing in it accelerates, so inertia, added mass, lags and delays do not show; in bollard pull every point has the same angle of attack. kort fit-table makes a rig from such a table and says what it cannot fix"
                    .into(),
            );
        }
        let prescribed = recordings.iter().all(|p| p.driving == Driving::Speed);
        let current = recordings
            .iter()
            .any(|p| p.channels.iter().any(|c| c.response == crate::data::Response::Current));
        let hypothesis = baseline::hypothesis(model, rig, prescribed, current);
        let thin = too_thin(&recordings);
        let stated = Parameters::stated(rig);
        recordings.iter_mut().for_each(|r| r.mark_smooth(model, rig, &stated));
        let mut problem = Problem { model, rig, stated, recordings, whiteners: Vec::new(), masked };
        problem.flat_noise();
        Ok(Self { problem, hypothesis, notes, thin })
    }
}

/// Recordings without enough change to tell anything.
fn too_thin(recordings: &[Prepared]) -> Option<String> {
    let samples: usize = recordings.iter().map(|r| r.time_s.len()).sum();
    if samples < 200 {
        return Some(format!("{samples} rows in all are too few to learn the noise and hold data out"));
    }
    let changes: usize = recordings
        .iter()
        .map(|r| {
            let top = r.command.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
            let mut at = r.command[0];
            let mut moves = 0;
            for c in &r.command {
                if (c - at).abs() > 0.1 * top {
                    moves += 1;
                    at = *c;
                }
            }
            moves
        })
        .sum();
    (changes < 3)
        .then(|| "the driving signal hardly changes: steady data cannot part physics from parameters".into())
}

/// One sample a step of the command, each just before the next: a table of settled points.
fn settled(recordings: &[Prepared]) -> bool {
    recordings.iter().all(|r| {
        r.channels.iter().all(|c| {
            let last = c.rows.iter().filter(|k| r.command.get(**k + 1).is_none_or(|n| *n != r.command[**k]));
            let alone = c.rows.windows(2).all(|w| w[1] > w[0] + 1);
            alone && last.count() as f64 > 0.8 * c.rows.len() as f64
        })
    })
}

fn write(
    search: &Search,
    mut outcome: Outcome,
    series: &[Series],
    rig: &Rig,
    options: &Options,
    mut notes: Vec<String>,
    thin: Option<String>,
) -> Diagnosis {
    let problem = &search.problem;
    let rivals = outcome.places.iter().flat_map(|p| p.rivals.iter().map(|r| &r.0.0));
    let longest_s = longest_block_s(outcome.last.hypothesis.effects.iter().chain(rivals), &search.scale);
    let held = held_out_rows(problem, &[&outcome.last], longest_s);
    let baseline_full = problem.residual_of(&outcome.baseline);
    let last_full = problem.residual_of(&outcome.last);
    let floor = errors::noise_floor(problem, &last_full);
    let std_baseline = errors::std_errors(problem, &mut outcome.baseline);
    let std_last = errors::std_errors(problem, &mut outcome.last);

    // Fits on the training rows alone.
    let training = problem.without(&held);
    let baseline_train = training.again(&outcome.baseline, 4);
    let last_train =
        if outcome.places.is_empty() { baseline_train.clone() } else { training.again(&outcome.last, 4) };
    let with = |list: &[Member]| -> Fit {
        let (hypothesis, columns) = recompose(&last_train, list, &search.scale);
        training.fit(&hypothesis, &columns, 6)
    };
    let residual_baseline = problem.residual_of(&baseline_train);
    let residual_last = problem.residual_of(&last_train);
    let score =
        |before: &Stack, after: &Stack| errors::held_out(problem, &held, before, after, &floor, options.seed);

    let rows = search.problem.rows(&outcome.last.hypothesis, &outcome.last.values);
    let speed: Vec<Vec<f64>> =
        rows.iter().map(|rows| rows.iter().map(|s| s.true_speed_rad_s).collect()).collect();

    let all = members(&search.problem, &last_train);
    let total_gain: f64 = outcome.places.iter().map(|p| p.gain).sum();
    let gains: Vec<(&Descriptor, f64)> = outcome.places.iter().map(|p| (p.chosen, p.gain)).collect();
    let single = outcome.places.len() == 1;
    let mut findings = Vec::new();
    let mut weak: Vec<&str> = Vec::new();
    let mut mismatch = Vec::new();
    let mut alternatives = Vec::new();
    let mut empirical_term = None;
    for (i, place) in outcome.places.iter_mut().enumerate() {
        let rest: Vec<Member> = all.iter().filter(|m| m.0.id != place.chosen.id).cloned().collect();
        let without =
            if rest.is_empty() { residual_baseline.clone() } else { problem.residual_of(&with(&rest)) };
        let held_here = score(&without, &residual_last);
        if held_here.excess_error_removed < least_beside_others(search, place, &gains) {
            // Beside others, a name that hardly removes anything on new data is none.
            weak.push(place.chosen.id);
            if !is_term(place.chosen) {
                alternatives.push(words::weak(place.chosen.id, &held_here));
            }
            continue;
        }
        // A rival must pass the held-out test too.
        let mut rival_fits = Vec::new();
        for ((rival, values), distance) in std::mem::take(&mut place.rivals) {
            let mut swapped = all.clone();
            if let Some(slot) = swapped.iter().position(|m| m.0.id == place.chosen.id) {
                swapped[slot] = (rival, values.clone());
            }
            let fit = with(&swapped);
            let held_rival = score(&without, &problem.residual_of(&fit));
            // What is known to be confused and comes as near as this on all the data stays a rival, though
            // the part it is fitted to for the test may lead it astray.
            let alike =
                mates(rival, place.chosen) && distance < margin(place.gain) && !search.free_in_time(rival);
            let removes = held_rival.excess_error_removed;
            if alike || removes > rules::RIVAL_SHARE * held_here.excess_error_removed {
                place.rivals.push(((rival, values), distance));
                rival_fits.push((fit, held_rival));
            } else {
                place.aside.insert(0, (rival, distance));
            }
        }
        let place = &*place;
        let full_without = if single { &baseline_full } else { &without };
        let located = locate(&search.problem, full_without, &last_full, &speed);
        let odds = words::odds(place);
        let (regime, spans) =
            match members(&search.problem, &outcome.last).into_iter().find(|m| is_change(m.0)) {
                Some((term, values)) if term.id == place.chosen.id => {
                    let end = search.problem.recordings[0].time_s.last().copied().unwrap_or(0.0);
                    (words::changes(&values), changes::spans(&values, end))
                }
                _ => (located.regime.clone(), located.spans.clone()),
            };
        mismatch.push(Mismatch {
            path: place.chosen.path.name().into(),
            channel: located.channel.into(),
            regime,
            time_s: spans,
            significance_sigma: place.gain.max(0.0).sqrt(),
            share_of_excess_error: (place.gain / total_gain.max(1e-9)).clamp(0.0, 1.0),
        });
        if is_term(place.chosen) {
            empirical_term = Some(empirical(search, &outcome.last, &std_last, place.chosen, held_here));
            continue;
        }
        let same: Vec<String> = place.rivals.iter().map(|r| r.0.0.id.to_string()).collect();
        let first = finding(&outcome.last, &std_last, place, i, held_here, odds[0], same.clone(), &located);
        findings.push((place.gain, first));
        for (k, (((rival, _), distance), (fit, held_rival))) in
            place.rivals.iter().zip(rival_fits).enumerate()
        {
            let others: Vec<String> = std::iter::once(place.chosen.id.to_string())
                .chain(same.iter().filter(|s| *s != rival.id).cloned())
                .collect();
            let other = rival_finding(search, fit, rival, *distance, held_rival, odds[k + 1], others);
            findings.push((place.gain, other));
        }
        for (effect, distance) in place.aside.iter().filter(|a| !is_term(a.0)) {
            alternatives.push(Alternative {
                effect: effect.id.into(),
                probability: words::small_odds(*distance, place.gain),
                why_not: words::why_not(place.chosen.id, *distance, place.gain),
            });
        }
    }
    outcome.places.retain(|p| !weak.contains(&p.chosen.id));
    doubt_kin(&outcome.places, &mut findings);
    if let Some((effect, gain, why)) = outcome.doubt
        && !is_term(effect)
    {
        alternatives.push(Alternative {
            effect: effect.id.into(),
            probability: 0.02,
            why_not: format!("would lower the misfit by {gain:.0} (in twice the log-likelihood), but {why}"),
        });
    }
    if outcome.places.is_empty()
        && let Some((channel, size)) = outcome.excess
    {
        mismatch.push(bare_mismatch(search, &outcome.baseline, &baseline_full, channel, size, &speed));
    }
    if findings.len() > 1 {
        let everything = score(&residual_baseline, &residual_last).excess_error_removed;
        notes.push(format!(
            "everything found together removes {:.0} % of the error above the noise on held-out data",
            100.0 * everything
        ));
    }
    // Best first: what explains most, and of its rivals the likeliest.
    findings.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.probability.total_cmp(&a.1.probability)));
    let mut findings: Vec<Finding> = findings.into_iter().map(|f| f.1).collect();
    let verdict = verdict(&outcome, &findings, total_gain, thin.is_some());
    if verdict == Verdict::Unexplained {
        findings.iter_mut().for_each(|f| f.probability *= rules::BESIDE_UNKNOWN);
    }
    if outcome.excess.is_some() && verdict == Verdict::Unexplained {
        // Much is left: a name that hardly removes anything of it is no finding.
        let (kept, weak): (Vec<Finding>, Vec<Finding>) =
            findings.into_iter().partition(|f| f.heldout.excess_error_removed > rules::LEAST_OF_A_FINDING);
        findings = kept;
        alternatives.extend(weak.iter().map(|f| words::weak(&f.effect, &f.heldout)));
    }
    if let (Some(why), Verdict::InsufficientData) = (&thin, verdict) {
        notes.insert(0, why.clone());
    }
    if let Some((other, distance)) = outcome.elsewhere {
        let gain = outcome.places.first().map_or(0.0, |p| p.gain);
        notes.push(words::elsewhere(other, distance, gain));
    }
    notes.extend(words::strained(&outcome.baseline));
    notes.extend(words::unused(series, &search.problem, search.driver.as_deref()));
    let baseline = Baseline {
        model: options.model.name().into(),
        parameters: parameters(&outcome.baseline, &std_baseline, None),
        channels: errors::channels(&search.problem, &held, &residual_baseline, &baseline_full, &floor),
    };
    let next_experiment = experiment::next(search, &outcome, rig);
    let report = Report {
        schema: "kort.diagnosis/1".into(),
        kort_version: env!("CARGO_PKG_VERSION").into(),
        recordings: series.iter().map(|s| s.name.clone()).collect(),
        rig: rig.name.clone(),
        seed: options.seed,
        seconds: search.problem.recordings.iter().map(Prepared::duration_s).sum(),
        verdict,
        summary: words::summary(
            verdict,
            &findings,
            &mismatch,
            empirical_term.as_ref(),
            next_experiment.as_ref(),
            &baseline,
            &outcome,
            thin.as_deref(),
        ),
        baseline,
        mismatch,
        findings,
        alternatives,
        empirical_term,
        next_experiment,
        notes,
    };
    Diagnosis { report, traces: traces(&search.problem, &baseline_full, &last_full, &speed) }
}

/// A mismatch that neither name nor term describes: located by its error alone, on the path whose
/// effects and terms point at it most.
fn bare_mismatch(
    search: &Search,
    fit: &Fit,
    residual: &Stack,
    channel: &'static str,
    size: f64,
    speed: &[Vec<f64>],
) -> Mismatch {
    let nothing: Stack = residual.iter().map(|r| r.iter().map(|c| vec![0.0; c.len()]).collect()).collect();
    let located = locate(&search.problem, residual, &nothing, speed);
    let sum = fit.chi2.max(1.0);
    Mismatch {
        path: match channel {
            "current_a" => "drive",
            "shaft_speed_rad_s" => "shaft",
            "flow_m_s" => "flow",
            _ => "blade",
        }
        .into(),
        channel: channel.into(),
        regime: format!("{} ({:.1} % of full scale above the noise)", located.regime, 100.0 * size),
        time_s: located.spans,
        significance_sigma: sum.sqrt(),
        share_of_excess_error: 1.0,
    }
}

/// Free parameters of a fit for a report: the baseline's, or those of one effect.
pub fn parameters(fit: &Fit, std: &[f64], effect: Option<usize>) -> Vec<ParameterReport> {
    fit.hypothesis
        .free
        .iter()
        .enumerate()
        .filter(|(_, f)| match (f.target, effect) {
            (Target::Base(_), None) => true,
            (Target::Effect(i, _), Some(wanted)) => i == wanted,
            _ => false,
        })
        .map(|(k, f)| ParameterReport {
            name: f.name.into(),
            value: fit.values[k],
            unit: f.unit.into(),
            std_error: std[k],
            stated: f.prior.filter(|_| effect.is_none()).map(|p| p.0),
            at_bound: Some(fit.at_bound[k]),
        })
        .collect()
}

#[expect(clippy::too_many_arguments, reason = "one call, every argument a part of the finding")]
fn finding(
    last: &Fit,
    std: &[f64],
    place: &judge::Place,
    slot: usize,
    heldout: HeldOut,
    probability: f64,
    confounded_with: Vec<String>,
    located: &crate::locate::Place,
) -> Finding {
    Finding {
        effect: place.chosen.id.into(),
        path: place.chosen.path.name().into(),
        probability,
        statement: words::statement(place.chosen),
        equation: place.chosen.equation.into(),
        parameters: parameters(last, std, Some(slot)),
        evidence: words::evidence(place, &heldout, located),
        heldout,
        confounded_with,
    }
}

fn rival_finding(
    search: &Search,
    mut fit: Fit,
    rival: &'static Descriptor,
    distance: f64,
    heldout: HeldOut,
    probability: f64,
    confounded_with: Vec<String>,
) -> Finding {
    let std = errors::std_errors(&search.problem, &mut fit);
    let slot = fit.hypothesis.effects.iter().position(|e| e.id == rival.id);
    Finding {
        effect: rival.id.into(),
        path: rival.path.name().into(),
        probability,
        statement: words::statement(rival),
        equation: rival.equation.into(),
        parameters: parameters(&fit, &std, slot),
        heldout,
        evidence: vec![format!(
            "explains the recording as well: its misfit differs by {distance:.1} in twice the log-likelihood, within doubt"
        )],
        confounded_with,
    }
}

fn empirical(
    search: &Search,
    last: &Fit,
    std: &[f64],
    term: &'static Descriptor,
    heldout: HeldOut,
) -> EmpiricalTerm {
    let slot = last.hypothesis.effects.iter().position(|e| e.id == term.id);
    let values =
        members(&search.problem, last).into_iter().find(|m| m.0.id == term.id).map_or_else(Vec::new, |m| m.1);
    let (enters, variables) = words::enters(term);
    EmpiricalTerm {
        path: term.path.name().into(),
        enters: enters.into(),
        expression: words::expression(term, &values, search.driver.as_deref()),
        variables: variables
            .iter()
            .map(|v| if *v == "column" { search.driver.clone().unwrap_or_default() } else { (*v).into() })
            .collect(),
        parameters: slot.map_or_else(Vec::new, |slot| parameters(last, std, Some(slot))),
        heldout,
    }
}

fn traces(problem: &Problem, before: &Stack, after: &Stack, speed: &[Vec<f64>]) -> Traces {
    let mut channels = Vec::new();
    for (r, recording) in problem.recordings.iter().enumerate() {
        let since = since_edge(recording);
        for (c, channel) in recording.channels.iter().enumerate() {
            // A run-in is left out: the state before the first row is not known.
            let masked = &problem.masked[r];
            let from = channel.rows.iter().position(|k| !masked[*k]).unwrap_or(0);
            let from = if masked[..channel.rows[from]].iter().all(|m| *m) { from } else { 0 };
            let minus = |residual: &[f64]| {
                channel.values[from..].iter().zip(&residual[from..]).map(|(m, e)| m - e).collect()
            };
            channels.push(Trace {
                recording: recording.name.clone(),
                channel: channel.response.name(),
                time_s: channel.rows[from..].iter().map(|k| recording.time_s[*k]).collect(),
                measured: channel.values[from..].to_vec(),
                baseline: minus(&before[r][c]),
                explained: minus(&after[r][c]),
                shaft_speed_rad_s: channel.rows[from..].iter().map(|k| speed[r][*k]).collect(),
                since_step_s: channel.rows[from..].iter().map(|k| since[*k]).collect(),
            });
        }
    }
    Traces { channels }
}
