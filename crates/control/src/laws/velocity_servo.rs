//! Velocity servo on the static map, with torque feedforward.
//!
//! Reference: (18), (21) of Whitcomb & Yoerger: `Omr = sgn(Td) sqrt(|Td| / C0)`,
//! `tau = a1 Td + kfb (Omr - Om)`, here with an integrator (docs/control.md D2).
//!
//! Assumes: still water and steady state, so that speed stands for thrust.
//! Needs measured: shaft speed.
//!
//! Fails: ambient flow is a thrust error at full size (thrust per speed squared falls by 20 % at
//! 1.5 N m in 0.3 m/s); a
//! step of speed throws thrust up by about a factor of two before the water has been accelerated.
//! Hides friction, inertia and torque-constant faults from thrust, which is its strength.

use super::speed_loop::{ServoOptions, SpeedLoop};
use super::{Demand, LawInput};
use crate::limits::LimitSet;
use crate::model::ControlModel;

/// A running velocity servo.
#[derive(Clone, Copy, Debug)]
pub struct VelocityServo {
    servo: SpeedLoop,
}

impl VelocityServo {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ServoOptions) -> Self {
        Self { servo: SpeedLoop::new(model, options) }
    }

    /// Torque for the speed that the map gives for the thrust reference.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let speed = input.model.map.speed_rad_s(input.thrust_n);
        self.tick_speed(speed, input)
    }

    /// Torque for a speed asked for directly, rad/s.
    pub fn tick_speed(&mut self, target_rad_s: f64, input: &LawInput) -> Demand {
        let map = &input.model.map;
        let feedforward = map.torque_n_m(target_rad_s) + input.model.friction_n_m(target_rad_s);
        let torque = self.servo.tick(feedforward, target_rad_s, input.speed_rad_s(), input.dt_s);
        Demand { torque_n_m: torque, speed_rad_s: target_rad_s, limits: LimitSet::default() }
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.servo.settle(applied_n_m, dt_s);
    }
}
