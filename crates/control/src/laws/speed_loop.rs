//! The speed loop inside the laws: (21) of the paper with an integrator.
//!
//! `tau = feedforward + kfb (Omr - Om) + integral`. The gain follows from the rig by a bandwidth
//! rule (docs/control.md D2): the crossover is where the drive's lag, the speed filter and one and a
//! half periods leave the asked phase margin; on the paper's stand 56 degrees give 45 rad/s and
//! `kfb` 0.5 N m s. The integral's corner is a fraction of the crossover.
//!
//! Assumes: the shaft is an integrator at crossover; inertia and lags as the rig states them.
//! Needs measured: shaft speed.
//!
//! Fails: an inertia stated too large costs phase margin, one too small costs bandwidth; a torsional
//! resonance below the crossover is outside the design.

use serde::{Deserialize, Serialize};

use crate::limits::Integrator;
use crate::model::ControlModel;

/// Options of the speed loop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ServoOptions {
    /// Phase margin the crossover is chosen for, degrees.
    pub phase_margin_deg: f64,
    /// Corner of the integral as a fraction of the crossover; 0 takes the integral out.
    pub integral_fraction: f64,
}

impl Default for ServoOptions {
    fn default() -> Self {
        Self { phase_margin_deg: 56.0, integral_fraction: 0.1 }
    }
}

/// A running speed loop.
#[derive(Clone, Copy, Debug)]
pub struct SpeedLoop {
    /// Crossover, rad/s.
    pub crossover_rad_s: f64,
    /// Proportional gain `kfb`, N m s.
    pub gain_nm_s: f64,
    integral_gain_n_m: f64,
    authority_n_m: f64,
    tracking_time_s: f64,
    integral: Integrator,
    asked_n_m: f64,
}

impl SpeedLoop {
    /// A loop at rest.
    pub fn new(model: &ControlModel, options: &ServoOptions) -> Self {
        let (crossover, gain) = model.speed_loop(options.phase_margin_deg.to_radians());
        let integral_gain = gain * options.integral_fraction * crossover;
        let integral_time = 1.0 / (options.integral_fraction * crossover).max(1e-6);
        Self {
            crossover_rad_s: crossover,
            gain_nm_s: gain,
            integral_gain_n_m: integral_gain,
            authority_n_m: model.torque_constant_nm_a * model.current_limit_a,
            // sqrt(1/wc x Kp/Ki), D10
            tracking_time_s: (integral_time / crossover).sqrt(),
            integral: Integrator::default(),
            asked_n_m: 0.0,
        }
    }

    /// Torque for a target speed, N m.
    pub fn tick(&mut self, feedforward_n_m: f64, target_rad_s: f64, speed_rad_s: f64, dt_s: f64) -> f64 {
        let error = target_rad_s - speed_rad_s;
        self.integral.step(self.integral_gain_n_m * error, self.authority_n_m, dt_s);
        self.asked_n_m = feedforward_n_m + self.gain_nm_s * error + self.integral.state;
        self.asked_n_m
    }

    /// Back-calculation with what was applied.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        self.integral.follow(self.asked_n_m, applied_n_m, self.tracking_time_s, dt_s);
    }
}

/// A target as its measurement will see it: behind the hold and the sensor's filter. Comparing like with like leaves no error when the model is right, so that feedforward
/// acts at once and feedback only on what the model does not know.
#[derive(Clone, Copy, Debug)]
pub struct MatchedTarget {
    drive_s: f64,
    filter_s: f64,
    shaft_rad_s: f64,
    seen_rad_s: f64,
}

impl MatchedTarget {
    /// For a target that the drive's lag has already been taken into: behind the hold and the speed filter alone.
    pub fn behind_sensors(model: &ControlModel) -> Self {
        let [_, filter, delay] = model.loop_lags_s();
        Self { drive_s: delay, filter_s: filter, shaft_rad_s: 0.0, seen_rad_s: 0.0 }
    }

    /// For a thrust that a led shaft brings at a rate, 1/s: behind that, the hold and the force sensor's filter.
    pub fn of_thrust(model: &ControlModel, shaft_per_s: f64) -> Self {
        let [_, _, delay] = model.loop_lags_s();
        Self {
            drive_s: delay + 1.0 / shaft_per_s,
            filter_s: model.thrust_filter_s,
            shaft_rad_s: 0.0,
            seen_rad_s: 0.0,
        }
    }

    /// The target as the measurement will show it, rad/s.
    pub fn step(&mut self, target_rad_s: f64, dt_s: f64) -> f64 {
        let towards = |state: f64, input: f64, tau: f64| state + (input - state) * dt_s / (tau + dt_s);
        self.shaft_rad_s = towards(self.shaft_rad_s, target_rad_s, self.drive_s);
        self.seen_rad_s = towards(self.seen_rad_s, self.shaft_rad_s, self.filter_s);
        self.seen_rad_s
    }

    /// Starts again from what is measured.
    pub fn reset(&mut self, measured: f64) {
        (self.shaft_rad_s, self.seen_rad_s) = (measured, measured);
    }
}
