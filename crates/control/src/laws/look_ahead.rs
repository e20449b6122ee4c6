//! Predictive control under current and slew limits.
//!
//! Reference: nonlinear model-predictive control by single shooting with move blocking, solved by a
//! fixed number of Gauss-Newton steps (Diehl, Bock & Schloeder 2005, real-time iteration); the
//! formulation is ours. Two currents are sought, one for the first few steps of the horizon and one
//! for the rest, that bring the predicted thrust of Model 2 onto the reference soonest:
//! `sum ((T_k - Td)/Tmax)^2 + r ((i1 - i_last)/Imax)^2`, with the speed error at the end of the
//! horizon. The prediction holds shaft, flow, the drive's lag and what load the model does not explain (load observer, docs/control.md D7), which makes it offset-free.
//!
//! Assumes: as `model2_inversion`. Needs measured: shaft speed; the rest sharpens the observer.
//!
//! Fails: as `model2_inversion` for errors of `v^` and blades; costs some microseconds a tick, fixed
//! in number of model evaluations, whatever the state.

use serde::{Deserialize, Serialize};

use super::speed_loop::ServoOptions;
use super::{Demand, LawInput};
use crate::limits::LimitSet;
use crate::model::ControlModel;
use crate::observers::LoadTorque;

/// Steps of the horizon.
const STEPS: usize = 14;
/// Steps under the first current.
const FIRST: usize = 3;
/// Thrust errors along the horizon, and the speed error at its end.
const RESIDUALS: usize = STEPS + 1;
/// Weight of the speed error at the end. Near standstill thrust hardly depends on the current (it
/// is quadratic in speed) and alone would let the shaft hunt.
const END_WEIGHT: f64 = 0.5;

/// Options of the prediction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LookAheadOptions {
    /// Horizon in periods of the servo's crossover (in radians: 1 means `1/wc`).
    pub horizon: f64,
    /// Weight `r` on the change of current.
    pub effort: f64,
    /// Gauss-Newton steps a tick, 1 to 4.
    pub iterations: u8,
}

impl Default for LookAheadOptions {
    fn default() -> Self {
        Self { horizon: 1.6, effort: 0.02, iterations: 1 }
    }
}

/// A running predictive law.
#[derive(Clone, Copy, Debug)]
pub struct LookAhead {
    load: LoadTorque,
    unexplained_n_m: f64,
    aim_rad_s: f64,
    step_s: f64,
    effort: f64,
    iterations: u8,
    /// First and second current, A.
    moves: [f64; 2],
    last_a: f64,
    drive_a: f64,
    smoothing_s: f64,
    torque_constant_nm_a: f64,
}

/// What the prediction starts from.
struct Start {
    speed_rad_s: f64,
    flow_m_s: f64,
    ambient_m_s: f64,
    swirl_m_s: f64,
    drive_a: f64,
    unexplained_n_m: f64,
    /// Speed that gives the thrust asked for in the flow now, rad/s.
    aim_rad_s: f64,
}

impl LookAhead {
    /// At rest.
    pub fn new(model: &ControlModel, servo: &ServoOptions, options: &LookAheadOptions) -> Self {
        let (crossover, _) = model.speed_loop(servo.phase_margin_deg.to_radians());
        let step = (options.horizon.clamp(0.2, 10.0) / crossover / STEPS as f64).min(4.0 * model.step_max_s);
        Self {
            load: LoadTorque::new(model),
            unexplained_n_m: 0.0,
            aim_rad_s: 0.0,
            step_s: step.max(1e-5),
            effort: options.effort.clamp(1e-6, 10.0),
            iterations: options.iterations.clamp(1, 4),
            moves: [0.0; 2],
            last_a: 0.0,
            drive_a: 0.0,
            smoothing_s: 4.0 * (model.speed_filter_s + model.amplifier_lag_s + 1.5 * model.period_s),
            torque_constant_nm_a: model.torque_constant_nm_a,
        }
    }

    /// Predicted errors under two currents, as shares of the largest thrust and speed.
    fn predict(
        &self,
        model: &ControlModel,
        start: &Start,
        moves: [f64; 2],
        thrust_n: f64,
    ) -> [f64; RESIDUALS] {
        let h = self.step_s;
        let (mut speed, mut flow, mut current) = (start.speed_rad_s, start.flow_m_s, start.drive_a);
        let follow = h / (model.amplifier_lag_s + model.period_s + h);
        let inverse_scale = 1.0 / model.thrust_max_n;
        let mut errors = [0.0; RESIDUALS];
        for (k, error) in errors[..STEPS].iter_mut().enumerate() {
            current += (moves[usize::from(k >= FIRST)] - current) * follow;
            let s = model.slopes(model.blade.inflow(speed, flow, start.swirl_m_s));
            let torque = model.torque_constant_nm_a * current
                - s.torque_n_m
                - model.friction_n_m(speed)
                - start.unexplained_n_m;
            // Linearly implicit in the shaft's and the flow's own damping: no step is too long.
            let damping = model.blade.lever_m() * s.torque_by_tangential.max(0.0) / model.inertia_kg_m2;
            speed += h * torque / model.inertia_kg_m2 / (1.0 + h * damping);
            let rate = model.flow_acceleration(s.thrust_n, flow, start.ambient_m_s);
            let decay = -s.thrust_by_axial.min(0.0) / model.added_mass_kg;
            flow += h * rate / (1.0 + h * decay);
            *error = (model.load(speed, flow, start.swirl_m_s).thrust_n - thrust_n) * inverse_scale;
        }
        errors[STEPS] = END_WEIGHT * (speed - start.aim_rad_s) / model.speed_max_rad_s;
        errors
    }

    /// One Gauss-Newton step on the two currents.
    fn improve(&mut self, model: &ControlModel, start: &Start, thrust_n: f64) {
        let limit = model.current_limit_a;
        let delta = 1e-3 * limit;
        let base = self.predict(model, start, self.moves, thrust_n);
        let one = self.predict(model, start, [self.moves[0] + delta, self.moves[1]], thrust_n);
        let two = self.predict(model, start, [self.moves[0], self.moves[1] + delta], thrust_n);
        let (mut h11, mut h12, mut h22, mut g1, mut g2) = (0.0, 0.0, 0.0, 0.0, 0.0);
        let scale = limit / delta;
        for k in 0..RESIDUALS {
            let (j1, j2) = ((one[k] - base[k]) * scale, (two[k] - base[k]) * scale);
            h11 += j1 * j1;
            h12 += j1 * j2;
            h22 += j2 * j2;
            g1 += j1 * base[k];
            g2 += j2 * base[k];
        }
        let r = self.effort;
        h11 += r;
        h22 += 0.1 * r;
        g1 += r * (self.moves[0] - self.last_a) / limit;
        let det = h11 * h22 - h12 * h12;
        if det > 0.0 && det.is_finite() {
            let d1 = -(g1 * h22 - g2 * h12) / det * limit;
            let d2 = -(g2 * h11 - g1 * h12) / det * limit;
            let reach = (model.current_rate_a_s * self.step_s * FIRST as f64).min(2.0 * limit);
            self.moves[0] =
                (self.moves[0] + d1).clamp(self.last_a - reach, self.last_a + reach).clamp(-limit, limit);
            // The second move answers for the first one's clamp.
            self.moves[1] = (self.moves[1] + d2).clamp(-limit, limit);
        }
    }

    /// Torque of the first current.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        let (model, estimate) = (input.model, input.estimate);
        let kt = model.torque_constant_nm_a;
        let speed = estimate.shaft_speed_rad_s.value;
        let motor_a = input.measured.current_a.unwrap_or(self.drive_a);
        self.load.tick(model, kt * motor_a, input.speed_rad_s(), input.dt_s);
        let (flow, swirl) = (estimate.flow_m_s.value, estimate.swirl_m_s.value);
        let explained = model.load(input.speed_rad_s(), flow, swirl).torque_n_m;
        let share = input.dt_s / (self.smoothing_s + input.dt_s);
        let bound = 0.3 * kt * model.current_limit_a;
        let surprise = (self.load.torque_n_m - explained).clamp(-bound, bound);
        self.unexplained_n_m += (surprise - self.unexplained_n_m) * share;
        self.aim_rad_s = model.speed_for_thrust_rad_s(input.thrust_n, flow, swirl, self.aim_rad_s);
        let start = Start {
            speed_rad_s: speed,
            flow_m_s: flow,
            ambient_m_s: estimate.ambient_m_s.value,
            swirl_m_s: swirl,
            drive_a: motor_a,
            unexplained_n_m: self.unexplained_n_m,
            aim_rad_s: self.aim_rad_s,
        };
        for _ in 0..self.iterations {
            self.improve(model, &start, input.thrust_n);
        }
        let target = model.map.speed_rad_s(input.thrust_n);
        Demand { torque_n_m: kt * self.moves[0], speed_rad_s: target, limits: LimitSet::default() }
    }

    /// What was applied is what the next prediction starts from.
    pub fn settle(&mut self, applied_n_m: f64, _dt_s: f64) {
        self.last_a = applied_n_m / self.torque_constant_nm_a;
        self.drive_a = self.last_a;
    }
}
