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
//! Fails: as `model2_inversion` for errors of `v^` and blades; costs a microsecond or two a tick, fixed
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

/// The least-squares problem of one tick, in currents as shares of the limit.
#[derive(Clone, Copy, Debug, Default)]
struct Normal {
    h11: f64,
    h12: f64,
    h22: f64,
    g1: f64,
    g2: f64,
}

impl Normal {
    fn add(&mut self, error: f64, [j1, j2]: [f64; 2]) {
        self.h11 += j1 * j1;
        self.h12 += j1 * j2;
        self.h22 += j2 * j2;
        self.g1 += j1 * error;
        self.g2 += j2 * error;
    }
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

    /// Predicted errors under the two currents and how they depend on them, in one run: the
    /// sensitivities of shaft and flow to each current are carried along with the states.
    fn predict(&self, model: &ControlModel, start: &Start, thrust_n: f64) -> Normal {
        let h = self.step_s;
        let (lever, inertia, mass) = (model.blade.lever_m(), model.inertia_kg_m2, model.added_mass_kg);
        let flux = model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
        let kt = model.torque_constant_nm_a;
        let (mut speed, mut flow, mut current) = (start.speed_rad_s, start.flow_m_s, start.drive_a);
        // By the first and by the second current.
        let (mut d_speed, mut d_flow, mut d_current) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let follow = h / (model.amplifier_lag_s + model.period_s + h);
        let (scale, limit) = (1.0 / model.thrust_max_n, model.current_limit_a);
        let mut normal = Normal::default();
        let mut s = model.slopes(model.blade.inflow(speed, flow, start.swirl_m_s));
        for k in 0..STEPS {
            let active = usize::from(k >= FIRST);
            current += (self.moves[active] - current) * follow;
            let torque = kt * current - s.torque_n_m - model.friction_n_m(speed) - start.unexplained_n_m;
            // Linearly implicit in the shaft's and the flow's own damping: no step is too long.
            let damping = lever * s.torque_by_tangential.max(0.0) / inertia;
            let (by_torque, by_rate) =
                (h / inertia / (1.0 + h * damping), h / (1.0 - h * s.thrust_by_axial.min(0.0) / mass));
            let rate = model.flow_acceleration(s.thrust_n, flow, start.ambient_m_s);
            let outflow = flux * (flow.abs() + (flow - start.ambient_m_s) * flow.signum());
            for j in 0..2 {
                d_current[j] += (f64::from(u8::from(j == active)) - d_current[j]) * follow;
                let d_torque = kt * d_current[j]
                    - (lever * s.torque_by_tangential + model.viscous_friction_nm_s) * d_speed[j]
                    - s.torque_by_axial * d_flow[j];
                let d_thrust = lever * s.thrust_by_tangential * d_speed[j] + s.thrust_by_axial * d_flow[j];
                d_flow[j] += by_rate * (d_thrust - outflow * d_flow[j]) / mass;
                d_speed[j] += by_torque * d_torque;
            }
            speed += by_torque * torque;
            flow += by_rate * rate;
            s = model.slopes(model.blade.inflow(speed, flow, start.swirl_m_s));
            let slope = |j: usize| {
                limit * scale * (lever * s.thrust_by_tangential * d_speed[j] + s.thrust_by_axial * d_flow[j])
            };
            normal.add((s.thrust_n - thrust_n) * scale, [slope(0), slope(1)]);
        }
        let weight = END_WEIGHT / model.speed_max_rad_s;
        normal.add(weight * (speed - start.aim_rad_s), d_speed.map(|d| limit * weight * d));
        normal
    }

    /// One Gauss-Newton step on the two currents.
    fn improve(&mut self, model: &ControlModel, start: &Start, thrust_n: f64) {
        let limit = model.current_limit_a;
        let Normal { mut h11, h12, mut h22, mut g1, g2 } = self.predict(model, start, thrust_n);
        let r = self.effort;
        h11 += r;
        h22 += 0.1 * r;
        g1 += r * (self.moves[0] - self.last_a) / limit;
        let det = h11 * h22 - h12 * h12;
        if det > 0.0 && det.is_finite() {
            let reach = (model.current_rate_a_s * self.step_s * FIRST as f64).min(2.0 * limit);
            let (before, wanted) = (self.moves[0], self.moves[0] - (g1 * h22 - g2 * h12) / det * limit);
            self.moves[0] = wanted.clamp(self.last_a - reach, self.last_a + reach).clamp(-limit, limit);
            // The second is the best beside what its limits leave of the first.
            let first = (self.moves[0] - before) / limit;
            self.moves[1] = (self.moves[1] - (g2 + h12 * first) / h22 * limit).clamp(-limit, limit);
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
