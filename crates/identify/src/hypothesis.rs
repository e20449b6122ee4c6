//! A hypothesis: a baseline model, effects added to it, and what is free in them.
//!
//! Every free number has a proper prior: the rig's stated value and tolerance for the baseline, the
//! catalogue's typical size for an effect. A coefficient may move by so many of its tolerances and no
//! further: beyond them it would not be the coefficient that was stated.

use std::sync::Arc;

use kort_thruster::effects::{Descriptor, Scale, Spec};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::rig::{KnownEffect, Quantity, Rig};
use nalgebra::DMatrix;

use crate::data::Prepared;

pub use crate::free::{Free, Target};

/// Relative uncertainty (two sigma) of a coefficient in a rig that states no tolerance at all.
pub const UNSTATED_TOL: f64 = 0.5;
/// The coefficients that are, then.
const COEFFICIENTS: [P; 6] = [
    P::LiftMax,
    P::DragMax,
    P::FluxCoefficient,
    P::AddedMassCoefficient,
    P::InertiaKgM2,
    P::TorqueConstantNmA,
];
/// Standard deviation over value of what is stated roughly: a straight line from it leads astray.
const ROUGH: f64 = 0.2;
/// Rough numbers from which a fit is begun afar: a budget.
const FELT: usize = 3;
/// Least share of what is stated that a number can be which cannot be zero.
const LEAST_SHARE: f64 = 0.02;
/// How far a coefficient may move, in stated tolerances (two sigma each).
const REACH: f64 = 1.5;

/// An effect as it stands in a hypothesis.
#[derive(Clone)]
pub struct Member {
    /// The effect.
    pub effect: &'static Descriptor,
    /// Its values.
    pub values: Vec<f64>,
    /// Places of values that are not fitted.
    pub held: Vec<usize>,
    /// Prior standard deviations over the catalogue's, for what changes freely with time.
    pub liveliness: f64,
    /// What the rig states of its values, where it is known to be there; else empty.
    pub stated: Vec<Quantity>,
}

impl Member {
    /// An effect at its catalogue's start, all of it free.
    pub fn new(effect: &'static Descriptor, scale: &Scale) -> Self {
        let specs = (effect.parameters)(scale);
        Self {
            effect,
            held: (0..specs.len()).filter(|j| specs[*j].held || specs[*j].low == specs[*j].high).collect(),
            values: specs.iter().map(|s| s.start).collect(),
            liveliness: 1.0,
            stated: Vec::new(),
        }
    }

    /// An effect that the rig is known to have, free within what is stated of it; none where all of it is stated as exact.
    pub fn known(known: &KnownEffect) -> Option<Self> {
        let stated: Vec<Quantity> = known.parameters.iter().map(|(_, quantity)| *quantity).collect();
        let held: Vec<usize> = (0..stated.len()).filter(|j| stated[*j].sigma() == 0.0).collect();
        let effect = known.descriptor().filter(|_| held.len() < stated.len())?;
        Some(Self { effect, values: known.values().collect(), held, liveliness: 1.0, stated })
    }

    /// One of its values as a free number of a hypothesis in which it has this place.
    fn free(&self, slot: usize, value: usize, spec: &Spec) -> Free {
        let catalogue = Free {
            target: Target::Effect(slot, value),
            name: spec.name,
            unit: spec.unit,
            stated: false,
            mean: spec.mean,
            sigma: if spec.acts.is_some() { spec.sigma * self.liveliness } else { spec.sigma },
            low: spec.low,
            high: spec.high,
            acts: spec.acts,
        };
        let Some(quantity) = self.stated.get(value) else { return catalogue };
        // How large it may be the rig says; which sign it has, the equation.
        let least = if spec.low >= 0.0 { LEAST_SHARE * quantity.value } else { f64::NEG_INFINITY };
        let (low, high) = reach(quantity, least);
        Free { stated: true, mean: quantity.value, sigma: quantity.sigma(), low, high, ..catalogue }
    }

    /// The same from other values.
    pub fn at(self, values: Vec<f64>) -> Self {
        Self { values, ..self }
    }

    /// Where a fit of it may begin: here, and at the catalogue's other starts.
    pub fn starts(&self, scale: &Scale) -> Vec<Vec<f64>> {
        std::iter::once(self.values.clone()).chain((self.effect.starts)(scale)).collect()
    }

    /// Whether it has a size, or is there or not: other equations in the place of the model's, as exact as they are,
    /// and no addition that is known to a share of itself.
    pub fn has_size(&self, scale: &Scale) -> bool {
        (self.effect.parameters)(scale).iter().any(|spec| !spec.shape && !spec.held)
    }
}

/// Where inside its log interval each step of the command happened: control ticks, and parts of one, before the row
/// that first shows it, by recording and edge.
pub type Edges = Vec<Vec<f64>>;

/// The command on the control grid, with its steps where `edges` says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Inputs {
    /// Where the steps lie.
    pub edges: Edges,
    /// Command by recording and control tick.
    pub commands: Vec<Vec<f64>>,
}

impl Inputs {
    /// Lays the recorded commands out.
    pub fn new(recordings: &[Prepared], edges: Edges) -> Self {
        let commands = recordings.iter().zip(&edges).map(|(r, e)| r.commands(e)).collect();
        Self { edges, commands }
    }

    /// Every step at the row that first shows it.
    pub fn late(recordings: &[Prepared]) -> Self {
        Self::new(recordings, recordings.iter().map(|r| vec![0.0; r.edges.len()]).collect())
    }
}

/// A baseline model with effects added to it.
#[derive(Clone)]
pub struct Hypothesis {
    /// Effects in order; values here are where they entered.
    pub effects: Vec<Member>,
    /// Free numbers: baseline first, then the effects' in order.
    pub free: Vec<Free>,
    /// Values where a fit starts.
    pub start: Vec<f64>,
    /// The command as it reached the drive.
    pub inputs: Arc<Inputs>,
}

/// Parameters that shape a model's response; what hangs on a shaft does so unless its speed is prescribed.
fn used(model: ModelName, dry: bool, shaft_prescribed: bool) -> Vec<P> {
    let shaft = [
        P::InertiaKgM2,
        P::TorqueConstantNmA,
        P::ViscousFrictionNmS,
        P::WindingResistanceOhm,
        P::TimeConstantS,
        P::CurrentLimitA,
        P::SpeedFilterTimeConstantS,
        P::LoadMassKg,
        P::LoadLengthM,
        P::LoadInertiaKgM2,
        P::LoadStiffnessNmRad,
        P::LoadDampingNmS,
        P::FanCoefficientNmS2,
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

/// From where to where a stated number may move, and no further than to the `least` that it can be.
fn reach(stated: &Quantity, least: f64) -> (f64, f64) {
    let reach = 2.0 * REACH * stated.sigma();
    ((stated.value - reach).max(least), stated.value + reach)
}

/// True when the rig gives no tolerance for any parameter: then coefficients are taken as
/// uncertain by [`UNSTATED_TOL`], and the report says so.
pub fn nothing_stated(rig: &Rig) -> bool {
    P::ALL.iter().all(|p| Parameters::quantity(rig, *p).is_none_or(|q| q.tol.is_none()))
}

impl Hypothesis {
    /// The baseline alone.
    pub fn baseline(model: ModelName, rig: &Rig, shaft_prescribed: bool, inputs: Arc<Inputs>) -> Self {
        let values = Parameters::stated(rig);
        let unstated = nothing_stated(rig);
        let (mut free, mut start) = (Vec::new(), Vec::new());
        for parameter in used(model, rig.propeller.is_none(), shaft_prescribed) {
            let Some(mut quantity) = stated(rig, parameter, &values) else { continue };
            if unstated && COEFFICIENTS.contains(&parameter) && quantity.tol.is_none() {
                quantity.tol = Some(UNSTATED_TOL);
            }
            if quantity.sigma() == 0.0 || !quantity.value.is_finite() {
                continue;
            }
            // No friction gives energy away.
            let least = if parameter.positive() { LEAST_SHARE * quantity.value } else { 0.0 };
            let (low, high) = reach(&quantity, least);
            free.push(Free {
                target: Target::Base(parameter),
                name: parameter.name(),
                unit: parameter.unit(),
                stated: true,
                mean: quantity.value,
                sigma: quantity.sigma(),
                low,
                high,
                acts: None,
            });
            start.push(quantity.value);
        }
        Self { effects: Vec::new(), free, start, inputs }
    }

    /// The same, which starts where a fit ended, begun where what is stated roughly is stated, and a standard deviation off:
    /// one number after the other of those that the data tell most of, by their `information`. Nothing where the fit bent
    /// none of the rough ones by more than that.
    pub fn begun_afar(&self, information: &DMatrix<f64>) -> Vec<Self> {
        let rough =
            |free: &Free| matches!(free.target, Target::Base(_)) && free.sigma > ROUGH * free.mean.abs();
        let mut places: Vec<usize> = (0..self.free.len()).filter(|k| rough(&self.free[*k])).collect();
        let bent = |k: &usize| (self.start[*k] - self.free[*k].mean).abs() > self.free[*k].sigma;
        if !places.iter().any(bent) {
            return Vec::new();
        }
        places.sort_by(|a, b| information[(*b, *b)].total_cmp(&information[(*a, *a)]));
        let mut stated = self.clone();
        places.iter().for_each(|k| stated.start[*k] = self.free[*k].mean);
        let off = |k: usize, by: f64| {
            let (free, mut one) = (&self.free[k], stated.clone());
            one.start[k] = (free.mean + by * free.sigma).clamp(free.low, free.high);
            one
        };
        let off_by_one = places.iter().take(FELT).flat_map(|k| [off(*k, -1.0), off(*k, 1.0)]);
        std::iter::once(stated.clone()).chain(off_by_one).collect()
    }

    /// With the effects that the rig is known to have, free within what is stated of each.
    pub fn with_known(self, rig: &Rig, scale: &Scale) -> Self {
        let more = |hypothesis: Self, member| hypothesis.with(&hypothesis.start, member, scale);
        rig.effects.iter().filter_map(Member::known).fold(self, more)
    }

    /// With effects taken as present, all free; those that the rig is known to have are there already.
    pub fn with_present(&self, effects: &[&'static Descriptor], scale: &Scale) -> Self {
        let more = effects.iter().filter(|e| !self.has(e.id)).map(|effect| Member::new(effect, scale));
        more.fold(self.clone(), |hypothesis, member| hypothesis.with(&hypothesis.start, member, scale))
    }

    /// Whether an effect is a member.
    pub fn has(&self, effect: &str) -> bool {
        self.effects.iter().any(|m| m.effect.id == effect)
    }

    /// With the instants free at which these recordings' channels were sampled.
    pub fn with_sampling(mut self, recordings: &[Prepared]) -> Self {
        for free in crate::sampling::free(recordings) {
            self.start.push(free.mean);
            self.free.push(free);
        }
        self
    }

    /// The same with one more effect, from these values of what is free so far.
    pub fn with(&self, values: &[f64], member: Member, scale: &Scale) -> Self {
        let mut larger = self.clone();
        larger.start = values.to_vec();
        let slot = larger.effects.len();
        for (j, spec) in (member.effect.parameters)(scale).iter().enumerate() {
            if !member.held.contains(&j) {
                let free = member.free(slot, j, spec);
                larger.start.push(member.values[j].clamp(free.low, free.high));
                larger.free.push(free);
            }
        }
        larger.effects.push(member);
        larger
    }

    /// Parameters and values of effects from the vector of free numbers.
    pub fn assemble<T: kort_thruster::real::Real>(
        &self,
        stated: &Parameters,
        values: &[T],
    ) -> (Parameters<T>, Vec<Vec<T>>) {
        let mut parameters = Parameters::lift(stated);
        let mut effects: Vec<Vec<T>> =
            self.effects.iter().map(|m| m.values.iter().map(|v| T::from(*v)).collect()).collect();
        for (free, value) in self.free.iter().zip(values) {
            match free.target {
                Target::Base(p) => parameters.set(p, *value),
                Target::Effect(i, j) => effects[i][j] = *value,
                // Not the plant's business.
                Target::Sampling { .. } | Target::Averaging { .. } => (),
            }
        }
        (parameters, effects)
    }

    /// Squared distance of values from the priors' means, in standard deviations.
    pub fn penalty(&self, values: &[f64]) -> f64 {
        self.free.iter().zip(values).map(|(f, v)| f.score(*v).powi(2)).sum()
    }
}
