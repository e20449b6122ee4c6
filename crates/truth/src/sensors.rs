//! The measuring chain: encoder counts, speed filter, force filter and converter, flow meter.

use std::f64::consts::TAU;

use crate::machine::{Machine, Sensors};
use crate::memory::Lag;
use crate::physics::{Now, Physics, Reading};

/// States of the chain between ticks.
pub struct Chain {
    sensors: Sensors,
    quantise: bool,
    last_angle_rad: Option<f64>,
    speed: Lag,
    force: Lag,
    torque: Lag,
}

impl Chain {
    /// At rest; `quantise` turns encoder counts and converter steps on.
    pub fn new(machine: &Machine, quantise: bool) -> Self {
        Chain {
            sensors: machine.sensors,
            quantise,
            last_angle_rad: None,
            speed: Lag::default(),
            force: Lag::default(),
            torque: Lag::default(),
        }
    }

    /// The analogue filters follow force and torque over an integration step.
    pub fn follow(&mut self, force_n: f64, torque_n_m: f64, step_s: f64) {
        self.force.follow(force_n, 1.0 / (TAU * self.sensors.thrust_filter_hz), step_s);
        self.torque.follow(torque_n_m, 1.0 / (TAU * self.sensors.torque_filter_hz), step_s);
    }

    /// Reads at a tick; effects and noise act on the way.
    pub fn read(&mut self, now: &Now, supply_v: f64, physics: &mut [Box<dyn Physics>]) -> Reading {
        let tick_s = self.sensors.tick_s;
        let mut angle_rad = now.angle_rad;
        for each in physics.iter_mut() {
            each.encoder(now, &mut angle_rad);
        }
        if self.quantise {
            let count = TAU / self.sensors.encoder_counts;
            angle_rad = (angle_rad / count).floor() * count;
        }
        let difference = (angle_rad - self.last_angle_rad.unwrap_or(angle_rad)) / tick_s;
        self.last_angle_rad = Some(angle_rad);
        // A tachometer sees the speed itself, through the same filter.
        let seen = if self.sensors.tachometer_noise > 0.0 { now.speed_rad_s } else { difference };
        let mut reading = Reading {
            angle_rad,
            speed_rad_s: self.speed.follow(seen, self.sensors.speed_filter_s, tick_s),
            thrust_n: self.force.value,
            torque_n_m: self.torque.value,
            flow_m_s: now.flow_m_s,
            current_a: now.current_a,
            supply_v,
        };
        for each in physics.iter_mut() {
            each.sense(now, &mut reading, tick_s);
        }
        if self.quantise && now.machine.wet() {
            reading.thrust_n = self.convert(reading.thrust_n);
        }
        reading
    }

    /// The converter over plus and minus full scale.
    fn convert(&self, thrust_n: f64) -> f64 {
        let half = f64::from(1u32 << (self.sensors.thrust_bits - 1));
        let step = self.sensors.thrust_full_scale_n / half;
        (thrust_n / step).round().clamp(-half, half - 1.0) * step + 0.0
    }
}
