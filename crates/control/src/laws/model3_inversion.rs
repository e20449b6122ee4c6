//! Model 3 inverted to a speed for the servo.
//!
//! Reference: Whitcomb & Yoerger 1999 (control paper, law re-derived); docs/control.md D4: from the
//! observed flow solve `T(Om, v^) = Td` for the shaft speed, then servo on it with the static
//! torque feedforward of (21).
//!
//! Assumes: blade coefficients known; the servo is fast beside the water (38 ms at 60 rad/s).
//! Needs measured: shaft speed; flow, thrust or current sharpen the observer's `v^`.
//!
//! Fails: an error in `v^` is a thrust error; unknown ambient flow is one unless the observer has
//! current or thrust to see it by. Sensitive to encoder noise through the servo only.

use super::speed_loop::{ServoOptions, SpeedLoop};
use super::{Demand, LawInput};
use crate::limits::{Limit, LimitSet};
use crate::model::ControlModel;

/// A running Model 3 inversion.
#[derive(Clone, Copy, Debug)]
pub struct Model3Inversion {
    servo: SpeedLoop,
    target_rad_s: f64,
}

impl Model3Inversion {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ServoOptions) -> Self {
        Self { servo: SpeedLoop::new(model, options), target_rad_s: 0.0 }
    }

    /// Torque of the servo on the inverted speed.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let (model, flow) = (input.model, input.estimate.flow_m_s.value);
        let wanted = model.speed_for_thrust_rad_s(input.thrust_n, flow, 0.0, self.target_rad_s);
        let cap = 1.1 * model.speed_max_rad_s;
        self.target_rad_s = wanted.clamp(-cap, cap);
        let mut limits = LimitSet::default();
        if self.target_rad_s != wanted {
            limits.set(Limit::ShaftSpeed);
        }
        let feedforward =
            model.map.torque_for_thrust_n_m(input.thrust_n) + model.friction_n_m(self.target_rad_s);
        let torque = self.servo.tick(feedforward, self.target_rad_s, input.speed_rad_s(), input.dt_s);
        Demand { torque_n_m: torque, speed_rad_s: self.target_rad_s, limits }
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.servo.settle(applied_n_m, dt_s);
    }
}
