//! What the interface shows of a thruster: the JSON documents and their schemas.

use kort_proto::messages::{ControllerState, PATHS, RESIDUALS};
use kort_proto::signals::{ESTIMATES, Estimates, Kind, SIGNALS, Signals};
use serde::ser::SerializeMap;
use serde::{Deserialize, Serialize, Serializer};
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ObjectBuilder, Schema, SchemaType, Type};
use utoipa::{PartialSchema, ToSchema};

use crate::analysis::JobStep;
use crate::calibration::CalibrationStep;
use crate::excitation::ExcitationStep;
use crate::extract::Object;
use crate::rig::TrialView;

/// Everything known of one thruster at one instant.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct ThrusterState {
    /// Name of the thruster in the configuration.
    #[schema(example = "t1")]
    pub id: String,
    /// Is the drive armed? Disarmed means zero torque.
    pub armed: bool,
    /// Control law that runs; null while the controller is away.
    #[schema(example = "velocity_servo")]
    pub controller: Option<String>,
    /// Observer that runs beside it; null while the controller is away.
    #[schema(example = "ekf")]
    pub observer: Option<String>,
    /// Estimator that runs beside it; null while the controller is away.
    pub estimator: Option<String>,
    /// Revision of the rig description that the controller runs on, as recordings name it; null while it is away.
    #[schema(example = "8f3a0c94d1b2e675")]
    pub rig_revision: Option<String>,
    /// Is the estimator frozen for want of excitation?
    pub estimator_frozen: bool,
    /// Setpoint in force.
    pub setpoint: Setpoint,
    /// Largest magnitude a setpoint may have.
    pub range: SetpointRange,
    /// Commands on their way to the drive; null where this control law gives none.
    #[schema(schema_with = commanded_schema)]
    pub commanded: Values,
    /// What the sensors show; null where it is not measured.
    #[schema(schema_with = measured_schema)]
    pub measured: Values,
    /// What observer and estimator believe.
    pub estimated: Estimated,
    /// Which path has changed, and how far all is off the rig as stated; null while the controller is away.
    pub mismatch: Option<MismatchView>,
    /// The diagnosis of it that runs; null if none does.
    pub diagnosis: Option<JobStep>,
    /// The fit of it that runs; null if none does.
    pub fit: Option<JobStep>,
    /// The calibration of it that runs; null if none does.
    pub calibration: Option<CalibrationStep>,
    /// How the thrust fares since another revision of the rig came into force; null if none did since the gateway started.
    pub revision_trial: Option<TrialView>,
    /// The test signal that plays; null if none does.
    pub excitation: Option<ExcitationStep>,
    /// Latched faults.
    pub faults: Vec<FaultView>,
    /// Limits in force: no faults, they say what holds the thruster back now.
    pub limits: Vec<LimitView>,
    /// Who has command; null if nobody.
    pub lease: Option<LeaseView>,
    /// The servo's monotonic time of the measurements, s.
    pub time_s: f64,
    /// Age of the measurements when this was written, s; null if there never were any.
    pub age_s: Option<f64>,
}

/// What is commanded: exactly one of the two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case", try_from = "Object<SetpointKeys>")]
#[schema(example = json!({"thrust_n": 25.0}))]
pub enum Setpoint {
    /// Thrust, N; positive pushes ahead.
    ThrustN(f64),
    /// Shaft speed, rad/s; positive turns ahead.
    SpeedRadS(f64),
}

/// A setpoint as written. serde takes an object with no key or two for a broken enum, which would be
/// reported as broken JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with thrust_n or speed_rad_s")]
struct SetpointKeys {
    thrust_n: Option<f64>,
    speed_rad_s: Option<f64>,
}

impl TryFrom<Object<SetpointKeys>> for Setpoint {
    type Error = &'static str;

    fn try_from(Object(keys): Object<SetpointKeys>) -> Result<Self, Self::Error> {
        match keys {
            SetpointKeys { thrust_n: Some(value), speed_rad_s: None } => Ok(Self::ThrustN(value)),
            SetpointKeys { thrust_n: None, speed_rad_s: Some(value) } => Ok(Self::SpeedRadS(value)),
            SetpointKeys { thrust_n: None, speed_rad_s: None } => {
                Err("no setpoint; allowed is a number as thrust_n or as speed_rad_s")
            }
            _ => Err("two setpoints; allowed is one of thrust_n and speed_rad_s"),
        }
    }
}

/// Largest magnitude of each kind of setpoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, ToSchema)]
pub struct SetpointRange {
    /// Largest thrust either way, N.
    pub thrust_n: f64,
    /// Largest shaft speed either way, rad/s.
    pub speed_rad_s: f64,
}

/// Beliefs of observer and estimator.
#[derive(Clone, Debug, Serialize)]
pub struct Estimated {
    /// Estimated signals, by name.
    #[serde(flatten)]
    pub values: Values,
    /// Estimated parameters.
    pub parameters: Vec<ParameterEstimate>,
}

/// Mismatch between the thruster and its rig description while it runs: what has changed since it was learnt what is usual, and
/// what is off, changed or not.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct MismatchView {
    /// How near each path is to an alarm: 1 is one; null while it is learnt what is usual.
    pub paths: Vec<PathView>,
    /// The path that has changed: drive, shaft, blade, flow or sensor; null without an alarm.
    #[schema(example = "shaft")]
    pub alarm: Option<&'static str>,
    /// Time since it began, s; null without an alarm.
    pub since_s: Option<f64>,
    /// How far it was off the rig as stated in the last minute of driving, also where it always was.
    pub residuals: Vec<ResidualView>,
    /// Is every residual that is known within [`AGREES`] of the rig as stated? Null before one is known.
    pub agrees: Option<bool>,
}

/// Within so much of what the model expects the thruster is said to agree with its rig description. Less than most rigs state
/// their coefficients to: what is beyond may still be within those tolerances, which a diagnosis tells.
const AGREES: f64 = 0.05;

/// What is seen of a mismatch in one signal.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct ResidualView {
    /// current, torque, thrust, flow, thrust_at_rest or current_late.
    pub residual: &'static str,
    /// Measured less expected, as a share of what the model expects (at rest of the largest thrust; late of the largest current,
    /// negative where it lags); null before it is known.
    pub share: Option<f64>,
}

/// A path and how near it is to an alarm.
#[derive(Clone, Debug, PartialEq, Serialize, ToSchema)]
pub struct PathView {
    /// drive, shaft, blade, flow or sensor.
    pub path: &'static str,
    /// 1 and above is an alarm; null while it is learnt what is usual.
    pub level: Option<f64>,
}

impl MismatchView {
    /// As a controller tells it.
    pub fn of(state: &ControllerState) -> Self {
        let alarm = PATHS.get((state.mismatch_path as usize).wrapping_sub(1)).copied();
        let level = |value: f64| Some(value).filter(|v| v.is_finite());
        let paths = PATHS
            .iter()
            .zip(state.mismatch_level)
            .map(|(path, value)| PathView { path, level: level(value) });
        let shares = state.mismatch_lately.map(|share| Some(share).filter(|share| share.is_finite()));
        let mut known = shares.iter().flatten().peekable();
        let agrees = known.peek().is_some().then(|| known.all(|share| share.abs() <= AGREES));
        Self {
            paths: paths.collect(),
            alarm,
            since_s: alarm.map(|_| state.mismatch_since_s),
            residuals: RESIDUALS
                .iter()
                .zip(shares)
                .map(|(residual, share)| ResidualView { residual, share })
                .collect(),
            agrees,
        }
    }

    /// For the event log.
    pub fn words(&self) -> String {
        match self.alarm {
            Some(path) => {
                let since_s = self.since_s.unwrap_or(0.0);
                format!("the {path} path has changed since it was learnt what is usual, {since_s:.0} s ago")
            }
            None => "every path is again as it was when it was learnt what is usual".into(),
        }
    }
}

/// An estimated parameter.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ParameterEstimate {
    /// Name.
    #[schema(example = "lift_max")]
    pub name: String,
    /// Estimate.
    pub value: Option<f64>,
    /// SI unit.
    pub unit: String,
    /// Standard error; null if the estimator has none.
    pub std_error: Option<f64>,
}

/// A latched fault.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct FaultView {
    /// Stable code.
    #[schema(example = 4)]
    pub code: u32,
    /// Name.
    #[schema(example = "command_timeout")]
    pub name: &'static str,
    /// What to do, in a line; `GET /v1/faults/{code}` tells it all.
    pub help: &'static str,
    /// Which recording ended and why, where it is `recording_failed`; else null: name and help say it.
    pub cause: Option<String>,
    /// When it was latched, RFC 3339; null if the event log does not say.
    pub since: Option<String>,
    /// What the thruster did just before; null if that is not known.
    pub before: Option<BeforeView>,
}

/// What a thruster did just before a stop that nobody asked for.
#[derive(Clone, Copy, Debug, Serialize, ToSchema)]
pub struct BeforeView {
    /// Thrust, N; null if not measured.
    pub thrust_n: Option<f64>,
    /// Shaft speed, rad/s; null if not measured.
    pub shaft_speed_rad_s: Option<f64>,
}

/// A limit in force.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct LimitView {
    /// Name.
    #[schema(example = "current")]
    pub name: &'static str,
    /// What it does.
    pub meaning: &'static str,
    /// The setting that holds it.
    pub setting: &'static str,
}

/// Who has command.
#[derive(Clone, Debug, Serialize, ToSchema)]
pub struct LeaseView {
    /// Name the holder gave itself.
    #[schema(example = "bench")]
    pub holder: String,
    /// Life left, ms.
    #[schema(minimum = 0, maximum = 60000)]
    pub expires_in_ms: u64,
}

/// Signals by name, null where not measured; which ones is said by `proto/src/signals.rs`.
#[derive(Clone, Debug, Default)]
pub struct Values(Vec<(&'static str, f64)>);

impl Values {
    /// The signals of one kind.
    pub fn of_signals(kind: Kind, signals: &Signals) -> Values {
        Values(
            SIGNALS.iter().filter(|row| row.kind == kind).map(|row| (row.name, (row.get)(signals))).collect(),
        )
    }

    /// All estimates.
    pub fn of_estimates(estimates: &Estimates) -> Values {
        Values(ESTIMATES.iter().map(|row| (row.name, (row.get)(estimates))).collect())
    }
}

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (name, value) in &self.0 {
            // At rest a sensor that is mounted the other way round shows no minus zero.
            map.serialize_entry(name, &value.is_finite().then_some(value + 0.0))?;
        }
        map.end()
    }
}

fn values_object(rows: impl Iterator<Item = (&'static str, String)>) -> ObjectBuilder {
    rows.fold(ObjectBuilder::new(), |object, (name, description)| {
        object.property(name, nullable_number(&description)).required(name)
    })
}

fn nullable_number(description: &str) -> RefOr<Schema> {
    ObjectBuilder::new()
        .schema_type(SchemaType::from_iter([Type::Number, Type::Null]))
        .description(Some(description))
        .into()
}

fn signals_schema(kind: Kind) -> RefOr<Schema> {
    let rows = SIGNALS.iter().filter(|row| row.kind == kind);
    values_object(rows.map(|row| (row.name, format!("{} Unit: {}.", row.meaning, row.unit)))).into()
}

fn commanded_schema() -> RefOr<Schema> {
    signals_schema(Kind::Command)
}

fn measured_schema() -> RefOr<Schema> {
    signals_schema(Kind::Measured)
}

impl PartialSchema for Estimated {
    fn schema() -> RefOr<Schema> {
        values_object(ESTIMATES.iter().map(|row| (row.name, format!("{} Unit: {}.", row.meaning, row.unit))))
            .property("parameters", <Vec<ParameterEstimate>>::schema())
            .required("parameters")
            .into()
    }
}

impl ToSchema for Estimated {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        schemas.push((ParameterEstimate::name().into(), ParameterEstimate::schema()));
    }
}
