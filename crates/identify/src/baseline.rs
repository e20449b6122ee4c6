//! Which parameters of a model a recording may move, and how far: the stated tolerances.

use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::rig::{Quantity, Rig};

use crate::fit::{Columns, Free, Hypothesis, Target};

/// Relative uncertainty (two sigma) of a coefficient in a rig that states no tolerance at all.
pub const UNSTATED_TOL: f64 = 0.5;

/// A coefficient may move by this many stated tolerances (two sigma each). Beyond them it would not be
/// the coefficient that was stated: what is left then shows as a mismatch instead of hiding in it.
const REACH: f64 = 1.5;

/// Parameters that shape a model's response.
fn used(model: ModelName, dry: bool, shaft_prescribed: bool) -> Vec<P> {
    let shaft = [
        P::InertiaKgM2,
        P::TorqueConstantNmA,
        P::ViscousFrictionNmS,
        P::WindingResistanceOhm,
        P::TimeConstantS,
    ];
    let water = [
        P::PitchRad,
        P::LiftMax,
        P::DragMax,
        P::FluxCoefficient,
        P::AddedMassCoefficient,
        P::DensityKgM3,
        P::RadiusM,
        P::DuctLengthM,
    ];
    let mut list: Vec<P> = match model {
        _ if dry => Vec::new(),
        ModelName::Model0 => vec![P::ThrustCoefficientNS2, P::TorqueCoefficientNmS2],
        ModelName::Model1 => vec![
            P::Efficiency,
            P::AddedMassCoefficient,
            P::PitchRad,
            P::RadiusM,
            P::DuctLengthM,
            P::DensityKgM3,
        ],
        ModelName::Model2 | ModelName::Model3 => water.to_vec(),
        ModelName::RotationalFlow => {
            water.into_iter().chain([P::SwirlFluxCoefficient, P::SwirlMassCoefficient]).collect()
        }
    };
    if !shaft_prescribed {
        list.extend(shaft);
    }
    list
}

/// What a rig states of a parameter for this model; coefficients that no rig description holds
/// (Model 0, Model 1, swirl) are as uncertain as a rig without tolerances.
fn stated(rig: &Rig, parameter: P, values: &Parameters) -> Option<Quantity> {
    let loose = |tol| Some(Quantity { value: values.get(parameter), tol: Some(tol) });
    match parameter {
        P::ThrustCoefficientNS2 | P::TorqueCoefficientNmS2 | P::Efficiency => loose(0.5),
        // The larger the flux, the less the wake turns: up to hardly at all.
        P::SwirlFluxCoefficient => loose(200.0),
        P::SwirlMassCoefficient => loose(1.5),
        _ => Parameters::quantity(rig, parameter),
    }
}

/// True when the rig gives no tolerance for any parameter: then coefficients are taken as
/// uncertain by [`UNSTATED_TOL`], and the report says so.
pub fn nothing_stated(rig: &Rig) -> bool {
    P::ALL.iter().all(|p| Parameters::quantity(rig, *p).is_none_or(|q| q.tol.is_none()))
}

/// The baseline with its free parameters.
pub fn hypothesis(model: ModelName, rig: &Rig, shaft_prescribed: bool, needs_current: bool) -> Hypothesis {
    let values = Parameters::stated(rig);
    let unstated = nothing_stated(rig);
    let coefficient = |p: P| {
        matches!(
            p,
            P::LiftMax
                | P::DragMax
                | P::FluxCoefficient
                | P::AddedMassCoefficient
                | P::InertiaKgM2
                | P::TorqueConstantNmA
        )
    };
    let mut free = Vec::new();
    let mut start = Vec::new();
    for parameter in used(model, rig.propeller.is_none(), shaft_prescribed) {
        let Some(mut quantity) = stated(rig, parameter, &values) else { continue };
        if unstated && coefficient(parameter) && quantity.tol.is_none() {
            quantity.tol = Some(UNSTATED_TOL);
        }
        let Some(tol) = quantity.tol else { continue };
        if quantity.value == 0.0 || (parameter == P::TimeConstantS && !needs_current) {
            continue;
        }
        let reach = REACH * tol * quantity.value.abs();
        let low = quantity.value - reach;
        free.push(Free {
            target: Target::Base(parameter),
            name: parameter.name(),
            unit: parameter.unit(),
            prior: Some((quantity.value, quantity.sigma())),
            low: if parameter.positive() { low.max(0.02 * quantity.value) } else { low },
            high: quantity.value + reach,
            size: quantity.value.abs(),
            acts: None,
        });
        start.push(quantity.value);
    }
    Hypothesis { effects: Vec::new(), free, start, fixed: Vec::new() }
}

/// Starts of a baseline's fit: as stated and, for a model with swirl, with hardly any, so that water
/// that does not turn is found as well.
pub fn starts(hypothesis: &Hypothesis) -> Vec<Hypothesis> {
    let swirl = hypothesis.free.iter().position(|f| f.target == Target::Base(P::SwirlFluxCoefficient));
    let still = swirl.map(|k| {
        let mut other = hypothesis.clone();
        other.start[k] = 0.5 * other.free[k].high;
        other
    });
    std::iter::once(hypothesis.clone()).chain(still).collect()
}

/// A hypothesis with one more effect, starting from fitted values of the smaller one and the
/// given (or default) values of the effect.
pub fn with_effect(
    smaller: &Hypothesis,
    values: &[f64],
    effect: &'static Descriptor,
    scale: &Scale,
    start: Option<&[f64]>,
) -> Hypothesis {
    let mut larger = smaller.clone();
    larger.start = values.to_vec();
    let slot = larger.effects.len();
    larger.effects.push(effect);
    for (j, spec) in (effect.parameters)(scale).into_iter().enumerate() {
        let at = start.map_or(spec.start, |s| s[j]).clamp(spec.low, spec.high);
        if spec.held || spec.low == spec.high {
            larger.fixed.push((slot, j, at));
            continue;
        }
        larger.free.push(Free {
            target: Target::Effect(slot, j),
            name: spec.name,
            unit: spec.unit,
            // A shape is known to a factor of a few before the data speak; a knot where nothing
            // happens is not known after it, and stays near nothing.
            prior: match spec.acts {
                Some(_) => Some((0.0, 0.3 * spec.high)),
                None => spec.shape.then_some((at, shape_sigma(at, spec.low, spec.high))),
            },
            low: spec.low,
            high: spec.high,
            size: spec.start.abs().max(1e-6 * (spec.high - spec.low)),
            acts: spec.acts,
        });
        larger.start.push(at);
    }
    larger
}

fn shape_sigma(at: f64, low: f64, high: f64) -> f64 {
    (0.7 * at.abs()).max(0.02 * (high - low)).min(0.5 * (high - low))
}

/// An effect with values at which it enters a hypothesis.
pub type Member = (&'static Descriptor, Vec<f64>);

/// The members of a fitted hypothesis, with their values.
pub fn members(problem: &crate::fit::Problem, fit: &crate::fit::Fit) -> Vec<Member> {
    let (_, effects) = problem.assemble(&fit.hypothesis, &fit.values);
    fit.hypothesis.effects.iter().copied().zip(effects).collect()
}

/// The same baseline, at a fit's values, with other members; derivative columns that carry over
/// come with it.
pub fn recompose(fit: &crate::fit::Fit, members: &[Member], scale: &Scale) -> (Hypothesis, Columns) {
    let base: Vec<usize> =
        (0..fit.values.len()).filter(|k| matches!(fit.hypothesis.free[*k].target, Target::Base(_))).collect();
    let values: Vec<f64> = base.iter().map(|k| fit.values[*k]).collect();
    let mut hypothesis = Hypothesis {
        effects: Vec::new(),
        free: base.iter().map(|k| fit.hypothesis.free[*k].clone()).collect(),
        start: values,
        fixed: Vec::new(),
    };
    for (effect, at) in members {
        let values = hypothesis.start.clone();
        hypothesis = with_effect(&hypothesis, &values, effect, scale, Some(at));
    }
    let key = |h: &Hypothesis, target: Target| match target {
        Target::Base(p) => (p.name(), usize::MAX),
        Target::Effect(i, j) => (h.effects[i].id, j),
    };
    let columns = hypothesis
        .free
        .iter()
        .map(|free| {
            let wanted = key(&hypothesis, free.target);
            let at = fit.hypothesis.free.iter().position(|f| key(&fit.hypothesis, f.target) == wanted)?;
            fit.columns[at].clone()
        })
        .collect();
    (hypothesis, columns)
}
