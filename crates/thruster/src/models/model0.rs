//! Model 0: a static map. Thrust and torque follow the square of the shaft speed; what every
//! thruster driver assumes that knows no better.

use super::{Model, SpeedInput};
use crate::blade::BladeLoad;
use crate::parameters::{Parameter as P, Parameters};

/// `T = C0 Om|Om|`, `Q = C1 Om|Om|`. No state; ambient flow does not enter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Model0 {
    /// `C0`, N s^2.
    pub thrust_coefficient_n_s2: f64,
    /// `C1`, N m s^2.
    pub torque_coefficient_nm_s2: f64,
}

impl Model0 {
    /// The model with these parameters.
    pub fn new(p: &Parameters) -> Self {
        Self {
            thrust_coefficient_n_s2: p.get(P::ThrustCoefficientNS2),
            torque_coefficient_nm_s2: p.get(P::TorqueCoefficientNmS2),
        }
    }

    /// Shaft speed, rad/s, at which the map gives a thrust, N.
    pub fn shaft_speed_rad_s(&self, thrust_n: f64) -> f64 {
        thrust_n.signum() * (thrust_n.abs() / self.thrust_coefficient_n_s2).sqrt()
    }
}

impl Model<0> for Model0 {
    type State = [f64; 0];
    type Input = SpeedInput;

    fn rates(&self, _: &[f64; 0], _: &SpeedInput) -> [f64; 0] {
        []
    }

    fn load(&self, _: [f64; 0], input: &SpeedInput) -> BladeLoad {
        let square = input.shaft_speed_rad_s * input.shaft_speed_rad_s.abs();
        BladeLoad {
            thrust_n: self.thrust_coefficient_n_s2 * square,
            torque_n_m: self.torque_coefficient_nm_s2 * square,
        }
    }

    fn rough_steady_state(&self, _: &SpeedInput) -> [f64; 0] {
        []
    }
}
