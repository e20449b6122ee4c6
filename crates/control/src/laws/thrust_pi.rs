//! PI thrust control on a force sensor.
//!
//! Reference: the plain loop of the field; the design is ours. `tau = a1 Td + Kp e + Ki int(e)`,
//! `e = Td - T`. The plant from torque to thrust is `1/a1` behind the slow flow pole `p`, which grows
//! in proportion to shaft speed (similarity, docs/theory.md), so the zero follows it:
//! `Kp = a1 w / p`, `Ki = a1 w`, `w = bandwidth_ratio x p`, kept under a fifth of what the sensor's
//! filter and the drive allow.
//!
//! What the sensor may move is bounded: the blades' torque for a thrust is nearly the same in any inflow, so the torque stays
//! within a factor of two of feedforward, and what a change of the setpoint asks for is added until the water follows.
//!
//! Assumes: a calibrated force sensor without structural resonance inside the bandwidth.
//! Needs measured: thrust. Without it the integral fades and the law becomes `static_map`.
//!
//! Fails: sensor bias and gain are thrust errors one to one, up to that factor; near standstill the plant is slow and
//! so is the loop; ventilation makes it race, as it asks for thrust that is not to be had.

use serde::{Deserialize, Serialize};

use super::{Demand, LawInput};
use crate::limits::{Integrator, Limit, LimitSet};
use crate::model::ControlModel;

/// Options of the PI loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ThrustPiOptions {
    /// Bandwidth as a multiple of the plant's slow pole.
    pub bandwidth_ratio: f64,
}

impl Default for ThrustPiOptions {
    fn default() -> Self {
        Self { bandwidth_ratio: 1.0 }
    }
}

/// Time in which the integral fades without its sensor, s.
const FADE_S: f64 = 1.0;

/// Torque over feedforward, either way, that a thrust can need: a duct or a hull takes up to 0.3 of it, and lift and drag are known
/// to 0.3, 1 / 0.7^2. Beyond that not the thruster is off but the sensor: dead, frozen, in a wrong unit or reversed.
const BAND: f64 = 2.0;
/// The same about zero, as a share of the largest torque: friction that no model has, and the drag of blades that a stream
/// turns.
const FLOOR: f64 = 0.05;

/// A running PI loop.
#[derive(Clone, Copy, Debug)]
pub struct ThrustPi {
    ratio: f64,
    ceiling_rad_s: f64,
    slow_per_rad: f64,
    integral: Integrator,
    /// Feedforward as the water has followed it, N m.
    followed_n_m: f64,
    asked_n_m: f64,
    tracking_time_s: f64,
}

impl ThrustPi {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ThrustPiOptions) -> Self {
        let lags = model.thrust_filter_s + model.amplifier_lag_s + 1.5 * model.period_s;
        Self {
            ratio: options.bandwidth_ratio,
            ceiling_rad_s: 0.2 / lags,
            slow_per_rad: model.poles_per_rad().0,
            integral: Integrator::default(),
            followed_n_m: 0.0,
            asked_n_m: 0.0,
            tracking_time_s: 0.1,
        }
    }

    /// Torque of feedforward and PI.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let model = input.model;
        let a1 = model.map.torque_n_m_s2 / model.map.thrust_n_s2;
        let target = model.map.speed_rad_s(input.thrust_n);
        let speed = input.speed_rad_s();
        let scale = speed.abs().max(0.5 * target.abs()).max(0.05 * model.speed_max_rad_s);
        let pole = self.slow_per_rad * scale;
        let bandwidth = (self.ratio * pole).min(self.ceiling_rad_s);
        let forward = a1 * input.thrust_n + model.friction_n_m(speed);
        self.followed_n_m += (forward - self.followed_n_m) * (pole * input.dt_s).min(1.0);
        self.tracking_time_s = 1.0 / bandwidth;
        let mut limits = LimitSet::default();
        let Some(thrust) = input.measured.thrust_n else {
            self.integral.fade(FADE_S, input.dt_s);
            self.asked_n_m = forward + self.integral.state;
            return Demand { torque_n_m: self.asked_n_m, speed_rad_s: target, limits };
        };
        let error = input.thrust_n - thrust;
        let changes = self.ratio.max(1.0) * (forward - self.followed_n_m).abs();
        let floor = FLOOR * model.torque_constant_nm_a * model.current_limit_a;
        let more = ((BAND - 1.0) * forward.abs()).max(floor) + changes;
        let less = ((1.0 - 1.0 / BAND) * forward.abs()).max(floor) + changes;
        // Away from zero and towards it.
        let (low, high) = if forward < 0.0 { (-more, less) } else { (-less, more) };
        self.integral.step(a1 * bandwidth * error, more, input.dt_s);
        let wanted = a1 * bandwidth / pole * error + self.integral.state;
        let given = wanted.clamp(low, high);
        if given != wanted {
            limits.set(Limit::Trim);
        }
        // The integral follows what the band left, as it follows every other limit.
        self.asked_n_m = forward + wanted;
        Demand { torque_n_m: forward + given, speed_rad_s: target, limits }
    }

    /// Back-calculation.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.integral.follow(self.asked_n_m, applied_n_m, self.tracking_time_s, dt_s);
    }
}
