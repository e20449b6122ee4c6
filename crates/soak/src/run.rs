//! One controller through one scenario with one seed, on virtual time.

use kort_control::{ControllerConfig, Limit, ModelError};
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::Plant;
use kort_thruster::rig::{AmplifierKind, Rig};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::chain::Chain;
use crate::faults::{Faults, Process};
use crate::log::Log;
use crate::reference::Replayed;
use crate::scenario::Scenario;
use crate::score::{Outcome, Sample, Tally};
use crate::script::{Moment, Script};
use crate::sensors::Sensors;
use crate::truth;

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
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Knows<'a> {
    /// What the rig states.
    Stated,
    /// What another description of the rig states.
    Rig(&'a Rig),
    /// What is true after the last change of the scenario, which is then true from the start.
    Truth,
}

/// Told now and then how far a run is: share done, thrust RMS so far, energy so far.
pub type Progress<'a> = &'a (dyn Fn(f64, f64, f64) + Sync);

/// Runs and scores.
///
/// # Errors
/// [`ModelError`] if no controller can be designed for the rig.
pub fn run<C: Chain>(
    prepared: &Prepared,
    config: &ControllerConfig,
    seed: u64,
    knows: Knows,
    progress: Progress,
) -> Result<Outcome, ModelError> {
    Bench::<C>::new(prepared, config, seed, knows)?.run(progress, None)
}

/// Runs, scores, and keeps a recording.
///
/// # Errors
/// [`ModelError`] if no controller can be designed for the rig.
pub fn run_logged<C: Chain>(
    prepared: &Prepared,
    config: &ControllerConfig,
    seed: u64,
    knows: Knows,
    log: &mut Log,
) -> Result<Outcome, ModelError> {
    Bench::<C>::new(prepared, config, seed, knows)?.run(&|_, _, _| (), Some(log))
}

/// A stream of random numbers of its own for each purpose, so that a law that draws none changes
/// nothing for the others: all laws meet the same sea.
pub fn stream(seed: u64, purpose: u64) -> ChaCha8Rng {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    random.set_stream(purpose);
    random
}

struct Bench<'a, C> {
    prepared: &'a Prepared<'a>,
    dt: f64,
    chain: C,
    plant: Plant,
    truth: Parameters,
    knows: Knows<'a>,
    seed: u64,
    sensors: Sensors<'a>,
    faults: Faults<'a>,
}

impl<'a, C: Chain> Bench<'a, C> {
    fn new(
        prepared: &'a Prepared<'a>,
        config: &ControllerConfig,
        seed: u64,
        knows: Knows<'a>,
    ) -> Result<Self, ModelError> {
        let scenario = prepared.scenario;
        let dt = 1.0 / scenario.control_rate_hz;
        let mut parameters = truth::parameters(prepared, seed);
        let chain = match knows {
            Knows::Stated => C::start(prepared.rig, config, dt)?,
            Knows::Rig(rig) => C::start(rig, config, dt)?,
            Knows::Truth => {
                for change in &scenario.truth.change {
                    truth::change(&mut parameters, &change.factors);
                }
                C::start(&truth::told(prepared.rig, &parameters), config, dt)?
            }
        };
        Ok(Self {
            prepared,
            dt,
            plant: truth::plant(prepared, &parameters, dt),
            truth: parameters,
            knows,
            seed,
            sensors: Sensors::new(scenario, prepared.rig, chain.controller().nominal(), stream(seed, 3)),
            faults: Faults::new(&scenario.process_faults),
            chain,
        })
    }

    fn run(mut self, progress: Progress, mut log: Option<&mut Log>) -> Result<Outcome, ModelError> {
        let (prepared, scenario) = (self.prepared, self.prepared.scenario);
        let mut script = Script::new(prepared, self.seed);
        let mut tally = Tally::new(self.dt, prepared.rig, prepared.thrust_max_n, scenario.settle_s);
        let ticks = (scenario.duration_s / self.dt).round() as u64;
        let changes = if self.knows == Knows::Truth { &[] } else { scenario.truth.change.as_slice() };
        let mut changes = changes.iter().peekable();
        let report_every = (ticks / 200).max(1);
        for k in 0..ticks {
            let moment = script.next(k as f64 * self.dt);
            if let Some(change) = changes.next_if(|c| moment.time_s >= c.at_s) {
                truth::change(&mut self.truth, &change.factors);
                self.plant = truth::changed(prepared, &self.truth, &self.plant, self.dt);
            }
            tally.tick(&self.tick(&moment, log.as_deref_mut()));
            if k % report_every == 0 {
                progress(k as f64 / ticks as f64, tally.rms_n(), tally.energy_j());
            }
        }
        let (injected, survived) = self.faults.counts();
        let mut extra = vec![
            ("faults_injected", f64::from(injected)),
            ("faults_survived", f64::from(survived)),
            ("trips", f64::from(self.chain.trips())),
        ];
        if self.chain.controller().config().estimator != kort_control::EstimatorKind::Off {
            extra.push(("parameter_error", self.parameter_error()));
        }
        progress(1.0, tally.rms_n(), tally.energy_j());
        Ok(tally.finish(&extra))
    }

    fn tick(&mut self, moment: &Moment, log: Option<&mut Log>) -> Sample {
        let time = moment.time_s;
        let process = self.faults.controller(time);
        if process == Process::Restarted {
            self.chain.restart();
        }
        let (faults, sensed) = (&mut self.faults, self.plant.sensed());
        let measured = self.sensors.measure(time, &sensed, &moment.sea, |until_s| faults.inject(until_s));
        let driven = self.chain.tick(&measured, moment.reference_n, process == Process::Alive);
        if let Some(log) = log {
            log.tick(time, &measured, driven.command);
        }
        self.plant.step(&moment.drive(driven.command));
        let truth = *self.plant.truth();
        let sample = Sample {
            time_s: time,
            reference_n: moment.reference_n,
            thrust_n: self.plant.net_thrust_n(),
            shaft_speed_rad_s: truth.shaft_speed_rad_s,
            current_a: truth.current_a,
            flow_m_s: truth.axial_m_s,
            ambient_m_s: truth.ambient_m_s,
            flow_estimate_m_s: self.chain.output().estimate.flow_m_s.value,
            saturated: self.saturated(),
            broken: self.broken(driven.command, truth.shaft_speed_rad_s),
            excused: !driven.armed && self.faults.excuse(time),
        };
        self.faults.watch(&sample, self.prepared.thrust_max_n);
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

    fn parameter_error(&self) -> f64 {
        let model = self.chain.controller().model();
        // The flux coefficient is learnt where both sensors are fitted.
        let sensors = &self.prepared.scenario.sensors;
        let rig = &self.prepared.rig.sensors;
        let flux = sensors.flow && sensors.thrust && rig.flow_meter && rig.thrust_sensor;
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
