//! Recordings of one rig made ready to compare with a model: what `fit` and `diagnose` start from.

use std::collections::BTreeSet;
use std::sync::Arc;

use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::rig::Rig;

use crate::checks;
use crate::data::experiments::{self, Experiment, experiments};
use crate::data::{DataError, Driving, Prepared, Series, counted_angle, fresh, possible_drivers, spread};
use crate::excerpt;
use crate::hypothesis::{Free, Hypothesis, Inputs, Target, UNSTATED_TOL, nothing_stated};
use crate::mistaken::{mistaken, turned};
use crate::noise::Criterion;
use crate::readings;
use crate::refuse;
use crate::simulate::Problem;
use crate::spectrum::median_interval;
use crate::thin::{Thin, nothing_left, too_thin};
use crate::too_slow;

/// Most steps of the fit that tells whether known effects are as stated.
const STEPS: usize = 24;

/// A problem ready to fit.
pub struct Setup<'a> {
    /// What is compared: the recordings, or the stretches of them that were chosen; one of a speed drive may stand as two.
    pub series: Vec<Series>,
    /// The problem.
    pub problem: Problem<'a>,
    /// The baseline with its free numbers.
    pub baseline: Hypothesis,
    /// Rows that the checks flag, by recording of the problem.
    pub flagged: Vec<Vec<bool>>,
    /// Words from the checks.
    pub notes: Vec<String>,
    /// Why the recordings cannot tell anything, if so.
    pub thin: Option<Thin>,
}

impl<'a> Setup<'a> {
    /// Prepares recordings for many hypotheses: of what is long, the stretches in which most moves.
    ///
    /// # Errors
    /// As [`Setup::new`].
    pub fn of_stretches(
        series: &[Series],
        rig: &'a Rig,
        model: ModelName,
        criterion: Criterion,
    ) -> Result<Self, DataError> {
        let Some(rows) = excerpt::stretches(series, rig) else {
            return Self::new(series, rig, model, criterion);
        };
        for one in series {
            refuse::implausible(one, median_interval(&one.time_s))?;
        }
        let parts: Vec<Series> =
            series.iter().zip(&rows).map(|(one, rows)| excerpt::excerpt(one, rows)).collect();
        let mut setup = Self::prepare(&parts, rig, model, criterion)?;
        let whole = experiments(series, rig, model == ModelName::Model3);
        for (one, prepared) in whole.iter().zip(&mut setup.problem.recordings) {
            prepared.lay_means(&one.read);
        }
        let words = series.iter().zip(&rows).filter_map(|(one, rows)| excerpt::words(one, rows));
        setup.notes.splice(0..0, words.chain(series.iter().filter_map(checks::pauses)));
        Ok(setup)
    }

    /// Prepares recordings for a model.
    ///
    /// # Errors
    /// [`DataError`] if a recording cannot be compared with a model at all.
    pub fn new(
        series: &[Series],
        rig: &'a Rig,
        model: ModelName,
        criterion: Criterion,
    ) -> Result<Self, DataError> {
        let mut setup = Self::prepare(series, rig, model, criterion)?;
        setup.notes.extend(series.iter().filter_map(checks::pauses));
        Ok(setup)
    }

    fn prepare(
        series: &[Series],
        rig: &'a Rig,
        model: ModelName,
        criterion: Criterion,
    ) -> Result<Self, DataError> {
        let speed_driven = model == ModelName::Model3;
        let experiments = experiments(series, rig, speed_driven);
        let of_two = experiments::words(series, &experiments);
        let (series, repeated): (Vec<Series>, Vec<Option<String>>) =
            experiments.iter().map(|one| fresh(&one.read)).unzip();
        let prepared = |(read, one): (&Series, &Experiment)| {
            Ok(Prepared { second: one.second, ..Prepared::new(read, rig, speed_driven)? })
        };
        let recordings: Vec<Prepared> =
            series.iter().zip(&experiments).map(prepared).collect::<Result<_, DataError>>()?;
        let (mut notes, mut masked): (Vec<String>, Vec<_>) =
            (repeated.into_iter().flatten().chain(of_two).collect(), Vec::new());
        let mut flagged = Vec::new();
        for (one, prepared) in experiments.iter().zip(&recordings) {
            let checked = checks::check(one.recorded, rig);
            notes.extend(checked.notes);
            let mut rows = checked.masked.clone();
            flagged.push(checked.masked);
            if prepared.start[0] != 0.0 {
                // The state before the first row is not known: let it settle.
                let until = prepared.time_s[0] + (0.1 * prepared.duration_s()).min(2.0);
                prepared.time_s.iter().zip(&mut rows).for_each(|(t, m)| *m |= *t < until);
            }
            masked.push(rows);
        }
        let counted = |(one, prepared): (&Series, &Prepared)| {
            prepared.driving != Driving::Speed && counted_angle(one, rig).is_some()
        };
        if series.iter().zip(&recordings).any(counted) {
            notes.push(
                "the shaft angle is not recorded: what follows it is looked for at the angle counted from the recorded speed"
                    .into(),
            );
        }
        notes.extend(recordings.iter().flat_map(Prepared::held_samples));
        if nothing_stated(rig) {
            notes.push(format!(
                "the rig description states no tolerance: coefficients are taken as uncertain by {:.0} % (two sigma)",
                100.0 * UNSTATED_TOL
            ));
        }
        if settled(&recordings) {
            notes.push(
                "a table of settled points: nothing in it accelerates, so inertia, added mass, lags and delays do not show; in bollard pull every point has the same angle of attack. kort fit-table makes a rig from such a table and says what it cannot fix"
                    .into(),
            );
        }
        let mut thin = too_thin(&recordings, rig);
        let prescribed = recordings.iter().all(|p| p.driving == Driving::Speed);
        let stated = Parameters::stated(rig);
        let compared = |mut recordings: Vec<Prepared>| {
            recordings.iter_mut().for_each(|r| r.mark_smooth(model, rig, &stated));
            let inputs = Arc::new(Inputs::late(&recordings));
            let baseline = Hypothesis::baseline(model, rig, prescribed, inputs).with_sampling(&recordings);
            let problem = Problem::new(model, rig, recordings, masked.clone(), criterion);
            let baseline = baseline.with_known(rig, &problem.scale);
            (problem, baseline)
        };
        let (mut problem, mut baseline, words) = readings::likeliest(recordings, &series, rig, compared);
        notes.extend(words);
        if let Some(led) = problem.led(&baseline) {
            (problem, baseline) = compared(led.recordings);
            baseline.start = led.values;
            problem = problem.doubted_at(&baseline);
        }
        if let Some(rows) = problem.too_slow(&baseline) {
            let nothing = too_slow::tells_nothing(&problem.recordings, &rows);
            notes.extend(too_slow::words(&problem.recordings, &rows));
            if nothing.is_none() {
                problem = problem.without(&rows);
            }
            thin = thin.or(nothing);
        }
        if let Some(hidden) = problem.hidden_by_gaps(&baseline) {
            notes.extend(hidden.words(&problem.recordings));
            problem = problem.without(&hidden.rows);
        }
        notes.splice(0..0, turned(&mut problem, &baseline));
        thin = mistaken(&problem, &baseline).or(thin).or_else(|| nothing_left(&problem.masked));
        notes.extend(problem.recorded().filter_map(Prepared::hidden_between_rows));
        if let Some(name) = telling_column(&series, &problem, &baseline) {
            let sizes = spread(&series, &name);
            for (one, recording) in series.iter().zip(&mut problem.recordings) {
                recording.lay_extra(&name, one.column(&name).unwrap_or(&[]), sizes);
            }
        }
        // What two experiments of one recording have in common is said once.
        let mut said = BTreeSet::new();
        notes.retain(|note| said.insert(note.clone()));
        Ok(Self { series, problem, baseline, flagged, notes, thin })
    }
}

impl Setup<'_> {
    /// Effects that the rig is known to have of which the recordings want more or less than the rig's tolerance allows.
    pub fn pushed(&self) -> Vec<&'static str> {
        if self.baseline.effects.is_empty() {
            return Vec::new();
        }
        let fit = self.problem.settle_from_stated(&self.baseline, STEPS);
        let at_edge = |(free, value): (&Free, &f64)| match free.target {
            Target::Effect(slot, _) if free.at_bound(*value) => Some(fit.hypothesis.effects[slot].effect.id),
            _ => None,
        };
        // Of an effect several numbers may stand there.
        let effects: BTreeSet<&str> =
            fit.hypothesis.free.iter().zip(&fit.values).filter_map(at_edge).collect();
        effects.into_iter().collect()
    }
}

/// Of the columns that the model has no use for, the one that follows best what the stated rig leaves: the
/// driver that a term without a name may try.
fn telling_column(series: &[Series], problem: &Problem, baseline: &Hypothesis) -> Option<String> {
    let names = possible_drivers(series);
    if names.len() < 2 {
        return names.into_iter().next();
    }
    let residual = problem.residual(baseline, &baseline.start);
    let follows = |name: &String| {
        let (mean, deviation) = spread(series, name);
        let mut most = 0.0_f64;
        for (r, recording) in problem.recordings.iter().enumerate() {
            let Some(column) = series[r].column(name) else { continue };
            for (channel, left) in recording.channels.iter().zip(&residual[r]) {
                let pairs: Vec<(f64, f64)> = (channel.rows.iter().zip(left))
                    .map(|(row, e)| ((column[*row] - mean) / deviation, *e))
                    .filter(|(x, e)| x.is_finite() && e.is_finite())
                    .collect();
                let product: f64 = pairs.iter().map(|(x, e)| x * e).sum();
                let sizes = pairs.iter().map(|(x, _)| x * x).sum::<f64>()
                    * pairs.iter().map(|(_, e)| e * e).sum::<f64>();
                most = most.max(product.abs() / sizes.sqrt().max(1e-300));
            }
        }
        most
    };
    names.into_iter().max_by(|a, b| follows(a).total_cmp(&follows(b)))
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
