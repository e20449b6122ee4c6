//! The published models: a file each, simulated, linearised and solved for their steady state
//! through one trait. They are the equations as published; the composed [`crate::plant`] is what
//! fits and simulated stands run, and a test holds the two together.

mod linear;
mod model0;
mod model1;
mod model2;
mod model3;
mod rotational_flow;
mod steady;

pub use linear::{Linear, Pole};
pub use model0::Model0;
pub use model1::{Model1, ShaftState};
pub use model2::{Model2, ShaftFlowState};
pub use model3::{FlowState, Model3};
pub use rotational_flow::{RotationalFlow, SwirlState};
pub use steady::NoSteadyState;

use serde::{Deserialize, Serialize};

use crate::blade::BladeLoad;
use crate::integrate::rk4;
use crate::motor::Drive;

/// Input of a model whose shaft a motor turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveInput {
    /// What the drive imposes.
    pub drive: Drive,
    /// Ambient axial flow `va`, m/s; positive when it feeds the propeller ahead.
    pub ambient_m_s: f64,
}

/// Input of a model whose shaft speed is imposed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpeedInput {
    /// Shaft speed `Om`, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Ambient axial flow `va`, m/s; positive when it feeds the propeller ahead.
    pub ambient_m_s: f64,
}

impl DriveInput {
    /// A torque, N m, in still water.
    pub fn torque(torque_n_m: f64) -> Self {
        Self { drive: Drive::Torque(torque_n_m), ambient_m_s: 0.0 }
    }

    /// A motor current, A, in still water.
    pub fn current(current_a: f64) -> Self {
        Self { drive: Drive::Current(current_a), ambient_m_s: 0.0 }
    }

    /// A motor voltage, V, in still water.
    pub fn voltage(voltage_v: f64) -> Self {
        Self { drive: Drive::Voltage(voltage_v), ambient_m_s: 0.0 }
    }
}

impl SpeedInput {
    /// A shaft speed, rad/s, in still water.
    pub fn still(shaft_speed_rad_s: f64) -> Self {
        Self { shaft_speed_rad_s, ambient_m_s: 0.0 }
    }
}

/// What a model is driven by: the one number that acts, beside the ambient flow.
pub trait Input: Copy {
    /// The same input with `by` added to what acts (torque, current, voltage or shaft speed).
    fn plus(self, by: f64) -> Self;
}

impl Input for DriveInput {
    fn plus(self, by: f64) -> Self {
        Self { drive: self.drive.plus(by), ..self }
    }
}

impl Input for SpeedInput {
    fn plus(self, by: f64) -> Self {
        Self { shaft_speed_rad_s: self.shaft_speed_rad_s + by, ..self }
    }
}

/// A thruster model with `N` states.
pub trait Model<const N: usize> {
    /// The states by name.
    type State: Copy + From<[f64; N]> + Into<[f64; N]>;
    /// What drives it.
    type Input: Input;

    /// Time derivative of the states, in their order, SI units a second.
    fn rates(&self, x: &[f64; N], input: &Self::Input) -> [f64; N];

    /// Thrust and blade torque at a state.
    fn load(&self, state: Self::State, input: &Self::Input) -> BladeLoad;

    /// A state of the right sign and rough size to start the search for the steady state.
    fn rough_steady_state(&self, input: &Self::Input) -> [f64; N];

    /// The state `dt_s` later, by one Runge-Kutta step of order 4 with the input held.
    #[inline(always)]
    fn step(&self, state: Self::State, input: &Self::Input, dt_s: f64) -> Self::State {
        rk4(state.into(), 0.0, dt_s, |_, x| self.rates(x, input)).into()
    }

    /// The state in which nothing changes while the input is held.
    ///
    /// # Errors
    /// [`NoSteadyState`] if the search does not settle, with where it stopped.
    fn steady_state(&self, input: &Self::Input) -> Result<Self::State, NoSteadyState> {
        steady::search(self.rough_steady_state(input), |x| self.rates(x, input)).map(Self::State::from)
    }

    /// The model for small motions about a state.
    fn linearise(&self, state: Self::State, input: &Self::Input) -> Linear<N> {
        Linear::about(
            state.into(),
            |x, by| self.rates(x, &input.plus(by)),
            |x, by| self.load((*x).into(), &input.plus(by)),
        )
    }
}

/// A thruster model.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ModelName {
    /// Static map: thrust and torque proportional to shaft speed squared.
    Model0,
    /// Yoerger, Cooke and Slotine 1990: shaft speed driven by torque.
    Model1,
    /// Healey et al. 1995: shaft speed and axial flow, blades with lift and drag.
    Model2,
    /// Whitcomb and Yoerger: Model 2 with the shaft speed as input.
    Model3,
    /// Model 2 with the swirl of the wake as a third state.
    RotationalFlow,
}

impl ModelName {
    /// Every model.
    pub const ALL: [Self; 5] = [Self::Model0, Self::Model1, Self::Model2, Self::Model3, Self::RotationalFlow];

    /// Name as on the command line and in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model0 => "model0",
            Self::Model1 => "model1",
            Self::Model2 => "model2",
            Self::Model3 => "model3",
            Self::RotationalFlow => "rotational_flow",
        }
    }
}

impl std::fmt::Display for ModelName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl std::str::FromStr for ModelName {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|m| m.name() == text).ok_or_else(|| {
            format!("`{text}` is not a model; known are {}", Self::ALL.map(Self::name).join(", "))
        })
    }
}
