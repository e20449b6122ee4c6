//! Luenberger observer of shaft, flow and ambient flow.
//!
//! Reference: after Fossen & Blanke 2000 (flow observer of a three-state thruster); gains from
//! docs/control.md D8. With `e = Om - Om^`, the speed filter carried as a state:
//! `Om^' = (kt im - Q^ - Qf)/I + l1 e`, `v^' = (T^ - dbeta rho a (v^ - va^)|v^|)/m + l2 sgn(Om) e`.
//! Both poles are placed at `-p`, `p` from the lags of the speed measurement:
//! `l2 = T_Om/m + (p - lambda)^2 I/|Q_v|`, scheduled on the slopes; below a tenth of top speed `Q_v`
//! is too small to see the flow by and the observer predicts only. Thrust and flow, where measured,
//! pull `v^` directly; what pulls `v^` for good moves `va^`.
//!
//! Assumes: friction, torque constant and coefficients known: what they hide is taken for flow.
//! Needs measured: shaft speed; current, thrust, flow where there are any.
//! Fails: load torque and ambient flow cannot be told apart and all goes to the flow. Reports no
//! covariance: its standard errors are infinite.

use super::{ObserverInput, ObserverOptions, Water};
use crate::model::ControlModel;
use crate::signals::Estimate;

/// What a correction may be of its sensor's lag: critically damped.
const DAMPED: f64 = 0.25;

/// A running observer.
#[derive(Clone, Copy, Debug)]
pub struct Luenberger {
    water: Water,
    filtered_rad_s: f64,
    /// Expected thrust behind its sensor's filter, N.
    felt_n: f64,
    pole_rad_s: f64,
    options: ObserverOptions,
    started: bool,
}

impl Luenberger {
    /// At rest.
    pub fn new(model: &ControlModel, options: &ObserverOptions) -> Self {
        Self {
            water: Water::default(),
            filtered_rad_s: 0.0,
            felt_n: 0.0,
            pole_rad_s: 0.4 / (model.speed_filter_s + 1.5 * model.period_s + 0.5 * model.amplifier_lag_s),
            options: *options,
            started: false,
        }
    }

    /// This observer has no load state: a load found by another is left to its corrections.
    pub(super) fn start_in(&mut self, water: Water) {
        self.water = Water { load_n_m: 0.0, blade_load_n_m: 0.0, ..water };
        self.filtered_rad_s = water.speed_rad_s;
        self.started = true;
    }

    /// One step.
    pub fn tick(&mut self, input: &ObserverInput) -> Estimate {
        let (model, dt) = (input.model, input.dt_s);
        if !self.started
            && let Some(speed) = input.measured.shaft_speed_rad_s
        {
            self.started = true;
            (self.water.speed_rad_s, self.filtered_rad_s) = (speed, speed);
            self.water.flow_m_s = model.map.flow_m_s(speed);
            self.water.ambient_m_s = model.ambient_mean_m_s;
        }
        let before = self.water.speed_rad_s;
        self.water = self.water.step(model, model.torque_constant_nm_a * input.current_a, dt);
        let filter = model.speed_filter_s + 0.5 * model.period_s;
        self.filtered_rad_s +=
            (0.5 * (before + self.water.speed_rad_s) - self.filtered_rad_s) * dt / (filter + 0.5 * dt);
        self.correct(input);
        self.water = self.water.boxed(model);
        self.water.estimate(model)
    }

    fn correct(&mut self, input: &ObserverInput) {
        let (model, dt) = (input.model, input.dt_s);
        let w = self.water;
        let s = model.slopes(model.blade.inflow(w.speed_rad_s, w.flow_m_s, w.swirl_m_s));
        let lever = model.blade.lever_m();
        let flux = model.flux_coefficient * model.blade.density_kg_m3 * model.blade.area_m2();
        let damping = (2.0 * flux * w.flow_m_s.abs() - s.thrust_by_axial).max(0.0) / model.added_mass_kg;
        let p = self.pole_rad_s.min(0.25 / dt);
        let mut pull = 0.0;
        if let Some(speed) = input.measured.shaft_speed_rad_s {
            let error = speed - self.filtered_rad_s;
            let shaft_damping = lever * s.torque_by_tangential / model.inertia_kg_m2;
            let l1 = (2.0 * p - damping - shaft_damping).max(0.5 * p);
            let coupling = s.torque_by_axial / model.inertia_kg_m2;
            let seen = 0.1 * model.speed_max_rad_s;
            if coupling * w.speed_rad_s.signum() < 0.0 && w.speed_rad_s.abs() > seen && p > damping {
                let weight = ((w.speed_rad_s.abs() - seen) / seen).min(1.0);
                let l2 = weight * (p - damping).powi(2) / coupling.abs();
                pull += l2 * w.speed_rad_s.signum() * error;
            }
            self.water.speed_rad_s += l1 * error * dt;
            // A filter state that never meets its measurement would wind the error up.
            self.filtered_rad_s += p * error * dt;
        }
        self.felt_n += (s.thrust_n - self.felt_n) * dt / (model.thrust_filter_s + dt);
        if let Some(thrust) = input.measured.thrust_n.filter(|_| self.options.use_thrust) {
            let slope = s.thrust_by_axial;
            let scale = model.thrust_max_n / (model.map.flow_m * model.speed_max_rad_s);
            if slope < -0.05 * scale {
                let pole = (0.3 * p).min(DAMPED / model.thrust_filter_s.max(dt));
                pull += pole * ((thrust - self.felt_n) / slope).clamp(-1.0, 1.0);
            }
        }
        if let Some(flow) = input.measured.flow_m_s.filter(|_| self.options.use_flow) {
            pull += (DAMPED / model.late.flow_s.max(dt)).min(1.0) * (flow - w.flow_m_s);
        }
        self.water.flow_m_s += pull * dt;
        match input.measured.ambient_m_s {
            Some(ambient) => self.water.ambient_m_s = ambient,
            None => {
                let forget = dt / self.options.ambient_time_s.max(dt);
                self.water.ambient_m_s +=
                    0.5 * pull * dt - (self.water.ambient_m_s - model.ambient_mean_m_s) * forget;
            }
        }
    }
}
