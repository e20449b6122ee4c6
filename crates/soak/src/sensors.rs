//! The sensors of a run: noise, the rates they sample at, and how they lie.

use kort_control::ControlModel;
use kort_proto::signals::Signals;
use kort_thruster::plant::Sensed;
use kort_thruster::rig::{AmplifierKind, Rig};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scenario::{Channel, Lie, Scenario, is_on};
use crate::sea::Now;

/// Full scale of a flow meter's lie, m/s.
const FLOW_SCALE_M_S: f64 = 2.0;
/// Share of the readings that a spiking sensor spoils.
const SPIKING: f64 = 0.05;
/// Noise of a flow meter at rest, m/s.
const FLOW_NOISE_M_S: f64 = 0.01;

/// The sensors.
pub struct Sensors<'a> {
    scenario: &'a Scenario,
    rig: &'a Rig,
    dt_s: f64,
    /// Full scales: shaft speed, current, thrust, flow.
    scales: [f64; 4],
    current_limit_a: f64,
    thrust_quantum_n: f64,
    noise: ChaCha8Rng,
    held_flow_m_s: Option<f64>,
    held: [Option<f64>; 4],
    flow_due_s: f64,
}

impl<'a> Sensors<'a> {
    /// As the rig has them and the scenario fits them; noise is a stream of random numbers of its own.
    pub fn new(scenario: &'a Scenario, rig: &'a Rig, model: &ControlModel, noise: ChaCha8Rng) -> Self {
        Self {
            scenario,
            rig,
            dt_s: 1.0 / scenario.control_rate_hz,
            scales: [model.speed_max_rad_s, model.current_limit_a, model.thrust_max_n, FLOW_SCALE_M_S],
            current_limit_a: model.current_limit_a,
            thrust_quantum_n: model.thrust_quantum_n,
            noise,
            held_flow_m_s: None,
            held: [None; 4],
            flow_due_s: 0.0,
        }
    }

    /// What is measured now. `fault` is told the end, s, of every lie that begins.
    pub fn measure(&mut self, time_s: f64, at: &Sensed, sea: &Now, mut fault: impl FnMut(f64)) -> Signals {
        let (noise, fitted) = (&self.scenario.noise, &self.scenario.sensors);
        let speed_drive = self.rig.amplifier.kind == AmplifierKind::Speed;
        let mut channels = [Some(at.shaft_speed_rad_s), None, None, None];
        if fitted.current && !speed_drive {
            channels[1] = Some(at.current_a + noise.current * self.current_limit_a * normal(&mut self.noise));
        }
        if fitted.thrust && self.rig.sensors.thrust_sensor {
            let raw = at.thrust_n + noise.thrust * self.scales[2] * normal(&mut self.noise);
            let quantum = self.thrust_quantum_n;
            channels[2] = Some(if quantum > 0.0 { (raw / quantum).round() * quantum } else { raw });
        }
        if fitted.flow && self.rig.sensors.flow_meter {
            if time_s + 1e-9 >= self.flow_due_s {
                self.flow_due_s += self.rig.sensors.flow_rate_hz.map_or(self.dt_s, |f| 1.0 / f);
                let turbulent = at.flow_m_s * (1.0 + noise.flow * normal(&mut self.noise));
                self.held_flow_m_s = Some(turbulent + FLOW_NOISE_M_S * normal(&mut self.noise));
            }
            channels[3] = self.held_flow_m_s;
        }
        self.lie(time_s, &mut channels, &mut fault);
        self.held = channels;
        let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
        Signals {
            shaft_angle_rad: at.shaft_angle_rad,
            shaft_speed_rad_s: or_nan(channels[0]),
            current_a: or_nan(channels[1]),
            thrust_n: or_nan(channels[2]),
            flow_m_s: or_nan(channels[3]),
            ambient_m_s: if fitted.ambient { sea.ambient_m_s } else { f64::NAN },
            supply_v: or_nan(sea.supply_v),
            ..Signals::UNKNOWN
        }
    }

    fn lie(&mut self, time_s: f64, channels: &mut [Option<f64>; 4], fault: &mut impl FnMut(f64)) {
        for lie in &self.scenario.sensor_faults {
            let on = |time_s| is_on(lie.at_s, lie.for_s, lie.every_s, time_s);
            if !on(time_s) {
                continue;
            }
            if !on(time_s - self.dt_s) {
                fault(time_s + lie.for_s);
            }
            let i = match lie.channel {
                Channel::ShaftSpeedRadS => 0,
                Channel::CurrentA => 1,
                Channel::ThrustN => 2,
                Channel::FlowMS => 3,
            };
            let (value, size) = (channels[i], lie.size.unwrap_or(0.0));
            channels[i] = match lie.lie {
                Lie::Dropout => None,
                Lie::Stuck => self.held[i],
                Lie::Bias => value.map(|x| x + size * self.scales[i]),
                Lie::Gain => value.map(|x| x * size),
                Lie::Spikes => {
                    let spike =
                        if self.noise.random::<f64>() < SPIKING { size * self.scales[i] } else { 0.0 };
                    value.map(|x| x + spike)
                }
            };
        }
    }
}

fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}
