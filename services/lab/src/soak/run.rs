//! One controller through one scenario with one seed, on virtual time.

use std::collections::HashMap;

use kort_control::{ControllerConfig, Limit, ModelError};
use kort_proto::signals::Signals;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::chain::Chain;
use super::reference::{Player, Replayed};
use super::scenario::{Channel, Lie, ProcessFault, ProcessFaultKind, Scenario, is_on};
use super::score::{Outcome, Sample, Tally};
use super::sea::{Now, STEP_S, Sea};
use super::truth;

/// What every run of a scenario shares.
pub struct Prepared<'a> {
    /// The scenario.
    pub scenario: &'a Scenario,
    /// The rig as stated.
    pub rig: &'a Rig,
    /// The effects at work.
    pub effects: &'a [truth::Hooked],
    /// Recordings to replay, by segment.
    pub replayed: &'a [Option<Replayed>],
    /// Largest steady thrust that a share of 1 stands for, N.
    pub thrust_max_n: f64,
}

/// What the controller is told of the thruster.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Knows {
    /// What the rig states.
    Stated,
    /// What is true after the last change of the scenario, which is then true from the start.
    Truth,
}

/// Told now and then how far a run is: share done, thrust RMS so far, energy so far.
pub type Progress<'a> = &'a (dyn Fn(f64, f64, f64) + Sync);

/// Runs and scores.
///
/// # Errors
/// [`ModelError`] if no controller can be designed for the rig.
pub fn run(
    prepared: &Prepared,
    config: &ControllerConfig,
    seed: u64,
    knows: Knows,
    progress: Progress,
) -> Result<Outcome, ModelError> {
    Bench::new(prepared, config, seed, knows)?.run(progress)
}

/// A stream of random numbers of its own for each purpose, so that a law that draws none changes
/// nothing for the others: all laws meet the same sea.
pub(super) fn stream(seed: u64, purpose: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(purpose);
    random
}

struct Bench<'a> {
    prepared: &'a Prepared<'a>,
    dt: f64,
    chain: Chain,
    plant: Plant,
    truth: Parameters,
    knows: Knows,
    seed: u64,
    noise: ChaCha8Rng,
    held_flow_m_s: Option<f64>,
    held: [Option<f64>; 4],
    flow_due_s: f64,
    /// End of the newest fault that the scenario put in, s.
    fault_until_s: f64,
    down: bool,
    injected: u32,
    survived: u32,
    /// A fault whose recovery is awaited: until when, s.
    awaited_s: Option<f64>,
}

impl<'a> Bench<'a> {
    fn new(
        prepared: &'a Prepared<'a>,
        config: &ControllerConfig,
        seed: u64,
        knows: Knows,
    ) -> Result<Self, ModelError> {
        let dt = 1.0 / prepared.scenario.control_rate_hz;
        let mut parameters = truth::parameters(prepared, seed);
        let chain = match knows {
            Knows::Stated => Chain::new(prepared.rig, config, dt)?,
            Knows::Truth => {
                for change in &prepared.scenario.truth.change {
                    truth::change(&mut parameters, &change.factors);
                }
                Chain::new(&truth::told(prepared.rig, &parameters), config, dt)?
            }
        };
        Ok(Self {
            prepared,
            dt,
            plant: truth::plant(prepared, &parameters, dt),
            truth: parameters,
            knows,
            chain,
            seed,
            noise: stream(seed, 3),
            held_flow_m_s: None,
            held: [None; 4],
            flow_due_s: 0.0,
            fault_until_s: f64::NEG_INFINITY,
            down: false,
            injected: 0,
            survived: 0,
            awaited_s: None,
        })
    }

    fn run(mut self, progress: Progress) -> Result<Outcome, ModelError> {
        let scenario = self.prepared.scenario;
        let rig = self.prepared.rig;
        let scale = self.prepared.thrust_max_n;
        let mut player = Player::new(&scenario.references, self.prepared.replayed, stream(self.seed, 1));
        let mut sea = Sea::new(
            &scenario.ambient,
            scenario.depth,
            &scenario.supply_sags,
            rig.amplifier.supply_v,
            stream(self.seed, 2),
        );
        let mut tally = Tally::new(self.dt, rig, scale, scenario.settle_s);
        let ticks = (scenario.duration_s / self.dt).round() as u64;
        let (mut sea_from, mut sea_to) = (Now::default(), sea.at(0.0));
        let mut sea_time = -STEP_S;
        let changes = if self.knows == Knows::Stated { scenario.truth.change.as_slice() } else { &[] };
        let mut changes = changes.iter().peekable();
        let report_every = (ticks / 200).max(1);
        for k in 0..ticks {
            let time = k as f64 * self.dt;
            if time >= sea_time + STEP_S {
                sea_time += STEP_S;
                sea_from = sea_to;
                sea_to = sea.at(sea_time + STEP_S);
            }
            if let Some(change) = changes.next_if(|c| time >= c.at_s) {
                self.change(&change.factors);
            }
            let reference_n = scale * player.next(self.dt);
            let sample = self.tick(time, reference_n, (&sea_from, &sea_to), (time - sea_time) / STEP_S);
            tally.tick(&sample);
            if k % report_every == 0 {
                progress(k as f64 / ticks as f64, tally.rms_n(), tally.energy_j());
            }
        }
        if self.awaited_s.take().is_some() {
            self.injected -= 1;
        }
        let mut extra = vec![
            ("faults_injected", f64::from(self.injected)),
            ("faults_survived", f64::from(self.survived)),
            ("trips", f64::from(self.chain.trips())),
        ];
        if self.chain.controller().config().estimator != kort_control::EstimatorKind::Off {
            extra.push(("parameter_error", self.parameter_error()));
        }
        progress(1.0, tally.rms_n(), tally.energy_j());
        Ok(tally.finish(&extra))
    }

    fn tick(&mut self, time: f64, reference_n: f64, sea: (&Now, &Now), part: f64) -> Sample {
        let alive = self.process_faults(time);
        let measured = self.measure(time, sea.0);
        let driven = self.chain.tick(&measured, reference_n, alive);
        let next = part + self.dt / STEP_S;
        let mix = |p: f64| sea.0.ambient_m_s + (sea.1.ambient_m_s - sea.0.ambient_m_s) * p.min(1.0);
        let depth = sea.0.depth_m.zip(sea.1.depth_m).map(|(a, b)| a + (b - a) * part);
        self.plant.step(&Tick {
            time_s: time,
            command: driven.command,
            ambient_m_s: (mix(part), mix(next)),
            supply_v: sea.0.supply_v,
            depth_m: depth,
            ..Tick::default()
        });
        let truth = *self.plant.truth();
        let sample = Sample {
            time_s: time,
            reference_n,
            thrust_n: truth.thrust_n,
            shaft_speed_rad_s: truth.shaft_speed_rad_s,
            current_a: truth.current_a,
            flow_m_s: truth.axial_m_s,
            ambient_m_s: truth.ambient_m_s,
            flow_estimate_m_s: self.chain.output().estimate.flow_m_s.value,
            saturated: self.saturated(),
            broken: self.broken(driven.command, truth.shaft_speed_rad_s),
            // Off for a fault that was put in; a trip of the law's own making counts.
            excused: !driven.armed && time < self.fault_until_s.max(0.0) + 1.0,
        };
        self.recovery(&sample);
        sample
    }

    fn saturated(&self) -> bool {
        let limits = self.chain.output().limits;
        [Limit::Current, Limit::Voltage, Limit::ShaftSpeed, Limit::CurrentRate]
            .iter()
            .any(|l| limits.contains(*l))
    }

    /// Beyond what the rig allows: never the law's to decide.
    fn broken(&self, command: f64, speed_rad_s: f64) -> bool {
        let model = self.chain.controller().nominal();
        let most = match model.amplifier {
            AmplifierKind::Current => model.current_limit_a,
            AmplifierKind::Voltage => model.supply_v.unwrap_or(f64::INFINITY),
            AmplifierKind::Speed => model.speed_max_rad_s,
        };
        !command.is_finite()
            || command.abs() > most * (1.0 + 1e-9)
            || speed_rad_s.abs() > 1.75 * 1.15 * model.speed_max_rad_s
    }

    /// Whether the controller ticks now.
    fn process_faults(&mut self, time: f64) -> bool {
        let on = |f: &&ProcessFault| is_on(f.at_s, f.for_s, f.every_s, time);
        let fault = self.prepared.scenario.process_faults.iter().find(on);
        let began = fault.is_some() && !self.down;
        self.down = fault.is_some();
        if let (true, Some(fault)) = (began, fault) {
            self.inject(time + fault.for_s);
            if fault.kind == ProcessFaultKind::ControllerRestart {
                self.chain.restart();
            }
        }
        !self.down
    }

    fn inject(&mut self, until_s: f64) {
        self.injected += 1;
        self.fault_until_s = until_s;
        self.awaited_s = Some(until_s);
    }

    /// A fault is survived if within ten seconds of its end thrust comes within a tenth of full scale.
    fn recovery(&mut self, s: &Sample) {
        let Some(since) = self.awaited_s.map(|end| s.time_s - end).filter(|since| *since > 0.0) else {
            return;
        };
        if !s.excused && (s.thrust_n - s.reference_n).abs() < 0.1 * self.prepared.thrust_max_n {
            self.survived += 1;
            self.awaited_s = None;
        } else if since > 10.0 {
            self.awaited_s = None;
        }
    }

    fn change(&mut self, factors: &HashMap<Parameter, f64>) {
        truth::change(&mut self.truth, factors);
        let (at, sensed) = (*self.plant.truth(), self.plant.sensed());
        self.plant = truth::plant(self.prepared, &self.truth, self.dt);
        self.plant.start(at.time_s, at.shaft_speed_rad_s, at.axial_m_s, sensed.current_a, at.shaft_angle_rad);
    }

    fn normal(&mut self) -> f64 {
        StandardNormal.sample(&mut self.noise)
    }

    /// Sensors with noise, then with what is wrong with them.
    fn measure(&mut self, time: f64, sea: &Now) -> Signals {
        let scenario = self.prepared.scenario;
        let (noise, fitted, rig) = (&scenario.noise, &scenario.sensors, self.prepared.rig);
        let model = self.chain.controller().nominal();
        let (scale_n, limit_a, quantum_n) =
            (self.prepared.thrust_max_n, model.current_limit_a, model.thrust_quantum_n);
        let s = self.plant.sensed();
        let speed_drive = rig.amplifier.kind == AmplifierKind::Speed;
        let mut channels = [Some(s.shaft_speed_rad_s), None, None, None];
        if fitted.current && !speed_drive {
            channels[1] = Some(s.current_a + noise.current * limit_a * self.normal());
        }
        if fitted.thrust {
            let raw = s.thrust_n + noise.thrust * scale_n * self.normal();
            channels[2] = Some(if quantum_n > 0.0 { (raw / quantum_n).round() * quantum_n } else { raw });
        }
        if fitted.flow {
            if time + 1e-9 >= self.flow_due_s {
                self.flow_due_s += rig.sensors.flow_rate_hz.map_or(self.dt, |f| 1.0 / f);
                self.held_flow_m_s =
                    Some(s.flow_m_s * (1.0 + noise.flow * self.normal()) + 0.01 * self.normal());
            }
            channels[3] = self.held_flow_m_s;
        }
        if !scenario.sensor_faults.is_empty() {
            self.lie(time, &mut channels, [model_speed(&self.chain), limit_a, scale_n, 2.0]);
        }
        self.held = channels;
        let or_nan = |value: Option<f64>| value.unwrap_or(f64::NAN);
        Signals {
            shaft_angle_rad: s.shaft_angle_rad,
            shaft_speed_rad_s: or_nan(channels[0]),
            current_a: or_nan(channels[1]),
            thrust_n: or_nan(channels[2]),
            flow_m_s: or_nan(channels[3]),
            ambient_m_s: if fitted.ambient { sea.ambient_m_s } else { f64::NAN },
            supply_v: or_nan(sea.supply_v),
            ..Signals::UNKNOWN
        }
    }

    fn lie(&mut self, time: f64, channels: &mut [Option<f64>; 4], scales: [f64; 4]) {
        for fault in &self.prepared.scenario.sensor_faults {
            let i = match fault.channel {
                Channel::ShaftSpeedRadS => 0,
                Channel::CurrentA => 1,
                Channel::ThrustN => 2,
                Channel::FlowMS => 3,
            };
            if !is_on(fault.at_s, fault.for_s, fault.every_s, time) {
                continue;
            }
            if !is_on(fault.at_s, fault.for_s, fault.every_s, time - self.dt) {
                self.inject(time + fault.for_s);
            }
            let size = fault.size.unwrap_or(0.0);
            let spike = if self.noise_share() < 0.05 { size * scales[i] } else { 0.0 };
            channels[i] = match fault.lie {
                Lie::Dropout => None,
                Lie::Stuck => self.held[i],
                Lie::Bias => channels[i].map(|x| x + size * scales[i]),
                Lie::Gain => channels[i].map(|x| x * size),
                Lie::Spikes => channels[i].map(|x| x + spike),
            };
        }
    }

    fn noise_share(&mut self) -> f64 {
        use rand::Rng;
        self.noise.random()
    }

    fn parameter_error(&self) -> f64 {
        let model = self.chain.controller().model();
        // The flux coefficient is learnt where both sensors are fitted.
        let sensors = &self.prepared.scenario.sensors;
        let flux = sensors.flow && sensors.thrust;
        let pairs = [
            (model.blade.lift_max, Parameter::LiftMax),
            (model.blade.drag_max, Parameter::DragMax),
            (model.flux_coefficient, Parameter::FluxCoefficient),
        ];
        pairs[..if flux { 3 } else { 2 }]
            .iter()
            .map(|(found, parameter)| (found / self.truth.get(*parameter) - 1.0).abs())
            .fold(0.0, f64::max)
    }
}

fn model_speed(chain: &Chain) -> f64 {
    chain.controller().nominal().speed_max_rad_s
}
