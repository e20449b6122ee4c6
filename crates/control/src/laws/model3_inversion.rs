//! Model 3 inverted to a speed for the servo.
//!
//! Reference: Whitcomb & Yoerger 1999 (control paper, law re-derived); docs/control.md D4: from the
//! observed flow solve `T(Om, v) = Td` for the shaft speed in the flow that it will meet when the servo has
//! brought it there (`aim.rs`), then servo on it with the static torque feedforward of (21).
//!
//! Assumes: blade coefficients known. A servo that is slow beside the water (a 76 mm thruster) is aimed at the
//! steady state, a fast one at the flow now.
//! Needs measured: shaft speed; flow, thrust or current sharpen the observer's `v^`.
//!
//! Fails: an error in `v^` is a thrust error; unknown ambient flow is one unless the observer has
//! current or thrust to see it by. Sensitive to encoder noise through the servo only.

use super::aim::Aim;
use super::speed_loop::{ServoOptions, SpeedLoop};
use super::{Demand, LawInput};
use crate::limits::{Limit, LimitSet};
use crate::model::ControlModel;

/// A running Model 3 inversion.
#[derive(Clone, Copy, Debug)]
pub struct Model3Inversion {
    servo: SpeedLoop,
    aim: Aim,
}

impl Model3Inversion {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ServoOptions) -> Self {
        Self { servo: SpeedLoop::new(model, options), aim: Aim::default() }
    }

    /// Torque of the servo on the inverted speed.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let model = input.model;
        let arrives_s = 1.0 / self.servo.crossover_rad_s + model.delay_s;
        let target = self.aim.at(model, input.estimate, input.thrust_n, arrives_s);
        let mut limits = LimitSet::default();
        if target.capped {
            limits.set(Limit::ShaftSpeed);
        }
        let feedforward =
            model.map.torque_for_thrust_n_m(input.thrust_n) + model.friction_n_m(target.speed_rad_s);
        let torque = self.servo.tick(feedforward, target.speed_rad_s, input.speed_rad_s(), input.dt_s);
        Demand { torque_n_m: torque, speed_rad_s: target.speed_rad_s, limits }
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.servo.settle(applied_n_m, dt_s);
    }
}
