//! Estimators: the model's coefficients while the thruster runs.
//!
//! Lift, drag and flux coefficient are linear in the equations of thrust, torque and momentum
//! (docs/control.md D9); the last is learnt where force sensor and flow meter both measure.
//! [`regression`] builds filtered, normalised equations and says when they carry information; an
//! estimator turns them into a correction; the corrected model feeds the law.

mod gradient;
mod regression;
mod rls;

use serde::{Deserialize, Serialize};

use crate::model::ControlModel;
use crate::signals::{Estimate, Measurement};

pub use regression::{Equation, Freeze, Regression};

/// Number of coefficients.
pub const COEFFICIENTS: usize = 3;

/// Names of the coefficients, in the order of the estimator; dimensionless.
pub const NAMES: [&str; COEFFICIENTS] = ["lift_max", "drag_max", "flux_coefficient"];

/// Which estimator.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EstimatorKind {
    /// The model stays as the rig states it.
    #[default]
    Off,
    /// Normalised gradient.
    Gradient,
    /// Recursive least squares with forgetting.
    Rls,
}

impl EstimatorKind {
    /// Every estimator.
    pub const ALL: [Self; 3] = [Self::Off, Self::Gradient, Self::Rls];

    /// Stable name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Off => "off",
            Self::Gradient => "gradient",
            Self::Rls => "rls",
        }
    }

    /// The estimator of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|k| k.name() == name)
    }
}

/// Options of adaptation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdaptationOptions {
    /// Gain of the gradient, 1/s.
    pub gain_per_s: f64,
    /// Memory of the least squares, s.
    pub memory_s: f64,
    /// Residual, as a share of full thrust or torque, that is taken for noise.
    pub dead_zone: f64,
    /// Box: a coefficient stays within this factor of the stated one, up and down.
    pub box_factor: f64,
    /// Least eigenvalue of the normalised windowed Gram matrix below which adaptation freezes.
    pub excitation_min: f64,
}

impl Default for AdaptationOptions {
    fn default() -> Self {
        Self { gain_per_s: 2.0, memory_s: 10.0, dead_zone: 0.004, box_factor: 2.5, excitation_min: 1e-3 }
    }
}

/// What an estimator sees at one tick.
#[derive(Clone, Copy, Debug)]
pub struct EstimatorInput<'a> {
    /// The thruster as the rig states it.
    pub nominal: &'a ControlModel,
    /// Measurements, already sane.
    pub measured: &'a Measurement,
    /// The observer's estimate.
    pub estimate: &'a Estimate,
    /// Motor current over the last period, A.
    pub current_a: f64,
    /// A limit was in force or a measurement was gated: do not learn from this tick.
    pub suspect: bool,
    /// Time since the last tick, s.
    pub dt_s: f64,
}

/// Coefficients as multiples of the stated ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Adapted {
    /// Multiples, in the order of [`NAMES`].
    pub ratio: [f64; COEFFICIENTS],
    /// Standard errors of the multiples; infinite where the estimator has none.
    pub std_error: [f64; COEFFICIENTS],
    /// Why nothing is learnt now.
    pub frozen: Option<Freeze>,
}

impl Default for Adapted {
    fn default() -> Self {
        Self { ratio: [1.0; COEFFICIENTS], std_error: [f64::INFINITY; COEFFICIENTS], frozen: None }
    }
}

impl Adapted {
    /// Puts the coefficients into a model that was copied from the nominal one.
    pub fn apply(&self, nominal: &ControlModel, model: &mut ControlModel) {
        model.blade.lift_max = nominal.blade.lift_max * self.ratio[0];
        model.blade.drag_max = nominal.blade.drag_max * self.ratio[1];
        model.flux_coefficient = nominal.flux_coefficient * self.ratio[2];
        model.refresh();
    }

    /// A coefficient's value and standard error in its own unit.
    pub fn coefficient(&self, index: usize, nominal: &ControlModel) -> (f64, f64) {
        let stated = [nominal.blade.lift_max, nominal.blade.drag_max, nominal.flux_coefficient][index];
        (stated * self.ratio[index], stated * self.std_error[index])
    }

    /// Held inside the box around the stated values.
    fn project(&mut self, factor: f64) {
        let factor = factor.max(1.0);
        for r in &mut self.ratio {
            *r = if r.is_finite() { r.clamp(1.0 / factor, factor) } else { 1.0 };
        }
    }
}

/// A running estimator.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::large_enum_variant)]
pub enum Estimator {
    /// Nothing adapts.
    Off,
    /// See [`EstimatorKind::Gradient`].
    Gradient(gradient::Gradient),
    /// See [`EstimatorKind::Rls`].
    Rls(rls::Rls),
}

impl Estimator {
    /// An estimator at the stated values.
    pub fn new(kind: EstimatorKind, model: &ControlModel, options: &AdaptationOptions) -> Self {
        match kind {
            EstimatorKind::Off => Self::Off,
            EstimatorKind::Gradient => Self::Gradient(gradient::Gradient::new(model, options)),
            EstimatorKind::Rls => Self::Rls(rls::Rls::new(model, options)),
        }
    }

    /// One step; `Some` when the coefficients have moved.
    pub fn tick(&mut self, input: &EstimatorInput) -> Option<Adapted> {
        match self {
            Self::Off => None,
            Self::Gradient(e) => e.tick(input),
            Self::Rls(e) => e.tick(input),
        }
    }
}

/// A residual with the dead zone taken off its size.
fn beyond(residual: f64, dead_zone: f64) -> f64 {
    if residual.abs() <= dead_zone { 0.0 } else { residual - dead_zone.copysign(residual) }
}
