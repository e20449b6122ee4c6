//! A simulated drive: a model of the rig in real time, with its sensors and their noise.

use std::collections::BTreeMap;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;
use kort_thruster::effects::{self, Descriptor, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig, Sensors};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::Deserialize;

use super::{Amplifier, AmplifierFault};

/// Most ticks caught up at once after a stall; a longer one loses simulated time.
const CATCH_UP: u64 = 50;

/// Section `simulation`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Simulation {
    model: String,
    seed: u64,
    ambient_m_s: f64,
    effects: Vec<EffectKeys>,
}

impl Default for Simulation {
    fn default() -> Self {
        Self { model: "model2".into(), seed: 1, ambient_m_s: 0.0, effects: Vec::new() }
    }
}

#[derive(Clone, Debug, Deserialize)]
struct EffectKeys {
    id: String,
    #[serde(flatten)]
    values: BTreeMap<String, f64>,
}

/// Standard deviations of the sensors' noise, as shares measured on stands of this kind.
mod noise {
    /// Of the current limit.
    pub const CURRENT: f64 = 0.003;
    /// Of the largest thrust.
    pub const THRUST: f64 = 0.005;
    /// Of the largest torque.
    pub const TORQUE: f64 = 0.008;
    /// Of the largest axial flow.
    pub const FLOW: f64 = 0.02;
    /// Of the supply.
    pub const SUPPLY: f64 = 0.002;
}

/// The simulated drive.
pub struct Simulated {
    plant: Plant,
    kind: DriveKind,
    command: f64,
    tick_s: f64,
    time_s: f64,
    ambient_m_s: f64,
    sensors: Sensors,
    scale: Scale,
    random: Option<ChaCha8Rng>,
    until_flow_s: f64,
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
        let model: ModelName = keys.model.parse().map_err(|e| fail("model", e))?;
        if matches!(model, ModelName::Model0 | ModelName::Model3) {
            return Err(fail(
                "model",
                format!(
                    "{model} has no shaft of its own and cannot play a stand\nhint: model1, model2 or rotational_flow"
                ),
            ));
        }
        if keys.ambient_m_s.is_nan() || keys.ambient_m_s.abs() > 5.0 {
            return Err(fail("ambient_m_s", format!("{} is outside -5 to 5", keys.ambient_m_s)));
        }
        let tick_s = thruster.servo_period_ns() as f64 * 1e-9;
        let parameters = Parameters::stated(rig);
        let scale = scale_of(rig, &parameters, tick_s);
        let mut chosen = Vec::new();
        for effect in &keys.effects {
            chosen.push(resolve(effect, &scale).map_err(|words| fail("effects", words))?);
        }
        let chosen: Vec<(&Descriptor, &[f64])> = chosen.iter().map(|(d, v)| (*d, v.as_slice())).collect();
        Ok(Self {
            plant: Plant::new(model, rig, &parameters, &chosen, tick_s).with_encoder_quantised(true),
            kind: match rig.amplifier.kind {
                AmplifierKind::Current => DriveKind::Current,
                AmplifierKind::Voltage => DriveKind::Voltage,
                AmplifierKind::Speed => DriveKind::Speed,
            },
            command: 0.0,
            tick_s,
            time_s: 0.0,
            ambient_m_s: keys.ambient_m_s,
            sensors: rig.sensors,
            scale,
            random: (keys.seed != 0).then(|| ChaCha8Rng::seed_from_u64(keys.seed)),
            until_flow_s: 0.0,
        })
    }

    fn noise(&mut self, deviation: f64) -> f64 {
        self.random.as_mut().map_or(0.0, |random| {
            let unit: f64 = StandardNormal.sample(random);
            deviation * unit
        })
    }
}

impl Amplifier for Simulated {
    fn kind(&self) -> DriveKind {
        self.kind
    }

    fn measure(&mut self, ticks: u64, into: &mut Signals) -> Result<(), AmplifierFault> {
        for _ in 0..ticks.clamp(1, CATCH_UP) {
            self.plant.step(&Tick {
                time_s: self.time_s,
                command: self.command,
                ambient_m_s: (self.ambient_m_s, self.ambient_m_s),
                ..Tick::default()
            });
            self.time_s += self.tick_s;
            self.until_flow_s -= self.tick_s;
        }
        let sensed = *self.plant.sensed();
        let truth = self.plant.truth();
        if !(truth.shaft_speed_rad_s.is_finite()
            && truth.current_a.is_finite()
            && truth.axial_m_s.is_finite())
        {
            return Err(AmplifierFault);
        }
        into.current_a = sensed.current_a + self.noise(noise::CURRENT * self.scale.current_a);
        into.shaft_angle_rad = sensed.shaft_angle_rad;
        into.shaft_speed_rad_s = sensed.shaft_speed_rad_s;
        let thrust = sensed.thrust_n + self.noise(noise::THRUST * self.scale.thrust_n);
        into.thrust_n = convert(thrust, self.sensors.thrust_full_scale_n, self.sensors.thrust_bits);
        if self.sensors.torque_transducer {
            into.torque_n_m = sensed.torque_n_m + self.noise(noise::TORQUE * self.scale.torque_n_m);
        }
        // A meter that is slower than the loop shows a value only when it has a new one.
        if self.until_flow_s <= 0.0 {
            into.flow_m_s = sensed.flow_m_s + self.noise(noise::FLOW * self.scale.flow_m_s);
            self.until_flow_s += self.sensors.flow_rate_hz.map_or(self.tick_s, |hz| 1.0 / hz);
        }
        if self.sensors.ambient_flow_recorded {
            into.ambient_m_s = self.ambient_m_s;
        }
        if sensed.supply_v.is_finite() {
            into.supply_v = sensed.supply_v + self.noise(noise::SUPPLY * sensed.supply_v);
        }
        Ok(())
    }

    fn drive(&mut self, drive: Option<f64>) {
        self.command = drive.unwrap_or(0.0);
    }
}

/// An analog-digital converter over plus and minus full scale.
fn convert(value: f64, full_scale: Option<f64>, bits: Option<u32>) -> f64 {
    let (Some(full), Some(bits)) = (full_scale, bits) else { return value };
    let step = 2.0 * full / f64::from(bits.clamp(1, 30)).exp2();
    (value.clamp(-full, full) / step).round() * step
}

/// An effect with its parameters in order.
fn resolve(keys: &EffectKeys, scale: &Scale) -> Result<(&'static Descriptor, Vec<f64>), String> {
    let descriptor = effects::find(&keys.id).ok_or_else(|| {
        let known: Vec<_> = effects::ALL.iter().map(|d| d.id).collect();
        format!("there is no effect `{}`\nhint: known are {}", keys.id, known.join(", "))
    })?;
    let specs = (descriptor.parameters)(scale);
    if let Some(unknown) = keys.values.keys().find(|k| specs.iter().all(|s| s.name != k.as_str())) {
        let known: Vec<_> = specs.iter().map(|s| s.name).collect();
        return Err(format!("`{}` has no parameter `{unknown}`\nhint: it has {}", keys.id, known.join(", ")));
    }
    let mut values = Vec::new();
    for spec in &specs {
        let value = *keys.values.get(spec.name).ok_or_else(|| {
            format!(
                "`{}` lacks its parameter `{}` ({})\nhint: for example {}",
                keys.id, spec.name, spec.unit, spec.start
            )
        })?;
        if !(value >= spec.low && value <= spec.high) {
            return Err(format!(
                "`{}.{}` = {value} is outside {} to {} ({})",
                keys.id, spec.name, spec.low, spec.high, spec.unit
            ));
        }
        values.push(value);
    }
    Ok((descriptor, values))
}

/// Sizes of the rig at full drive in bollard pull.
fn scale_of(rig: &Rig, p: &Parameters, tick_s: f64) -> Scale {
    let kt = p.get(Parameter::TorqueConstantNmA);
    let supply = rig.amplifier.supply_v.unwrap_or(0.0);
    let resistance = p.get(Parameter::WindingResistanceOhm);
    let stall = if resistance > 0.0 { supply / resistance } else { f64::INFINITY };
    let current = rig.amplifier.current_limit_a.min(stall);
    let current = if current.is_finite() { current } else { 10.0 };
    let (thrust, torque) = (p.get(Parameter::ThrustCoefficientNS2), p.get(Parameter::TorqueCoefficientNmS2));
    let speed = if torque > 0.0 { (kt * current / torque).sqrt() } else { 100.0 };
    let flux = p.get(Parameter::FluxCoefficient) * p.get(Parameter::DensityKgM3) * p.area_m2();
    Scale {
        shaft_speed_rad_s: speed,
        torque_n_m: kt * current,
        thrust_n: thrust * speed * speed,
        flow_m_s: if flux > 0.0 { (thrust * speed * speed / flux).sqrt() } else { 1.0 },
        current_a: current,
        command: match rig.amplifier.kind {
            AmplifierKind::Current => current,
            AmplifierKind::Voltage => supply,
            AmplifierKind::Speed => speed,
        },
        supply_v: supply,
        inertia_kg_m2: p.get(Parameter::InertiaKgM2),
        tick_s,
        duration_s: 60.0,
    }
}
