//! The part of the sensor chain that runs on the control tick: encoder, speed filter, late clocks,
//! play of the force sensor.

use crate::dynamics::{At, State};
use crate::hidden::{Hidden, SkewChannel};
use std::collections::VecDeque;
use std::f64::consts::TAU;

/// Control period, s.
pub const TICK_S: f64 = 0.002;
/// Encoder counts in a revolution.
pub const ENCODER_COUNTS: f64 = 4096.0;
/// Time constant of the stated speed filter, s.
pub const SPEED_FILTER_S: f64 = 0.010;
/// Ticks that a late clock may reach back.
const MEMORY: usize = 120;

/// What the sensors show at a tick, before white noise.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Unwrapped shaft angle, rad.
    pub angle_rad: f64,
    /// Shaft speed, rad/s.
    pub speed_rad_s: f64,
    /// Thrust, N.
    pub thrust_n: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
}

/// Sensor states between ticks.
pub struct Chain<'a> {
    hidden: &'a Hidden,
    quantise: bool,
    last_angle_rad: Option<f64>,
    filtered_speed: f64,
    played_thrust: f64,
    history: VecDeque<Reading>,
}

impl<'a> Chain<'a> {
    /// A chain at rest; `quantise` turns the encoder's counts on.
    pub fn new(hidden: &'a Hidden, quantise: bool) -> Self {
        let history = VecDeque::with_capacity(MEMORY + 1);
        Chain { hidden, quantise, last_angle_rad: None, filtered_speed: 0.0, played_thrust: 0.0, history }
    }

    /// Samples the state at a tick.
    pub fn tick(&mut self, state: &State, time_s: f64) -> Reading {
        let h = self.hidden;
        let mut angle_rad = state.get(At::Angle);
        if h.encoder_error_rad != 0.0 {
            angle_rad += h.encoder_error_rad
                * ((h.encoder_order * angle_rad + h.encoder_phase_rad).cos() - h.encoder_phase_rad.cos());
        }
        if self.quantise {
            angle_rad = (angle_rad * ENCODER_COUNTS / TAU).floor() * TAU / ENCODER_COUNTS;
        }
        let difference = (angle_rad - self.last_angle_rad.unwrap_or(angle_rad)) / TICK_S;
        self.last_angle_rad = Some(angle_rad);
        let share = 1.0 - (-TICK_S / (SPEED_FILTER_S + h.speed_lag_s)).exp();
        self.filtered_speed += share * (difference - self.filtered_speed);

        let mut thrust = state.get(At::FilteredThrust);
        if h.thrust_play_n > 0.0 {
            self.played_thrust = self.played_thrust.clamp(thrust - h.thrust_play_n, thrust + h.thrust_play_n);
            thrust = self.played_thrust;
        }
        let flow = if h.flow_distance_m > 0.0 { state.get(At::MeterFlow) } else { state.get(At::Flow) };
        let reading = Reading {
            angle_rad,
            speed_rad_s: self.filtered_speed,
            thrust_n: (1.0 + h.thrust_gain) * thrust + h.thrust_bias_n,
            flow_m_s: (1.0 + h.flow_gain) * flow + h.flow_bias_m_s,
        };
        self.late(reading, time_s)
    }

    /// Replaces the channel with the late clock by what it showed earlier.
    fn late(&mut self, now: Reading, time_s: f64) -> Reading {
        let lateness_s = self.hidden.skew_s + self.hidden.skew_drift * time_s;
        if lateness_s <= 0.0 {
            return now;
        }
        self.history.push_front(now);
        self.history.truncate(MEMORY);
        let back = (lateness_s / TICK_S).min((MEMORY - 2) as f64);
        let (whole, part) = (back.floor() as usize, back.fract());
        let at = |index: usize| self.history.get(index).or(self.history.back()).copied().unwrap_or(now);
        let (a, b) = (at(whole), at(whole + 1));
        let mix = |x: f64, y: f64| x + part * (y - x);
        match self.hidden.skew_channel {
            SkewChannel::Thrust => Reading { thrust_n: mix(a.thrust_n, b.thrust_n), ..now },
            SkewChannel::Flow => Reading { flow_m_s: mix(a.flow_m_s, b.flow_m_s), ..now },
            SkewChannel::Speed => {
                Reading { speed_rad_s: mix(a.speed_rad_s, b.speed_rad_s), angle_rad: a.angle_rad, ..now }
            }
        }
    }
}
