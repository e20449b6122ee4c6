//! Model 2 with rotational flow, inverted to torque.
//!
//! Reference: Bachmayer, Whitcomb & Grosenbaugh 2000 for the physics; the form is that of
//! docs/theory.md (`rotational_flow`): `rho a l gr us' = Q/re - dbr rho a |vp| us`, blades meet
//! `re Om - us`. The law is that of `model2_inversion` on the swirling water, with the observer's swirl.
//!
//! Assumes: as `model2_inversion`, and the two coefficients of the swirl. Lift and drag are moved
//! so that the static map stays that of the rig, which was identified without swirl.
//! Needs measured: as `model2_inversion`.
//!
//! Fails: where the water does not swirl (guide vanes, contra-rotation) its transients are worse
//! than those of `model2_inversion`; the swirl's coefficients are not fixed by bollard data.

use serde::{Deserialize, Serialize};

use super::model2_inversion::Model2Inversion;
use super::speed_loop::ServoOptions;
use super::{Demand, LawInput};
use crate::model::ControlModel;

/// Coefficients of the wake's rotation.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RotationalFlowOptions {
    /// Drag coefficient of the swirl, `dbr`.
    pub drag: f64,
    /// Inertia ratio of the swirl, `gr`.
    pub inertia: f64,
}

impl Default for RotationalFlowOptions {
    fn default() -> Self {
        Self { drag: 3.0, inertia: 0.1 }
    }
}

/// A running inversion; the model it is given carries the swirl.
#[derive(Clone, Copy, Debug)]
pub struct RotationalFlowInversion {
    inner: Model2Inversion,
}

impl RotationalFlowInversion {
    /// At rest.
    pub fn new(model: &ControlModel, servo: &ServoOptions) -> Self {
        Self { inner: Model2Inversion::new(model, servo) }
    }

    /// Torque of the inverted model.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        self.inner.tick(input)
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.inner.settle(applied_n_m, dt_s);
    }
}
