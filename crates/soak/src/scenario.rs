//! Scenario files of `kort soak`: `config/scenarios/soak-*.toml`.
//!
//! A scenario says what is true (model, effects, errors of the stated parameters, water, supply),
//! what is asked (references), what is measured and what breaks. Levels of thrust are shares of the
//! largest steady thrust of the rig, so that one scenario serves any thruster.

use std::collections::{BTreeMap, HashMap};
use std::ops::RangeInclusive;
use std::path::PathBuf;

use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameter;
use serde::Deserialize;

use crate::hidden::Hidden;

/// A default law is never worse than the plain one by more than this factor.
pub const NEVER_WORSE: f64 = 1.02;

/// Longest run, s.
pub(crate) const LONGEST_S: f64 = 31.0 * 86_400.0;

/// Rates of controller and servo that a run may have, Hz.
pub const CONTROL_RATES_HZ: RangeInclusive<f64> = 50.0..=10_000.0;

/// A scenario as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name in reports.
    pub name: String,
    /// One sentence: what it is for.
    pub what: String,
    /// Rig description, relative to the scenario file.
    pub rig: PathBuf,
    /// Model of the truth.
    #[serde(default = "model2")]
    pub model: ModelName,
    /// Virtual time, s.
    pub duration_s: f64,
    /// Time at the start that is not scored, s.
    #[serde(default)]
    pub settle_s: f64,
    /// Rate of controller and servo, Hz.
    #[serde(default = "rate")]
    pub control_rate_hz: f64,
    /// How many seeds, unless the command line says.
    #[serde(default = "seeds")]
    pub seeds: u32,
    /// Controllers compared, unless the command line says: files of `config/controllers/`.
    pub controllers: Vec<String>,
    /// What the default law is held to, thrust error over the plain law's, where the drive's limits allow it.
    #[serde(default = "never_worse")]
    pub aim_of_plain: f64,
    /// Which of the rig's sensors are fitted.
    #[serde(default)]
    pub sensors: Fitted,
    /// Noise of the sensors beyond their quantum.
    #[serde(default)]
    pub noise: Noise,
    /// True parameters.
    #[serde(default)]
    pub truth: Truth,
    /// Each law runs once more, told the true parameters (those after the last change) from the start:
    /// its error is then given as a multiple of that run's.
    #[serde(default)]
    pub against_true_parameters: bool,
    /// Physics that the controllers' model leaves out.
    #[serde(default, rename = "effect")]
    pub effects: Vec<EffectSpec>,
    /// What `kort soak --adopt` hides in the plant, by seed.
    pub hidden: Option<Hidden>,
    /// References, one after the other, again from the start when through.
    #[serde(rename = "reference")]
    pub references: Vec<Segment>,
    /// Ambient flow.
    #[serde(default)]
    pub ambient: Ambient,
    /// Depth of the shaft, where an effect needs it.
    pub depth: Option<Depth>,
    /// Supply sags.
    #[serde(default, rename = "supply_sag")]
    pub supply_sags: Vec<Sag>,
    /// Faults of sensors.
    #[serde(default, rename = "sensor_fault")]
    pub sensor_faults: Vec<SensorFault>,
    /// Faults of processes.
    #[serde(default, rename = "process_fault")]
    pub process_faults: Vec<ProcessFault>,
}

fn model2() -> ModelName {
    ModelName::Model2
}
fn rate() -> f64 {
    1000.0
}
fn seeds() -> u32 {
    4
}
fn never_worse() -> f64 {
    NEVER_WORSE
}
fn yes() -> bool {
    true
}

/// Sensors fitted; shaft speed always is.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Fitted {
    /// Motor current.
    #[serde(default = "yes")]
    pub current: bool,
    /// Force sensor.
    #[serde(default = "yes")]
    pub thrust: bool,
    /// Flow meter.
    #[serde(default = "yes")]
    pub flow: bool,
    /// Ambient flow (a log or a current meter).
    #[serde(default)]
    pub ambient: bool,
}

impl Default for Fitted {
    fn default() -> Self {
        Self { current: true, thrust: true, flow: true, ambient: false }
    }
}

/// Standard deviations of one reading.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Noise {
    /// Share of the largest thrust.
    pub thrust: f64,
    /// Share of the flow, turbulence of the jet.
    pub flow: f64,
    /// Share of the current limit.
    pub current: f64,
}

impl Default for Noise {
    fn default() -> Self {
        Self { thrust: 0.005, flow: 0.1, current: 0.002 }
    }
}

/// True parameters as factors on the stated ones; the controllers do not know them.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Truth {
    /// Factors by parameter.
    pub factors: HashMap<Parameter, f64>,
    /// Factors also drawn by seed: one sigma of a log-normal for lift, drag, flux and added mass.
    pub spread: f64,
    /// Changes while running.
    pub change: Vec<Change>,
}

/// A change of the truth.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Change {
    /// When, s.
    pub at_s: f64,
    /// Factors by parameter, on what was true before.
    pub factors: HashMap<Parameter, f64>,
}

/// An effect of the catalogue at work.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EffectSpec {
    /// Identifier of the catalogue.
    pub id: String,
    /// Values by parameter; a parameter left out stands where a fit would start.
    #[serde(default)]
    pub values: BTreeMap<String, f64>,
    /// Values as shares of the rig's largest of their kind (torque, speed, thrust, flow, current, supply), so that
    /// one scenario serves a thruster of any size.
    #[serde(default)]
    pub shares: BTreeMap<String, f64>,
}

/// One stretch of references.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, tag = "kind", rename_all = "snake_case")]
pub enum Segment {
    /// Levels held one after the other.
    Steps {
        /// Shares of the largest thrust.
        levels: Vec<f64>,
        /// How long each is held, s, the ramp included.
        hold_s: f64,
        /// Time of the straight ramp from level to level, s; zero is a step.
        #[serde(default)]
        ramp_s: f64,
    },
    /// A sinusoid.
    Sine {
        /// Amplitude, share of the largest thrust.
        amplitude: f64,
        /// Mean, share of the largest thrust.
        #[serde(default)]
        offset: f64,
        /// Period, s.
        period_s: f64,
        /// How long, s.
        for_s: f64,
    },
    /// What a dynamic-positioning system asks for: low-passed noise about a mean, at 10 Hz.
    Dp {
        /// Mean, share of the largest thrust.
        #[serde(default)]
        mean: f64,
        /// Standard deviation, share of the largest thrust.
        std: f64,
        /// Time scale, s.
        time_s: f64,
        /// How long, s.
        for_s: f64,
    },
    /// What a pilot's stick gives: holds of random length, quick ramps, now and then full reverse.
    Joystick {
        /// Largest deflection, share of the largest thrust.
        amplitude: f64,
        /// How long, s.
        for_s: f64,
    },
    /// A column of a recording: its thrust commands, or the log of a joystick. The last value of a
    /// column stays in force until the next.
    Replay {
        /// Recording: relative to the scenario file, or the name of a shipped one.
        file: String,
        /// Column map of a foreign log.
        columns: Option<String>,
        /// Column.
        #[serde(default = "thrust_column")]
        column: String,
        /// The column is scaled so that its largest size becomes this share of the largest thrust;
        /// without it the column is in newtons, held within the largest thrust.
        peak: Option<f64>,
    },
}

fn thrust_column() -> String {
    "thrust_cmd_n".into()
}

/// Ambient axial flow: mean, tow programme, waves and slow wander add up.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Ambient {
    /// Mean, m/s.
    pub mean_m_s: f64,
    /// Tow or current over time: pairs of time, s, and speed, m/s; again from the start when through.
    pub program: Vec<(f64, f64)>,
    /// Standard deviation of the waves' orbital flow along the axis, m/s.
    pub wave_std_m_s: f64,
    /// Peak period of the waves, s.
    pub wave_period_s: f64,
    /// Standard deviation of the slow wander, m/s.
    pub wander_std_m_s: f64,
    /// Time scale of the slow wander, s.
    pub wander_time_s: f64,
}

/// Depth of the shaft under the waves.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Depth {
    /// Mean, m.
    pub mean_m: f64,
    /// Standard deviation of the surface, m; moves with the waves of the ambient flow.
    pub wave_std_m: f64,
}

/// The supply drops and comes back.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sag {
    /// When, s.
    pub at_s: f64,
    /// How long, s.
    pub for_s: f64,
    /// Down to, share of the nominal supply.
    pub to: f64,
    /// Again after, s.
    pub every_s: Option<f64>,
}

/// How a sensor lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Lie {
    /// No value.
    Dropout,
    /// The last value stays.
    Stuck,
    /// `size` is added, share of full scale.
    Bias,
    /// The value is multiplied by `size`.
    Gain,
    /// `size` is added to one reading in twenty, share of full scale.
    Spikes,
}

/// A measured channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Shaft speed.
    ShaftSpeedRadS,
    /// Motor current.
    CurrentA,
    /// Thrust.
    ThrustN,
    /// Axial flow.
    FlowMS,
}

/// A sensor fault.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SensorFault {
    /// Which sensor.
    pub channel: Channel,
    /// How it lies.
    pub lie: Lie,
    /// Size of the lie, where it has one.
    pub size: Option<f64>,
    /// When, s.
    pub at_s: f64,
    /// How long, s.
    pub for_s: f64,
    /// Again after, s.
    pub every_s: Option<f64>,
}

/// Which process fails, and how.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProcessFaultKind {
    /// The controller dies and comes up afresh.
    ControllerRestart,
    /// The controller stops ticking and goes on with what it knew.
    ControllerFrozen,
}

/// A process fault. The servo's watchdog takes the drive to zero; the operator arms again half a
/// second after the process is back.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProcessFault {
    /// What happens.
    pub kind: ProcessFaultKind,
    /// When, s.
    pub at_s: f64,
    /// How long the process is away, s.
    pub for_s: f64,
    /// Again after, s.
    pub every_s: Option<f64>,
}

/// Whether something that starts `at_s`, lasts `for_s` and repeats is on at a time.
pub fn is_on(at_s: f64, for_s: f64, every_s: Option<f64>, time_s: f64) -> bool {
    let since = time_s - at_s;
    let within = every_s.filter(|every| *every > 0.0).map_or(since, |every| since % every);
    since >= 0.0 && within < for_s
}

impl Scenario {
    /// Virtual time that one law takes with one seed, s.
    pub fn virtual_s(&self) -> f64 {
        self.duration_s * if self.against_true_parameters { 2.0 } else { 1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeating_faults_come_back() {
        assert!(!is_on(5.0, 1.0, Some(10.0), 4.9));
        assert!(is_on(5.0, 1.0, Some(10.0), 5.5));
        assert!(!is_on(5.0, 1.0, Some(10.0), 6.5));
        assert!(is_on(5.0, 1.0, Some(10.0), 15.5));
        assert!(!is_on(5.0, 1.0, None, 15.5));
    }
}
