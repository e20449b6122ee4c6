//! What the drive's limits leave: the thrust error of a law that is told everything, behind the same drive.
//!
//! It knows the true parameters and, at every tick, the true shaft speed, current, flow, ambient flow, thrust and
//! load; it has no sensor, no filter and no delay. What makes commands late it foresees: of a dead time only the reference
//! is late, and what rounds a command is left out ([`Prompt`]). It aims as `model2_inversion` does and leads the shaft as fast
//! as current, supply and slew of the drive let it. What error it has left, no choice of law takes away; a step
//! costs every law the time that the drive needs for it.

use std::collections::VecDeque;

use kort_control::known::command_late_s;
use kort_control::laws::aim::Aim;
use kort_control::laws::lead::{Lead, Meets};
use kort_control::{ControlModel, ControllerConfig, Estimate, ModelError};
use kort_thruster::effects::{Context, Descriptor};
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::Plant;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::run::{Prepared, Progress};
use crate::score::{Outcome, Sample, Tally};
use crate::script::{Moment, Script};
use crate::truth::{self, Hooked};

/// Name in reports.
pub const NAME: &str = "drive_limits";
/// Share of top speed below which thrust says nothing of the flow.
const SEEN: f64 = 0.1;

/// The thruster without what makes its commands late: a law that knows what will come sends each as much earlier.
struct Prompt {
    rig: Rig,
    effects: Vec<Hooked>,
    /// By how much a dead time makes every command late, s.
    dead_time_s: f64,
}

impl Prompt {
    fn of(prepared: &Prepared, model: &ControlModel) -> Self {
        let parameters = Parameters::stated(prepared.rig);
        let context = Context { parameters: &parameters, rig: prepared.rig, tick_s: model.period_s };
        let late_s = |descriptor: &Descriptor, values: &[f64]| {
            let mut effect = (descriptor.build.plain)(values, &context);
            if effect.hooks().drive { command_late_s(effect.as_mut(), model) } else { 0.0 }
        };
        let mut dead_time_s = 0.0;
        let mut prompt = |descriptor: &Descriptor, values: &[f64]| {
            let late_s = late_s(descriptor, values);
            dead_time_s += if descriptor.shifts_time { late_s } else { 0.0 };
            late_s == 0.0
        };
        let mut rig = prepared.rig.clone();
        rig.effects.retain(|known| {
            let values: Vec<f64> = known.values().collect();
            known.descriptor().is_none_or(|descriptor| prompt(descriptor, &values))
        });
        let effects = prepared.effects.iter().filter(|(d, values)| prompt(d, values)).cloned().collect();
        Self { rig, effects, dead_time_s }
    }
}

struct Told {
    parameters: Parameters,
    model: ControlModel,
    plant: Plant,
    aim: Aim,
    lead: Lead,
    /// References that a dead time holds back, N: the newest last.
    held_n: VecDeque<f64>,
    last_reference_n: f64,
    dt_s: f64,
}

/// Runs the law that is told everything, and scores it.
///
/// # Errors
/// [`ModelError`] if no controller can be designed for the rig.
pub fn limits(prepared: &Prepared, seed: u64, progress: Progress) -> Result<Outcome, ModelError> {
    let scenario = prepared.scenario;
    let dt_s = 1.0 / scenario.control_rate_hz;
    let parameters = truth::parameters(prepared, seed);
    let Prompt { rig, effects, dead_time_s } = Prompt::of(prepared, &model(prepared, &parameters, dt_s)?);
    let prepared = &Prepared { rig: &rig, effects: &effects, ..*prepared };
    let model = model(prepared, &parameters, dt_s)?;
    let plant = truth::plant(prepared, &parameters, dt_s);
    let (aim, lead) = (Aim::default(), Lead::new(&model));
    let held_n = VecDeque::from(vec![0.0; (dead_time_s / dt_s).round() as usize]);
    let mut told = Told { parameters, model, plant, aim, lead, held_n, last_reference_n: 0.0, dt_s };
    let mut script = Script::new(prepared, seed);
    let mut tally = Tally::new(dt_s, prepared.rig, prepared.thrust_max_n, scenario.settle_s);
    let mut changes = scenario.truth.change.iter().peekable();
    let ticks = (scenario.duration_s / dt_s).round() as u64;
    let report_every = (ticks / 200).max(1);
    for k in 0..ticks {
        let moment = script.next(k as f64 * dt_s);
        if let Some(change) = changes.next_if(|c| moment.time_s >= c.at_s) {
            truth::change(&mut told.parameters, &change.factors);
            told.plant = truth::changed(prepared, &told.parameters, &told.plant, dt_s);
            told.model = self::model(prepared, &told.parameters, dt_s)?;
        }
        tally.tick(&told.tick(&moment));
        if k % report_every == 0 {
            progress(k as f64 / ticks as f64, tally.rms_n(), tally.energy_j());
        }
    }
    progress(1.0, tally.rms_n(), tally.energy_j());
    Ok(tally.finish(&[]))
}

/// The truth as a controller's model, with the slew that every law is held to.
fn model(prepared: &Prepared, parameters: &Parameters, dt_s: f64) -> Result<ControlModel, ModelError> {
    let mut model = ControlModel::from_rig(&truth::told(prepared.rig, parameters), dt_s)?;
    model.current_rate_a_s = ControllerConfig::default().limits.current_rate_per_s * model.current_limit_a;
    Ok(model)
}

/// The axial flow, m/s, in which the model gives the true thrust at the true speed: physics that the model
/// leaves out (air, another blade) is met as if it were inflow. Near standstill, or where no flow does it, the
/// true flow.
fn flow_for_thrust(model: &ControlModel, speed_rad_s: f64, flow_m_s: f64, thrust_n: f64) -> f64 {
    if speed_rad_s.abs() < SEEN * model.speed_max_rad_s {
        return flow_m_s;
    }
    // Thrust falls as the flow rises, whichever way the shaft turns.
    let reach = 2.0 * model.blade.lever_m() * speed_rad_s.abs();
    let (mut low, mut high) = (flow_m_s - reach, flow_m_s + reach);
    let surplus = |flow: f64| model.load(speed_rad_s, flow, 0.0).thrust_n - thrust_n;
    if surplus(low) < 0.0 || surplus(high) > 0.0 {
        return flow_m_s;
    }
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if surplus(middle) > 0.0 { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

impl Told {
    fn tick(&mut self, moment: &Moment) -> Sample {
        self.held_n.push_back(moment.reference_n);
        let reference_n = self.held_n.pop_front().unwrap_or(moment.reference_n);
        let model = &self.model;
        let before = *self.plant.truth();
        let flow = flow_for_thrust(model, before.shaft_speed_rad_s, before.axial_m_s, before.thrust_n);
        let mut estimate = Estimate::default();
        estimate.flow_m_s.value = flow;
        estimate.ambient_m_s.value = before.ambient_m_s + flow - before.axial_m_s;
        let expected = model.load(before.shaft_speed_rad_s, flow, 0.0);
        let arrives_s = 1.0 / self.lead.pace().shaft_per_s;
        let target = self.aim.at(model, &estimate, reference_n, arrives_s);
        let rate = target.by_thrust * (reference_n - self.last_reference_n) / self.dt_s;
        self.last_reference_n = reference_n;
        let meets = Meets {
            flow_m_s: flow,
            swirl_m_s: 0.0,
            load_n_m: (before.blade_torque_n_m - expected.torque_n_m) * before.shaft_speed_rad_s.signum(),
            supply_v: moment.sea.supply_v,
        };
        self.lead.put(before.shaft_speed_rad_s, before.current_a);
        let led = self.lead.step(model, target.speed_rad_s, rate, &meets, self.dt_s);
        let current_a = led.torque_n_m / model.torque_constant_nm_a;
        let command = match model.amplifier {
            AmplifierKind::Current => current_a,
            AmplifierKind::Voltage => {
                let supply_v = moment.sea.supply_v.or(model.supply_v).unwrap_or(f64::INFINITY);
                let wanted = model.winding_resistance_ohm.unwrap_or(0.0) * current_a
                    + model.torque_constant_nm_a * before.shaft_speed_rad_s;
                wanted.clamp(-supply_v, supply_v)
            }
            AmplifierKind::Speed => led.speed_command_rad_s,
        };
        self.plant.step(&moment.drive(command));
        let truth = *self.plant.truth();
        Sample {
            time_s: moment.time_s,
            reference_n: moment.reference_n,
            thrust_n: self.plant.net_thrust_n(),
            shaft_speed_rad_s: truth.shaft_speed_rad_s,
            current_a: truth.current_a,
            flow_m_s: truth.axial_m_s,
            ambient_m_s: truth.ambient_m_s,
            flow_estimate_m_s: truth.axial_m_s,
            ..Sample::default()
        }
    }
}
