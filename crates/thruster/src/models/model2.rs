//! Model 2, Healey et al. 1995: shaft speed and axial flow, with lift and drag on the blades.

use super::model1::rough_speed;
use super::{DriveInput, Model};
use crate::blade::{BladeLoad, BladeRow};
use crate::momentum::Momentum;
use crate::motor::Motor;
use crate::parameters::Parameters;

/// Equations (10)-(17); all four quadrants, ambient flow through (6a).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model2 {
    /// Motor and shaft, (10)-(12).
    pub motor: Motor,
    /// Momentum of the water, (13).
    pub momentum: Momentum,
    /// Lift and drag, (14)-(17).
    pub row: BladeRow,
    /// `Q/Om^2` and `vp/Om` in bollard pull: where the search for a steady state starts.
    bollard: (f64, f64),
}

/// State of a model that knows shaft and axial flow.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ShaftFlowState {
    /// Shaft speed `Om`, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Axial flow at the propeller `vp`, m/s.
    pub axial_m_s: f64,
}

impl From<[f64; 2]> for ShaftFlowState {
    #[inline(always)]
    fn from([shaft_speed_rad_s, axial_m_s]: [f64; 2]) -> Self {
        Self { shaft_speed_rad_s, axial_m_s }
    }
}

impl From<ShaftFlowState> for [f64; 2] {
    #[inline(always)]
    fn from(s: ShaftFlowState) -> Self {
        [s.shaft_speed_rad_s, s.axial_m_s]
    }
}

impl Model2 {
    /// The model with these parameters; they must be those of a propeller.
    pub fn new(p: &Parameters) -> Self {
        let momentum = Momentum::new(p);
        let (thrust, torque) = p.bollard_coefficients();
        Self {
            motor: Motor::new(p),
            momentum,
            row: BladeRow::new(p),
            bollard: (torque, (thrust / momentum.flux_kg_m).max(0.0).sqrt()),
        }
    }
}

impl Model<2> for Model2 {
    type State = ShaftFlowState;
    type Input = DriveInput;

    #[inline(always)]
    fn rates(&self, [speed, flow]: &[f64; 2], input: &DriveInput) -> [f64; 2] {
        let load = self.row.load(self.row.lever_m * speed, *flow);
        [
            self.motor.acceleration(input.drive, *speed, load.torque_n_m),
            self.momentum.acceleration(load.thrust_n, *flow, input.ambient_m_s),
        ]
    }

    fn load(&self, state: ShaftFlowState, _: &DriveInput) -> BladeLoad {
        self.row.load(self.row.lever_m * state.shaft_speed_rad_s, state.axial_m_s)
    }

    fn rough_steady_state(&self, input: &DriveInput) -> [f64; 2] {
        let (torque, advance_m) = self.bollard;
        let speed = rough_speed(self.motor.torque_n_m(input.drive, 0.0), torque);
        [speed, advance_m * speed + input.ambient_m_s]
    }
}
