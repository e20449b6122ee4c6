//! Model 2 inversion trimmed by the force sensor.
//!
//! Reference: docs/control.md D5, last sentence. A slow integral of `Td - T` moves the reference that
//! `model2_inversion` is given; the model gives the transient, the sensor the level. The bandwidth is
//! a fraction of the servo's crossover (a fifth at most) and must stay below the stand's lowest
//! resonance.
//!
//! Assumes: as `model2_inversion`; a calibrated force sensor.
//! Needs measured: shaft speed and thrust. Without thrust the trim fades and leaves the model alone; a
//! reading that the observer rejects (a sensor that stands still just before it is declared gone) is
//! not learnt from.
//!
//! Fails: sensor bias and gain are thrust errors one to one, up to the trim's authority.

use serde::{Deserialize, Serialize};

use super::lead::Pace;
use super::model2_inversion::Model2Inversion;
use super::speed_loop::{MatchedTarget, ServoOptions};
use super::{Demand, LawInput};
use crate::limits::{Integrator, Limit};
use crate::model::ControlModel;

/// Options of the trim.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrimOptions {
    /// Bandwidth as a fraction of the servo's crossover.
    pub bandwidth_fraction: f64,
    /// Largest trim as a share of the largest steady thrust.
    pub authority: f64,
}

impl Default for TrimOptions {
    fn default() -> Self {
        Self { bandwidth_fraction: 0.2, authority: 0.4 }
    }
}

/// Time in which the trim fades without its sensor, s.
const FADE_S: f64 = 1.0;

/// A running trimmed inversion.
#[derive(Clone, Copy, Debug)]
pub struct TrimmedModel2Inversion {
    inner: Model2Inversion,
    matched: MatchedTarget,
    bandwidth_rad_s: f64,
    authority: f64,
    trim: Integrator,
    asked_n_m: f64,
    limited: bool,
    gated: u64,
    began: bool,
}

impl TrimmedModel2Inversion {
    /// At rest.
    pub fn new(model: &ControlModel, servo: &ServoOptions, options: &TrimOptions) -> Self {
        let (crossover, _) = model.speed_loop(servo.phase_margin_deg.to_radians());
        Self {
            inner: Model2Inversion::new(model, servo),
            matched: MatchedTarget::of_thrust(model, Pace::of(model).shaft_per_s),
            // A trim behind a slow force sensor is critically damped at most.
            bandwidth_rad_s: (options.bandwidth_fraction.min(0.2) * crossover)
                .min(0.25 / model.thrust_filter_s.max(model.period_s)),
            authority: options.authority,
            trim: Integrator::default(),
            asked_n_m: 0.0,
            limited: false,
            gated: 0,
            began: false,
        }
    }

    /// Torque of the inverted model at the trimmed reference.
    pub fn tick(&mut self, input: &LawInput) -> Demand {
        if !std::mem::replace(&mut self.began, true) {
            // What is expected rises from the thrust that is there: one from nothing would be learnt as a surplus of all of it.
            self.matched.reset(input.measured.thrust_n.unwrap_or(input.thrust_n));
        }
        let expected = self.matched.step(input.thrust_n, input.dt_s);
        let rejected = input.estimate.gated != std::mem::replace(&mut self.gated, input.estimate.gated);
        let mut at_authority = false;
        match input.measured.thrust_n {
            None => self.trim.fade(FADE_S, input.dt_s),
            Some(thrust) if !self.limited && !rejected => {
                let most = self.authority * input.model.thrust_max_n;
                at_authority = self.trim.step(self.bandwidth_rad_s * (expected - thrust), most, input.dt_s);
            }
            Some(_) => {}
        }
        let mut demand = self.inner.tick(&LawInput { thrust_n: input.thrust_n + self.trim.state, ..*input });
        if at_authority {
            demand.limits.set(Limit::Trim);
        }
        self.asked_n_m = demand.torque_n_m;
        demand
    }

    /// The trim holds while a limit is in force.
    pub fn settle(&mut self, applied_n_m: f64, dt_s: f64) {
        let scale = 1e-3 * (self.asked_n_m.abs() + applied_n_m.abs());
        self.limited = (self.asked_n_m - applied_n_m).abs() > scale;
        self.inner.settle(applied_n_m, dt_s);
    }
}
