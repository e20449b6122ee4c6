//! Identification: the parameters of one model from recordings, and how far each can be trusted.
//!
//! Output-error fits from several seeded starts within the stated tolerances, under coloured
//! noise learnt from the residual; the initial state of a recording that does not begin at rest
//! is estimated with them. The report says which parameters the recordings cannot fix and which
//! run would, and takes an unphysical value for what it is: a symptom.

use std::collections::BTreeMap;

use kort_thruster::effects::Descriptor;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::rig::Rig;
use nalgebra::DMatrix;
use rand::{Rng, SeedableRng};
use serde::Serialize;

use crate::data::{DataError, Prepared, Series};
use crate::fit::Fit;
use crate::heldout::held_out_rows;
use crate::hypothesis::{Free, Hypothesis, Target};
use crate::identifiable::{NotIdentifiable, not_identifiable};
use crate::noise::Criterion;
use crate::scores::{self, ChannelReport, FittedEffect, ParameterReport, fitted_effects, parameters};
use crate::setup::Setup;
use crate::simulate::Problem;

/// How to identify.
#[derive(Clone)]
pub struct Options {
    /// Model whose parameters are wanted.
    pub model: ModelName,
    /// Seed of the further starts.
    pub seed: u64,
    /// Fits from different starts, the stated values being the first.
    pub starts: usize,
    /// Fit viscous friction almost without a prior and across zero, stated or not.
    pub open_friction: bool,
    /// Effects taken as present, fitted with the model.
    pub with: Vec<&'static Descriptor>,
    /// The criterion's constants.
    pub criterion: Criterion,
}

/// Two parameters that the recordings hardly part.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Correlation {
    /// Their names.
    pub parameters: [String; 2],
    /// Correlation of their errors, priors included.
    pub correlation: f64,
}

/// What the further starts said.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Starts {
    /// Fits tried.
    pub tried: usize,
    /// Fits that ended in the same place: every parameter within one standard error.
    pub agreed: usize,
    /// How much worse the worst start ended, in twice the log-likelihood.
    pub worst_gap: f64,
}

/// State at the first row of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct InitialState {
    /// The recording.
    pub recording: String,
    /// Shaft speed, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Fitted, rather than known because the recording begins at rest.
    pub estimated: bool,
}

/// The report of `kort fit`, schema `kort.fit/1`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FitReport {
    /// `kort.fit/1`
    pub schema: String,
    /// Version of kort.
    pub kort_version: String,
    /// Recordings by name.
    pub recordings: Vec<String>,
    /// Rig by name.
    pub rig: String,
    /// Model.
    pub model: String,
    /// Seed of the starts.
    pub seed: u64,
    /// Length of the recordings together, s.
    pub seconds: f64,
    /// Fitted values; `std_error` includes the stated tolerance as prior.
    pub parameters: Vec<ParameterReport>,
    /// Effects asked for.
    pub effects: Vec<FittedEffect>,
    /// Errors by channel, the held-out ones from a fit without those rows.
    pub channels: BTreeMap<String, ChannelReport>,
    /// Groups that these recordings cannot fix.
    pub not_identifiable: Vec<NotIdentifiable>,
    /// Pairs whose errors correlate by more than 0.9.
    pub correlations: Vec<Correlation>,
    /// Values that no thruster has, and what that tells.
    pub symptoms: Vec<String>,
    /// Do several starts agree?
    pub starts: Starts,
    /// State at the first row.
    pub initial_states: Vec<InitialState>,
    /// Checks of the data.
    pub notes: Vec<String>,
}

/// Correlations beyond this are reported.
const CORRELATED: f64 = 0.9;

/// Identifies a model's parameters from recordings of one rig together.
///
/// # Errors
/// [`DataError`] if a recording cannot be compared with a model at all.
pub fn identify(
    series: &[Series],
    rig: &Rig,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> Result<FitReport, DataError> {
    let Setup { mut problem, mut baseline, flagged, mut notes, thin, .. } =
        Setup::new(series, rig, options.model, options.criterion)?;
    notes.extend(thin.map(|thin| thin.why));
    let typical = problem.scale.torque_n_m / problem.scale.shaft_speed_rad_s;
    open_friction(&mut baseline, rig, options.open_friction, typical);
    baseline = baseline.with_present(&options.with, &problem.scale);
    // Estimated initial states take the place of a run-in that is left out.
    let moving: Vec<bool> = problem.recordings.iter().map(|r| r.start[0] != 0.0).collect();
    if moving.contains(&true) {
        let mut masked = problem.masked.clone();
        for ((rows, flagged), _) in masked.iter_mut().zip(flagged).zip(&moving).filter(|(_, m)| **m) {
            *rows = flagged;
        }
        problem = Problem::new(problem.model, rig, problem.recordings, masked, problem.criterion);
    }
    progress("fitting from the stated values");
    let mut best = problem.settle_from_stated(&baseline, ITERATIONS);
    if best.broke_down() {
        return Err(DataError::BrokeDown {
            recording: series.first().map_or_else(String::new, |s| s.name.clone()),
        });
    }
    if moving.contains(&true) {
        for _ in 0..2 {
            place_starts(&mut problem, &best, &moving);
            best = problem.settle(&best.resume(), &Vec::new(), &best.floor, ITERATIONS);
        }
    }
    let problem = &problem;
    let (starts, best) = several_starts(problem, best, options, progress);

    progress("scoring on held-out data");
    let std = problem.standard_errors(&best);
    let full = problem.residual(&best.hypothesis, &best.values);
    let floor = scores::noise_floor(problem, &full);
    let held = held_out_rows(problem, &[&best.hypothesis]);
    let trained = problem.without(&held).again(&best, 6);
    let train_residual = problem.residual(&trained.hypothesis, &trained.values);
    let effects = fitted_effects(&best, &std);
    Ok(FitReport {
        schema: "kort.fit/1".into(),
        kort_version: env!("CARGO_PKG_VERSION").into(),
        recordings: series.iter().map(|s| s.name.clone()).collect(),
        rig: rig.name.clone(),
        model: options.model.name().into(),
        seed: options.seed,
        seconds: problem.recorded().map(Prepared::duration_s).sum(),
        channels: scores::channels(problem, &held, &train_residual, &full, &floor),
        not_identifiable: not_identifiable(problem, &best),
        correlations: correlations(&best, &problem.covariance(&best)),
        symptoms: symptoms(&best, &std),
        starts,
        initial_states: problem
            .recordings
            .iter()
            .zip(&moving)
            .filter(|(r, _)| !r.second)
            .map(|(r, moving)| InitialState {
                recording: r.name.clone(),
                shaft_speed_rad_s: r.start[0],
                flow_m_s: r.start[1],
                estimated: *moving,
            })
            .collect(),
        parameters: parameters(&best, &std, None),
        effects,
        notes,
    })
}

/// Iterations of a fit.
const ITERATIONS: usize = 20;

/// Lets viscous friction cross zero where it is fitted: a negative value is the sign of physics
/// left out, which a bound at zero would hide. `wanted` fits it even if nothing is stated.
fn open_friction(hypothesis: &mut Hypothesis, rig: &Rig, wanted: bool, typical: f64) {
    let target = Target::Base(Parameter::ViscousFrictionNmS);
    let reach = typical.max(1e-9);
    if let Some(free) = hypothesis.free.iter_mut().find(|f| f.target == target) {
        free.low = free.low.min(-free.high);
        if wanted {
            *free = Free { stated: false, sigma: reach, low: -reach, high: reach, ..*free };
        }
    } else if wanted && hypothesis.free.iter().any(|f| f.target == Target::Base(Parameter::InertiaKgM2)) {
        let p = Parameter::ViscousFrictionNmS;
        let stated = Parameters::quantity(rig, p).map_or(0.0, |q| q.value);
        hypothesis.free.push(Free {
            target,
            name: p.name(),
            unit: p.unit(),
            stated: false,
            mean: stated,
            sigma: reach,
            low: -reach,
            high: reach,
            acts: None,
        });
        hypothesis.start.push(stated);
    }
}

/// Fits from further starts drawn within the tolerances; the best of all, and how they agree.
fn several_starts(
    problem: &Problem,
    first: Fit,
    options: &Options,
    progress: &(dyn Fn(&str) + Sync),
) -> (Starts, Fit) {
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(options.seed);
    let mut fits = vec![first];
    for k in 1..options.starts.max(1) {
        progress(&format!("fitting from start {} of {}", k + 1, options.starts));
        let mut from = fits[0].hypothesis.clone();
        for (free, value) in from.free.iter().zip(&mut from.start) {
            if matches!(free.target, Target::Base(_)) {
                let offset: f64 = rng.random_range(-2.0..2.0);
                *value = (free.mean + offset * free.sigma).clamp(free.low, free.high);
            }
        }
        let fit = problem.fit(&from, &Vec::new(), &fits[0].floor, ITERATIONS);
        fits.push(problem.finish(fit));
    }
    let (place, _) = fits.iter().enumerate().fold((0, fits[0].cost()), |at, (k, f)| {
        // The first start stands unless another is better by more than the fit's own tolerance.
        if f.cost() < at.1 - 1.0 { (k, f.cost()) } else { at }
    });
    let best = fits[place].clone();
    let std = problem.standard_errors(&best);
    let near = |f: &Fit| {
        f.values.iter().zip(&best.values).zip(&std).all(|((a, b), s)| (a - b).abs() <= s.max(1e-9 * b.abs()))
    };
    let starts = Starts {
        tried: fits.len(),
        agreed: fits.iter().filter(|f| near(f)).count(),
        worst_gap: fits.iter().map(|f| f.cost() - best.cost()).fold(0.0, f64::max),
    };
    (starts, best)
}

/// Gauss-Newton on shaft speed and flow at the first row of every recording that begins moving.
fn place_starts(problem: &mut Problem, fit: &Fit, moving: &[bool]) {
    let weights: Vec<f64> = problem
        .spectrum
        .bands
        .iter()
        .zip(&fit.noise.weight)
        .flat_map(|(band, w)| std::iter::repeat_n(w.sqrt(), band.lines.len()))
        .collect();
    let weights = nalgebra::DVector::from_vec(weights);
    let residual = |p: &Problem| p.residual_lines(&fit.hypothesis, &fit.values).component_mul(&weights);
    for _ in 0..2 {
        for r in (0..moving.len()).filter(|r| moving[*r]) {
            let at = residual(problem);
            let before = problem.recordings[r].start;
            let slopes: Vec<_> = [0, 1]
                .map(|k| {
                    let step = 1e-3 * before[k].abs().max(0.1);
                    problem.recordings[r].start[k] = before[k] + step;
                    let moved = residual(problem);
                    problem.recordings[r].start = before;
                    (moved - &at) / step
                })
                .into();
            // A state that the data do not show stays where it is.
            let normal = nalgebra::Matrix2::from_fn(|i, j| slopes[i].dot(&slopes[j]))
                + nalgebra::Matrix2::from_diagonal_element(1e-3);
            let gradient = nalgebra::Vector2::from_fn(|i, _| -slopes[i].dot(&at));
            let Some(step) = normal.cholesky().map(|c| c.solve(&gradient)) else { continue };
            let reach = 0.5 * before[0].abs().max(1.0);
            problem.recordings[r].start[0] += step[0].clamp(-reach, reach);
            problem.recordings[r].start[1] += step[1].clamp(-2.0, 2.0);
            if residual(problem).norm_squared() > at.norm_squared() {
                problem.recordings[r].start = before;
            }
        }
    }
}

fn correlations(fit: &Fit, covariance: &DMatrix<f64>) -> Vec<Correlation> {
    let free = &fit.hypothesis.free;
    let mut out = Vec::new();
    for i in 0..free.len() {
        for j in 0..i {
            let scale = (covariance[(i, i)] * covariance[(j, j)]).sqrt();
            let rho = covariance[(i, j)] / scale;
            if scale > 0.0 && rho.abs() > CORRELATED {
                out.push(Correlation {
                    parameters: [free[j].name.into(), free[i].name.into()],
                    correlation: rho,
                });
            }
        }
    }
    out.sort_by(|a, b| b.correlation.abs().total_cmp(&a.correlation.abs()));
    out
}

/// Values that say more about the model than about the thruster.
fn symptoms(fit: &Fit, std: &[f64]) -> Vec<String> {
    let mut out = Vec::new();
    let at_bound = fit.at_bound();
    for (k, free) in fit.hypothesis.free.iter().enumerate() {
        let value = fit.values[k];
        if free.target == Target::Base(Parameter::ViscousFrictionNmS) && value < -2.0 * std[k] {
            out.push(format!(
                "{} = {value:.4e} {} is negative, which no friction is: the model leaves out something that takes torque away from the blades as speed grows (rotational flow does); run `kort diagnose`",
                free.name, free.unit
            ));
            continue;
        }
        if at_bound[k] {
            out.push(format!(
                "{} = {value:.5} {} stands at the edge of what is allowed ({:.5} to {:.5}): a symptom of physics left out or of a wrong stated value, not a measurement; run `kort diagnose`",
                free.name, free.unit, free.low, free.high
            ));
        } else if free.stated && free.score(value).abs() > 3.0 {
            out.push(format!(
                "{} = {value:.5} {} is {:.1} sigma from the stated {:.5}: check the statement, or run `kort diagnose`",
                free.name,
                free.unit,
                free.score(value).abs(),
                free.mean
            ));
        }
    }
    out
}
