//! Load-torque observer: what the water asks of the shaft, without a model of the water.
//!
//! Reference: Smogeli 2006; docs/control.md D7: `Om^' = (tau - Q^ - Qf)/I + l1 e`, `Q^' = -l2 e`,
//! `e = Om - Om^`; a shaft that spins faster than expected carries less load. The poles lie five
//! times slower than the speed filter, which is not modelled.
//!
//! Assumes: inertia, torque constant and friction known; the load changes slower than the observer.
//! Needs measured: shaft speed; motor torque measured or commanded.
//! Fails: slower than the load it watches; friction and torque-constant errors count as load.

use crate::model::ControlModel;

/// A running load observer.
#[derive(Clone, Copy, Debug)]
pub struct LoadTorque {
    pole_rad_s: f64,
    speed_rad_s: f64,
    /// Estimated blade torque, N m; positive opposes positive shaft speed.
    pub torque_n_m: f64,
    started: bool,
}

impl LoadTorque {
    /// At rest.
    pub fn new(model: &ControlModel) -> Self {
        let pole = 0.2 / (model.speed_filter_s + model.amplifier_lag_s + 1.5 * model.period_s);
        Self { pole_rad_s: pole, speed_rad_s: 0.0, torque_n_m: 0.0, started: false }
    }

    /// One step with the motor's torque and the measured speed.
    pub fn tick(&mut self, model: &ControlModel, torque_n_m: f64, speed_rad_s: f64, dt_s: f64) {
        if !self.started {
            self.started = true;
            // Taken up under way, the shaft is most likely in balance: no load at all would look like lost water.
            (self.speed_rad_s, self.torque_n_m) = (speed_rad_s, torque_n_m - model.friction_n_m(speed_rad_s));
        }
        let inertia = model.inertia_kg_m2;
        // An explicit step: the pole stays well inside what the period can carry.
        let pole = self.pole_rad_s.min(0.3 / dt_s);
        let error = speed_rad_s - self.speed_rad_s;
        let friction = model.friction_n_m(speed_rad_s);
        let acceleration = (torque_n_m - self.torque_n_m - friction) / inertia + 2.0 * pole * error;
        self.torque_n_m -= pole * pole * inertia * error * dt_s;
        self.speed_rad_s += acceleration * dt_s;
    }
}
