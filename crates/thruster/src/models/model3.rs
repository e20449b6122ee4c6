//! Model 3, Whitcomb & Yoerger: Model 2 behind an ideal speed servo. The shaft speed is the
//! input, the axial flow the only state; inertia, friction and motor do not enter.

use super::{Model, SpeedInput};
use crate::blade::{BladeLoad, BladeRow};
use crate::momentum::Momentum;
use crate::parameters::Parameters;

/// Equations (13)-(17).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model3 {
    /// Momentum of the water, (13).
    pub momentum: Momentum,
    /// Lift and drag, (14)-(17).
    pub row: BladeRow,
    advance_m: f64,
}

/// State of a model that knows the axial flow alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FlowState {
    /// Axial flow at the propeller `vp`, m/s.
    pub axial_m_s: f64,
}

impl From<[f64; 1]> for FlowState {
    fn from([axial_m_s]: [f64; 1]) -> Self {
        Self { axial_m_s }
    }
}

impl From<FlowState> for [f64; 1] {
    fn from(s: FlowState) -> Self {
        [s.axial_m_s]
    }
}

impl Model3 {
    /// The model with these parameters; they must be those of a propeller.
    pub fn new(p: &Parameters) -> Self {
        let momentum = Momentum::new(p);
        let (thrust, _) = p.bollard_coefficients();
        Self { momentum, row: BladeRow::new(p), advance_m: (thrust / momentum.flux_kg_m).max(0.0).sqrt() }
    }
}

impl Model<1> for Model3 {
    type State = FlowState;
    type Input = SpeedInput;

    #[inline(always)]
    fn rates(&self, [flow]: &[f64; 1], input: &SpeedInput) -> [f64; 1] {
        let load = self.row.load(self.row.lever_m * input.shaft_speed_rad_s, *flow);
        [self.momentum.acceleration(load.thrust_n, *flow, input.ambient_m_s)]
    }

    fn load(&self, state: FlowState, input: &SpeedInput) -> BladeLoad {
        self.row.load(self.row.lever_m * input.shaft_speed_rad_s, state.axial_m_s)
    }

    fn rough_steady_state(&self, input: &SpeedInput) -> [f64; 1] {
        [self.advance_m * input.shaft_speed_rad_s + input.ambient_m_s]
    }
}
