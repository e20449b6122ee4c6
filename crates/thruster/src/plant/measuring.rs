//! The measuring chain: encoder, filters, and what the sensors show, once a tick.

use super::{ANGLE, Balance, Plant, SPEED, Sensed, Tick};
use crate::models::ModelName;
use crate::real::Real;

/// States of the measuring chain.
#[derive(Clone, Copy)]
pub(super) struct Filters<T> {
    pub(super) angle_rad: T,
    pub(super) last_angle_rad: T,
    pub(super) speed_rad_s: T,
    pub(super) thrust_n: T,
    pub(super) last_thrust_n: T,
    pub(super) torque_n_m: T,
    pub(super) last_torque_n_m: T,
}

impl<T: Real> Filters<T> {
    /// At rest.
    pub(super) const fn still() -> Self {
        Self {
            angle_rad: T::ZERO,
            last_angle_rad: T::ZERO,
            speed_rad_s: T::ZERO,
            thrust_n: T::ZERO,
            last_thrust_n: T::ZERO,
            torque_n_m: T::ZERO,
            last_torque_n_m: T::ZERO,
        }
    }
}

impl<T: Real> Plant<T> {
    /// What the sensors show now (without noise).
    pub fn sensed(&self) -> Sensed<T> {
        if self.sense_hooks.is_empty() { self.unhooked_sensed() } else { self.sensed }
    }

    /// Thrust as the stand or hull feels it now, N: the blades', and what acts beside them.
    pub fn net_thrust_n(&self) -> T {
        self.filters.last_thrust_n
    }

    /// The measuring chain, once a tick.
    pub(super) fn observe(&mut self, tick: &Tick, balance: &Balance<T>, filter: bool) {
        let dt = self.tick_s;
        let s = &self.sensors;
        let f = &mut self.filters;
        let mut angle = self.x[ANGLE];
        if let (true, Some(counts)) = (self.quantise_encoder, s.encoder_counts_per_rev) {
            let quantum = std::f64::consts::TAU / counts;
            angle = T::from((angle.re() / quantum).floor() * quantum);
        }
        f.angle_rad = angle;
        if filter {
            // Angle differenced at the control rate, then a first-order filter.
            let raw = (angle - f.last_angle_rad) / dt;
            f.speed_rad_s = match self.decays.speed {
                Some(left) => raw + (f.speed_rad_s - raw) * left,
                _ if s.encoder_counts_per_rev.is_some() => raw,
                _ => self.x[SPEED],
            };
            f.last_angle_rad = angle;
            let (thrust, torque) = (balance.thrust_n + balance.stand_n, balance.blade_torque_n_m);
            f.thrust_n = first_order(f.thrust_n, f.last_thrust_n, thrust, dt, self.decays.thrust);
            f.torque_n_m = first_order(f.torque_n_m, f.last_torque_n_m, torque, dt, self.decays.torque);
            f.last_thrust_n = thrust;
            f.last_torque_n_m = balance.blade_torque_n_m;
        }
        self.supply_v = tick.supply_v.unwrap_or(self.nominal_supply_v);
        self.true_thrust_n = balance.thrust_n;
        if !self.sense_hooks.is_empty() {
            let mut sensed = self.unhooked_sensed();
            let now = Tick { time_s: self.time_s, ..*tick };
            for i in &self.sense_hooks {
                let hooked = &mut self.effects[*i];
                hooked.effect.arrive(&self.at, &self.x[hooked.own.clone()]);
                hooked.effect.sense(&now, &mut sensed);
            }
            self.sensed = sensed;
        }
    }

    /// What the sensors show where no effect is at work on them.
    fn unhooked_sensed(&self) -> Sensed<T> {
        let f = &self.filters;
        Sensed {
            current_a: self.current_a,
            shaft_angle_rad: f.angle_rad,
            shaft_speed_rad_s: f.speed_rad_s,
            thrust_n: f.thrust_n,
            torque_n_m: f.torque_n_m,
            flow_m_s: match self.model {
                ModelName::Model1 => self.constants.yoerger_slip_m * self.at.shaft_speed_rad_s,
                _ => self.at.axial_m_s,
            },
            true_speed_rad_s: self.at.shaft_speed_rad_s,
            true_thrust_n: self.true_thrust_n,
            supply_v: T::from(self.supply_v),
        }
    }
}

/// Exact first-order low pass over one tick whose input runs straight from `u0` to `u1`.
fn first_order<T: Real>(y: T, u0: T, u1: T, dt: f64, filter: Option<(f64, f64)>) -> T {
    let Some((tau, left)) = filter else { return u1 };
    let slope = (u1 - u0) / dt;
    u1 - slope * tau + (y - u0 + slope * tau) * left
}
