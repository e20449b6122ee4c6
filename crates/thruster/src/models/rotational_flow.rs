//! Model 2 with the swirl of the wake as a third state, after the successor models (Bachmayer,
//! Whitcomb & Grosenbaugh 2000 add rotational fluid velocity and inertia).

use super::model2::Model2;
use super::{DriveInput, Model};
use crate::blade::{BladeLoad, Swirl};
use crate::parameters::Parameters;

/// Model 2 and the [swirl law](crate::blade::Swirl); the blade meets the water at `re Om - us`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RotationalFlow {
    /// Everything but the swirl.
    pub axial: Model2,
    /// Swirl of the wake.
    pub swirl: Swirl,
}

/// State of a model that knows shaft, axial flow and swirl.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SwirlState {
    /// Shaft speed `Om`, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Axial flow at the propeller `vp`, m/s.
    pub axial_m_s: f64,
    /// Swirl of the water at 0.7 radius `us`, m/s; positive with positive shaft speed.
    pub swirl_m_s: f64,
}

impl From<[f64; 3]> for SwirlState {
    fn from([shaft_speed_rad_s, axial_m_s, swirl_m_s]: [f64; 3]) -> Self {
        Self { shaft_speed_rad_s, axial_m_s, swirl_m_s }
    }
}

impl From<SwirlState> for [f64; 3] {
    fn from(s: SwirlState) -> Self {
        [s.shaft_speed_rad_s, s.axial_m_s, s.swirl_m_s]
    }
}

impl RotationalFlow {
    /// The model with these parameters; they must be those of a propeller.
    pub fn new(p: &Parameters) -> Self {
        Self { axial: Model2::new(p), swirl: Swirl::new(p) }
    }

    fn blades(&self, speed: f64, flow: f64, swirl: f64) -> BladeLoad {
        self.axial.row.load(self.axial.row.lever_m * speed - swirl, flow)
    }
}

impl Model<3> for RotationalFlow {
    type State = SwirlState;
    type Input = DriveInput;

    #[inline(always)]
    fn rates(&self, [speed, flow, swirl]: &[f64; 3], input: &DriveInput) -> [f64; 3] {
        let load = self.blades(*speed, *flow, *swirl);
        [
            self.axial.motor.acceleration(input.drive, *speed, load.torque_n_m),
            self.axial.momentum.acceleration(load.thrust_n, *flow, input.ambient_m_s),
            self.swirl.acceleration(load.torque_n_m, *flow, *swirl, 0.0),
        ]
    }

    fn load(&self, state: SwirlState, _: &DriveInput) -> BladeLoad {
        self.blades(state.shaft_speed_rad_s, state.axial_m_s, state.swirl_m_s)
    }

    fn rough_steady_state(&self, input: &DriveInput) -> [f64; 3] {
        let [speed, flow] = self.axial.rough_steady_state(input);
        [speed, flow, 0.2 * self.axial.row.lever_m * speed]
    }
}
