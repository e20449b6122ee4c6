//! A simulated drive: a model of the rig in real time, with its sensors and their noise.

use std::collections::BTreeMap;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::faults::Fault;
use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;
use kort_scenario::Measuring;
use kort_thruster::effects::Descriptor;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig, Sensors};
use serde::Deserialize;

use super::lying::{Lying, SensorFault};
use super::{Drive, kind_of};
use crate::devices::{At, Reading, Shown};

/// Most ticks caught up at once after a stall; a longer one loses simulated time.
const CATCH_UP: u64 = 50;

/// Section `simulation`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Simulation {
    model: String,
    seed: i64,
    ambient_m_s: f64,
    effects: Vec<EffectKeys>,
    sensor_fault: Option<SensorFault>,
    sensor_fault_after_s: f64,
}

impl Default for Simulation {
    fn default() -> Self {
        Self {
            model: "model2".into(),
            seed: 1,
            ambient_m_s: 0.0,
            effects: Vec::new(),
            sensor_fault: None,
            sensor_fault_after_s: 0.0,
        }
    }
}

#[derive(Clone, Debug, Deserialize)]
struct EffectKeys {
    id: String,
    #[serde(default)]
    after_s: f64,
    #[serde(flatten)]
    values: BTreeMap<String, f64>,
}

/// Whether these are keys of the simulated stand: a section that is not read now.
///
/// # Errors
/// [`ConfigError`] names the first that is none, and the nearest.
pub(super) fn check_keys(config: &Config, section: &str, thruster: &Thruster) -> Result<(), ConfigError> {
    config.section::<Simulation>(section, &thruster.simulation).map(drop)
}

/// The simulated drive.
pub struct Simulated {
    plant: Plant,
    /// Stands that take its place from an instant on, s, in order, and how many of them have: an effect that comes on
    /// later.
    later: Vec<(f64, Plant)>,
    passed: usize,
    kind: DriveKind,
    command: f64,
    tick_s: f64,
    time_s: f64,
    ambient_m_s: f64,
    sensors: Sensors,
    measuring: Measuring,
    lying: Option<Lying>,
}

impl Simulated {
    /// Sets the stand up at rest.
    ///
    /// # Errors
    /// [`ConfigError`] names an unknown key, model, effect or parameter.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let section = format!("thrusters.{id}.simulation");
        let keys: Simulation = config.section(&section, &thruster.simulation)?;
        let fail = |key: &str, words: String| config.error(format!("`{section}.{key}`: {words}"));
        let mut wrong = Vec::new();
        // Whatever plays the stand, the rest is told with it.
        let model = keys.model.parse().unwrap_or_else(|e| {
            wrong.push(fail("model", e));
            ModelName::Model2
        });
        if matches!(model, ModelName::Model0 | ModelName::Model3) {
            wrong.push(fail(
                "model",
                format!(
                    "{model} has no shaft of its own and cannot play a stand\nhint: model1, model2 or rotational_flow"
                ),
            ));
        }
        if keys.seed < 0 {
            let words = format!("{} is outside 0 to {}\nhint: 0 is without noise", keys.seed, i64::MAX);
            wrong.push(fail("seed", words));
        }
        if keys.ambient_m_s.is_nan() || keys.ambient_m_s.abs() > 5.0 {
            wrong.push(fail(
                "ambient_m_s",
                format!(
                    "{} is outside -5 to 5\nhint: the stream past the stand, 0 in still water",
                    keys.ambient_m_s
                ),
            ));
        }
        if !(0.0..=1e6).contains(&keys.sensor_fault_after_s) {
            wrong.push(fail(
                "sensor_fault_after_s",
                format!(
                    "{} is outside 0 to 1e6\nhint: when the sensor begins to lie",
                    keys.sensor_fault_after_s
                ),
            ));
        }
        let tick_s = thruster.servo_period_ns() as f64 * 1e-9;
        let parameters = Parameters::stated(rig);
        let scale = kort_scenario::scale(rig, &parameters, full_drive(rig, &parameters), tick_s, 60.0);
        let mut chosen = Vec::new();
        for (i, effect) in keys.effects.iter().enumerate() {
            let (named, given) = (format!("{section}.effects[{i}].id"), format!("{section}.effects[{i}]"));
            let used = kort_scenario::used_effect((&named, &effect.id), (&given, &effect.values), &scale);
            match used {
                Ok(used) => chosen.push((effect.after_s, used)),
                Err(said) => wrong.extend(said.iter().map(|e| config.error(e.to_string()))),
            }
            if !(0.0..=1e6).contains(&effect.after_s) {
                let words = format!(
                    "{} is outside 0 to 1e6\nhint: seconds after the servo's start from which the effect acts",
                    effect.after_s
                );
                wrong.push(fail(&format!("effects[{i}].after_s"), words));
            }
        }
        if let Some(first) = config.first_of(wrong.into_iter()) {
            return Err(first);
        }
        let mut onsets: Vec<f64> = chosen.iter().map(|(after_s, _)| *after_s).chain([0.0]).collect();
        onsets.sort_by(f64::total_cmp);
        onsets.dedup();
        let from = |onset_s: f64| {
            let acting = chosen.iter().filter(|(after_s, _)| *after_s <= onset_s);
            let acting: Vec<(&Descriptor, &[f64])> = acting.map(|(_, (d, v))| (*d, v.as_slice())).collect();
            Plant::new(model, rig, &parameters, &acting, tick_s).with_encoder_quantised(true)
        };
        Ok(Self {
            plant: from(0.0),
            later: onsets.into_iter().skip(1).map(|onset_s| (onset_s, from(onset_s))).collect(),
            passed: 0,
            kind: kind_of(rig),
            command: 0.0,
            tick_s,
            time_s: 0.0,
            ambient_m_s: keys.ambient_m_s,
            sensors: rig.sensors,
            measuring: Measuring::new(
                &rig.sensors,
                scale,
                if keys.seed == 0 { 0.0 } else { 1.0 },
                keys.seed as u64,
            ),
            lying: keys.sensor_fault.map(|fault| Lying::new(fault, keys.sensor_fault_after_s)),
        })
    }
}

impl Drive for Simulated {
    fn reading_life_ns(&self) -> u64 {
        0
    }

    fn show(&mut self, at: At) -> Shown {
        for _ in 0..at.ticks.clamp(1, CATCH_UP) {
            self.go_on();
            self.plant.step(&Tick {
                time_s: self.time_s,
                command: self.command,
                ambient_m_s: (self.ambient_m_s, self.ambient_m_s),
                ..Tick::default()
            });
            self.time_s += self.tick_s;
        }
        let mut signals = Signals::UNKNOWN;
        let truth = self.plant.truth();
        let well =
            truth.shaft_speed_rad_s.is_finite() && truth.current_a.is_finite() && truth.axial_m_s.is_finite();
        if well {
            self.read(&mut signals);
        }
        Shown {
            reading: Some(Reading { stamp_ns: at.now_ns, signals }),
            faults: if well { 0 } else { Fault::AmplifierFault.bit() },
        }
    }

    fn drive(&mut self, _: u64, drive: Option<f64>) {
        self.command = drive.unwrap_or(0.0);
    }
}

impl Simulated {
    /// Takes the next stand into use where its time has come, from the state of the one before.
    fn go_on(&mut self) {
        let Some((from_s, next)) = self.later.get_mut(self.passed) else { return };
        if self.time_s < *from_s {
            return;
        }
        let was = *self.plant.truth();
        next.start(self.time_s, was.shaft_speed_rad_s, was.axial_m_s, was.current_a, was.shaft_angle_rad);
        // The one before stays in its place: nothing is given back while the loop runs.
        std::mem::swap(&mut self.plant, next);
        self.passed += 1;
    }

    /// Reads the stand's sensors.
    fn read(&mut self, into: &mut Signals) {
        let read = self.measuring.read(self.time_s, &self.plant.sensed());
        // A drive with a speed loop of its own tells no current; nothing of it is modelled either.
        if self.kind != DriveKind::Speed {
            into.current_a = read.current_a;
        }
        into.shaft_angle_rad = read.shaft_angle_rad;
        into.shaft_speed_rad_s = read.shaft_speed_rad_s;
        into.thrust_n = read.thrust_n;
        // A meter that is slower than the loop shows a value only when it has a new one.
        into.flow_m_s = read.flow_m_s;
        into.supply_v = read.supply_v;
        if self.sensors.torque_transducer {
            into.torque_n_m = read.torque_n_m;
        }
        if self.sensors.ambient_flow_recorded {
            into.ambient_m_s = self.ambient_m_s;
        }
        if let Some(lying) = &mut self.lying {
            lying.distort(self.time_s, into);
        }
    }
}

/// Largest drive command: current limit, supply, or the speed at which the supply's voltage is reached.
fn full_drive(rig: &Rig, p: &Parameters) -> f64 {
    let supply = rig.amplifier.supply_v;
    match rig.amplifier.kind {
        AmplifierKind::Current => {
            Some(rig.amplifier.current_limit_a).filter(|a| a.is_finite()).unwrap_or(10.0)
        }
        AmplifierKind::Voltage => supply.unwrap_or(10.0),
        AmplifierKind::Speed => supply.map_or(100.0, |v| v / p.get(Parameter::TorqueConstantNmA)),
    }
}

#[cfg(test)]
mod tests {
    use kort_proto::config::Config;
    use kort_thruster::rig::Rig;

    use super::{At, Drive, Simulated};

    /// Shaft speed of a dry motor under 2 A at each of the first hundredths of a second, rad/s.
    fn speeds(effects: &str) -> Vec<f64> {
        let rig = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 0.1\n\
                   viscous_friction_nm_s = 0.01\n[amplifier]\nkind = \"current\"\ncurrent_limit_a = 5.0\n";
        let rig = Rig::from_toml(rig).unwrap();
        let text = format!(
            "[thrusters.t1]\nrig = \"r\"\namplifier = \"simulated\"\n\
             simulation = {{ seed = 0, effects = [{effects}] }}\n"
        );
        let config = Config::parse(&text, None).unwrap();
        let mut stand = Simulated::new(&config, "t1", config.thruster("t1").unwrap(), &rig).unwrap();
        let mut show = |k: u64| {
            stand.drive(0, Some(2.0));
            stand.show(At { now_ns: k * 10_000_000, ticks: 10 });
            stand.plant.truth().shaft_speed_rad_s
        };
        (0..400).map(&mut show).collect()
    }

    #[test]
    fn an_effect_comes_on_when_its_time_has_come_and_the_shaft_goes_on_from_where_it_is() {
        let rubs =
            |after: &str| format!("{{ id = \"viscous_friction\", viscous_friction_nm_s = 0.005{after} }}");
        let (smooth, late, rough) = (speeds(""), speeds(&rubs(", after_s = 2.0")), speeds(&rubs("")));
        assert_eq!(smooth[..195], late[..195]);
        assert!(late.windows(2).all(|w| (w[1] - w[0]).abs() < 0.5), "no jump");
        let end = |speeds: &[f64]| speeds[399];
        assert!(end(&smooth) > 18.0 && end(&rough) < 14.0, "{} {}", end(&smooth), end(&rough));
        assert!((end(&late) - end(&rough)).abs() < 0.5, "{}", end(&late));
    }
}
