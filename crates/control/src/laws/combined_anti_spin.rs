//! Torque and power control combined, with anti-spin.
//!
//! Reference: Smogeli 2006; docs/control.md D6: `Qc = w Qq + (1 - w) Qp`, `w = exp(-k |n|^r)` with speed
//! as a share of top speed: torque near standstill, where power is singular, power at speed. When
//! the observed load falls below a share of what the speed should carry, the shaft has lost its
//! water: the speed is held at a cap until the load is back, then the cap is let go at a limited
//! rate.
//!
//! Assumes: load far below the map means ventilation or broaching, not inflow.
//! Needs measured: shaft speed; current sharpens the load.
//!
//! Fails: strong following ambient flow unloads the blades too and can hold the cap on; thrust lost
//! to air is not won back, only the race is stopped.

use serde::{Deserialize, Serialize};

use super::power_control::power_torque_n_m;
use super::{Demand, LawInput};
use crate::limits::{Limit, LimitSet};
use crate::model::ControlModel;
use crate::observers::LoadTorque;

/// Options of the combination and of anti-spin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AntiSpinOptions {
    /// `k` of the weight.
    pub weight_k: f64,
    /// `r` of the weight.
    pub weight_r: f64,
    /// Share of the expected load below which the water counts as lost.
    pub loss_threshold: f64,
    /// Share above which it counts as back.
    pub release_threshold: f64,
    /// Cap on speed while the water is lost, as a share of the speed that the map expects.
    pub cap_share: f64,
    /// How fast the cap is let go, shares of top speed a second.
    pub release_rate_per_s: f64,
}

impl Default for AntiSpinOptions {
    fn default() -> Self {
        Self {
            weight_k: 3.0,
            weight_r: 2.0,
            loss_threshold: 0.5,
            release_threshold: 0.75,
            cap_share: 1.05,
            release_rate_per_s: 0.5,
        }
    }
}

/// A running combination.
#[derive(Clone, Copy, Debug)]
pub struct CombinedAntiSpin {
    options: AntiSpinOptions,
    load: LoadTorque,
    gain_nm_s: f64,
    applied_n_m: f64,
    lost_s: f64,
    lost: bool,
    /// Cap on speed, rad/s; infinite when let go.
    cap_rad_s: f64,
}

impl CombinedAntiSpin {
    /// At rest.
    pub fn new(model: &ControlModel, options: &AntiSpinOptions) -> Self {
        Self {
            options: *options,
            load: LoadTorque::new(model),
            gain_nm_s: model.speed_loop(56f64.to_radians()).1,
            applied_n_m: 0.0,
            lost_s: 0.0,
            lost: false,
            cap_rad_s: f64::INFINITY,
        }
    }

    /// Torque of the combination, held by the cap while the water is lost.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let (model, options) = (input.model, &self.options);
        let speed = input.speed_rad_s();
        let motor = input.measured.current_a.map_or(self.applied_n_m, |i| model.torque_constant_nm_a * i);
        self.load.tick(model, motor, speed, input.dt_s);

        let share = (speed / model.speed_max_rad_s).abs();
        let weight = (-options.weight_k * share.powf(options.weight_r)).exp();
        let steady = model.map.torque_for_thrust_n_m(input.thrust_n);
        let power = power_torque_n_m(input.thrust_n, speed, input);
        let mut torque = weight * steady + (1.0 - weight) * power + model.friction_n_m(speed);

        let target = model.map.speed_rad_s(input.thrust_n);
        self.watch(model, speed, target, share, input.dt_s);
        let mut limits = LimitSet::default();
        if self.cap_rad_s.is_finite() && speed * target > 0.0 {
            // Only driving torque is held back, and only towards the cap.
            let room = self.gain_nm_s * (self.cap_rad_s - speed.abs()) + self.load.torque_n_m.abs();
            if torque.abs() > room.max(0.0) && torque * speed > 0.0 {
                torque = room.max(0.0).copysign(torque);
                limits.set(Limit::AntiSpin);
            }
        }
        Demand { torque_n_m: torque, speed_rad_s: target, limits }
    }

    /// Detection with hysteresis and the cap's release.
    fn watch(&mut self, model: &ControlModel, speed: f64, target: f64, share: f64, dt_s: f64) {
        let options = &self.options;
        let expected = model.map.torque_n_m(speed);
        let loss = if share > 0.15 { self.load.torque_n_m / expected } else { 1.0 };
        self.lost_s = if loss < options.loss_threshold && speed.abs() > target.abs() {
            self.lost_s + dt_s
        } else {
            0.0
        };
        let confirm_s = 2.0 * (model.speed_filter_s + model.amplifier_lag_s + 2.0 * model.period_s);
        let cap = options.cap_share * target.abs().max(0.15 * model.speed_max_rad_s);
        if self.lost {
            self.lost = loss < options.release_threshold;
            self.cap_rad_s = cap;
        } else if self.lost_s > confirm_s {
            self.lost = true;
            self.cap_rad_s = cap;
        } else if self.cap_rad_s.is_finite() {
            self.cap_rad_s += options.release_rate_per_s * model.speed_max_rad_s * dt_s;
            if self.cap_rad_s > 1.5 * model.speed_max_rad_s {
                self.cap_rad_s = f64::INFINITY;
            }
        }
    }

    /// Keeps the applied torque for the load observer.
    pub fn settle(&mut self, applied_n_m: f64, _dt_s: f64) {
        self.applied_n_m = applied_n_m;
    }
}
