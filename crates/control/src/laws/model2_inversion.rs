//! Model 2 inverted to torque.
//!
//! Reference: Healey et al. 1995 for the model; docs/control.md D5 for the law:
//! `Omr` from `T(Omr, v^) = Td`, then `tau = Q(Omr, v^) + friction + I Omr' + kfb (Omr - Om)`.
//! The cascade is input-to-state stable if the flow estimate's error is bounded.
//!
//! The target speed moves no faster than the drive can follow, so that `I Omr'` asks only for
//! torque that is there, and is compared with the measurement behind the same lags
//! ([`super::speed_loop::MatchedTarget`]).
//!
//! Assumes: blade coefficients, inertia and torque constant known.
//! Needs measured: shaft speed; current, thrust or flow sharpen `v^`.
//!
//! Fails: as `model3_inversion` for errors of `v^` and blade coefficients; a wrong torque constant
//! or unknown friction is taken up by the servo's integral, slowly.

use super::speed_loop::{MatchedTarget, ServoOptions, SpeedLoop};
use super::{Demand, LawInput};
use crate::limits::{Limit, LimitSet};
use crate::model::ControlModel;

/// A running Model 2 inversion.
#[derive(Clone, Copy, Debug)]
pub struct Model2Inversion {
    servo: SpeedLoop,
    matched: MatchedTarget,
    bandwidth_rad_s: f64,
    wanted_rad_s: f64,
    target_rad_s: f64,
    started: bool,
}

impl Model2Inversion {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ServoOptions) -> Self {
        let quickest = 0.5 / (model.amplifier_lag_s + model.period_s);
        Self {
            servo: SpeedLoop::new(model, options),
            matched: MatchedTarget::new(model),
            bandwidth_rad_s: quickest.min(250.0),
            wanted_rad_s: 0.0,
            target_rad_s: 0.0,
            started: false,
        }
    }

    /// Torque of the inverted model.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let (model, estimate, dt) = (input.model, input.estimate, input.dt_s);
        let speed = input.speed_rad_s();
        if !self.started {
            self.started = true;
            self.target_rad_s = speed;
            self.matched.reset(speed);
        }
        let (flow, swirl) = (estimate.flow_m_s.value, estimate.swirl_m_s.value);
        let wanted = model.speed_for_thrust_rad_s(input.thrust_n, flow, swirl, self.wanted_rad_s);
        let cap = 1.1 * model.speed_max_rad_s;
        self.wanted_rad_s = wanted.clamp(-cap, cap);
        let mut limits = LimitSet::default();
        if self.wanted_rad_s != wanted {
            limits.set(Limit::ShaftSpeed);
        }
        // Acceleration that the drive has left over the load, with a tenth kept for feedback.
        let load =
            model.load(self.target_rad_s, flow, swirl).torque_n_m + model.friction_n_m(self.target_rad_s);
        let torque_max = 0.9 * model.torque_constant_nm_a * model.current_limit_a;
        let (up, down) = ((torque_max - load).max(0.0), (torque_max + load).max(0.0));
        let acceleration = (self.bandwidth_rad_s * (self.wanted_rad_s - self.target_rad_s))
            .clamp(-down / model.inertia_kg_m2, up / model.inertia_kg_m2);
        let share = 1.0 / (1.0 + self.bandwidth_rad_s * dt);
        let acceleration = acceleration * share;
        self.target_rad_s += acceleration * dt;
        let seen = self.matched.step(self.target_rad_s, dt);
        let feedforward = load + model.inertia_kg_m2 * acceleration;
        let torque = self.servo.tick(feedforward, seen, speed, dt);
        Demand { torque_n_m: torque, speed_rad_s: self.target_rad_s, limits }
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.servo.settle(applied_n_m, dt_s);
    }
}
