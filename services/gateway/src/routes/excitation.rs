//! Test signals on a thruster: previewed, played under the lease, followed, ended.

use std::sync::Arc;
use std::time::Instant;

use axum::extract::{Extension, State};
use axum::http::StatusCode;
use kort_scenario::{Command, Scenario, Segment};
use kort_thruster::models::ModelName;
use serde::de::Error;
use serde::{Deserialize, Deserializer};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::analysis::{DiagnosisInfo, Options};
use crate::excitation::{
    After, Commanded, ExcitationView, Prepared, Wanted, follow, from_scenario, without_replay,
};
use crate::extract::{Json, LeaseId, Path, Query};
use crate::problem::{Kind, Problem};
use crate::record::check_new_name;
use crate::token::Identity;

/// Rate of the rows recorded along, Hz.
const RECORDED_AT_HZ: f64 = 100.0;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(last, start, end))
}

/// A test signal: exactly one of `segments`, `toml` and `diagnosis`.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"command": "thrust_n", "limit": 60,
    "segments": [{"kind": "prbs", "amplitude": 20, "mean": 30, "each_s": 0.5, "duration_s": 30}]}))]
pub struct ExcitationRequest {
    /// Segments as in a scenario (`hold`, `steps`, `staircase`, `ramp`, `reversals`, `sine`, `chirp`, `multisine`, `prbs`,
    /// `random_levels`, `points`), one after the other; values in N or rad/s.
    #[serde(default, deserialize_with = "played")]
    #[schema(value_type = Option<Vec<Object>>)]
    segments: Option<Vec<Segment>>,
    /// A whole scenario file, TOML or JSON, by thrust, shaft speed or shares; shares are shares of `limit`. One with a
    /// `replay` is refused: replays are not played on a thruster.
    #[serde(default)]
    toml: Option<String>,
    /// Name of a diagnosis: the next experiment that it proposes is played and recorded, and the recording diagnosed
    /// together with the first.
    #[serde(default)]
    diagnosis: Option<String>,
    /// What the values command; thrust if left out. Not for a scenario that says so itself.
    #[serde(default)]
    command: Option<Commanded>,
    /// No setpoint goes beyond this either way; a signal that would is refused. The thruster's range if left out.
    #[serde(default)]
    limit: Option<f64>,
    /// Seed of random segments; the scenario's, or 1.
    #[serde(default)]
    #[schema(value_type = Option<i64>, minimum = 0, maximum = 4_294_967_295_u32)]
    seed: Option<u32>,
    /// Name of a recording made along with it.
    #[serde(default)]
    #[schema(pattern = r"^(?!.*\.(csv|mcap|parquet)$)[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    record: Option<String>,
    /// Record it, and diagnose the recording once the signal is complete.
    #[serde(default)]
    diagnose: Option<bool>,
}

/// Segments; who writes an unknown kind is not told of the one that is not played here.
fn played<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<Vec<Segment>>, D::Error> {
    let segments = Option::<Vec<serde_json::Value>>::deserialize(deserializer)?;
    let read = |one| {
        serde_json::from_value(one)
            .map_err(|error: serde_json::Error| D::Error::custom(without_replay(&error.to_string())))
    };
    segments.map(|all| all.into_iter().map(read).collect()).transpose()
}

/// How.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct How {
    /// Only say what it would do: nothing moves, no lease is needed.
    #[serde(default)]
    #[param(default = false)]
    dry_run: bool,
}

/// The test signal that plays, or how the last one ended; null if there was none since the gateway started.
#[utoipa::path(get, path = "/v1/thrusters/{id}/excitation", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "The test signal", body = Option<ExcitationView>),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn last(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Result<axum::Json<Option<ExcitationView>>, Problem> {
    let thruster = app.thruster(&id)?;
    let playing = thruster.desk().excitation().cloned();
    Ok(axum::Json(playing.map(|playing| ExcitationView::of(&playing, Instant::now()))))
}

/// Plays a test signal in place of the setpoint, under the lease, armed. It ends with a zero setpoint, and at once with
/// any of these: DELETE, a setpoint, stop, disarm, a fault, the end of the lease (renew it while it plays). It is never
/// taken up again. The controller's slew limits stay in force.
#[utoipa::path(post, path = "/v1/thrusters/{id}/excitation", tag = "command", request_body = ExcitationRequest,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), How,
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force; a dry run needs none")),
    responses(
        (status = 200, description = "What it would do (`dry_run`)", body = ExcitationView),
        (status = 201, description = "It plays", body = ExcitationView),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-diagnosis`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`lease-held`, `lease-lost`, `not-armed`, `fault-latched`, `excitation-active`, `recording-active`; `refused`: the diagnosis proposes no experiment", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    Query(How { dry_run }): Query<How>,
    LeaseId(lease_id): LeaseId,
    Json(request): Json<ExcitationRequest>,
) -> Result<(StatusCode, axum::Json<ExcitationView>), Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    if let Some(name) = &request.record {
        check_new_name("record", name)?;
    }
    let (diagnosis, record) = (request.diagnosis.clone(), request.record.clone());
    let diagnose = request.diagnose.unwrap_or(diagnosis.is_some());
    let (worker, range) = (Arc::clone(&app), thruster.range());
    let signal = blocking(move || Prepared::new(wanted(&worker, &id, request)?, range)).await?;
    if dry_run {
        return Ok((StatusCode::OK, axum::Json(ExcitationView::preview(&signal))));
    }
    // Before anything is recorded: may it be played at all?
    thruster.may_command(&mut thruster.desk(), lease_id.as_deref(), Instant::now())?;
    let recording = if diagnose || record.is_some() {
        let (recorder, subject, who) = (Arc::clone(app.recorder()), app.subject(&thruster.id)?, who.clone());
        let name = record.or_else(|| Some(format!("{}-{}", thruster.id, stamp())));
        let begun =
            blocking(move || recorder.start(subject, &who, name, Vec::new(), RECORDED_AT_HZ, None)).await?;
        Some(begun.name)
    } else {
        None
    };
    let begun = thruster.excite(&who.name, lease_id.as_deref(), Arc::new(signal), recording.clone());
    let number = match (begun, recording.clone()) {
        (Ok(number), _) => number,
        (Err(problem), None) => return Err(problem),
        (Err(problem), Some(name)) => {
            let (recorder, who) = (Arc::clone(app.recorder()), who.clone());
            blocking(move || recorder.stop(&name, &who).and_then(|_| recorder.remove(&name, &who))).await?;
            return Err(problem);
        }
    };
    if let Some(recording) = recording {
        let options = Options { model: ModelName::Model2.name().to_owned(), with: Vec::new(), seed: None };
        let diagnose = diagnose.then_some((options, diagnosis));
        let after = After { thruster: thruster.id.clone(), number, recording, diagnose, who };
        tokio::spawn(follow(Arc::clone(&app), after));
    }
    let playing = thruster.desk().excitation().cloned();
    let view = playing.map(|playing| ExcitationView::of(&playing, Instant::now()));
    view.map(|view| (StatusCode::CREATED, axum::Json(view)))
        .ok_or_else(|| Problem::new(Kind::Internal, "the test signal is gone"))
}

/// Ends the test signal that plays: the setpoint is zero, the lease lives on. Needs the `Lease-Id` in force while
/// somebody holds one; disarm and stop need none and end it too.
#[utoipa::path(delete, path = "/v1/thrusters/{id}/excitation", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force, if there is one")),
    responses(
        (status = 200, description = "It ended", body = Option<ExcitationView>),
        (status = 400, description = "`malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`no-excitation`, `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json")))]
async fn end(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
) -> Result<axum::Json<Option<ExcitationView>>, Problem> {
    let thruster = app.thruster(&id)?;
    thruster.end_excitation(&who.name, lease_id.as_deref())?;
    let playing = thruster.desk().excitation().cloned();
    Ok(axum::Json(playing.map(|playing| ExcitationView::of(&playing, Instant::now()))))
}

/// What the request asks for, from whichever of its three sources.
fn wanted(app: &App, id: &str, request: ExcitationRequest) -> Result<Wanted, Problem> {
    let ExcitationRequest { segments, toml, diagnosis, command, limit, seed, .. } = request;
    let mut wanted = match (segments, toml, diagnosis) {
        (Some(segments), None, None) => {
            let commanded = command.unwrap_or_default();
            let command = match commanded {
                Commanded::ThrustN => Command::ThrustCmdN,
                Commanded::SpeedRadS => Command::SpeedCmdRadS,
            };
            let scenario = Scenario { name: kinds(&segments), command, segments, ..Scenario::default() };
            from_scenario(scenario, Some(commanded), limit)
        }
        (None, Some(text), None) => {
            let scenario = Scenario::from_text_with_all(&text).map_err(|wrong| {
                let wrong: Vec<_> = wrong.iter().map(|wrong| without_replay(&wrong.to_string())).collect();
                Problem::of_many(Kind::InvalidField, &wrong, "")
                    .within("toml")
                    .hint("`kort simulate` runs the same files, and replays, which are not played on a thruster; docs/recordings.md lists their keys")
            })?;
            from_scenario(scenario, command, limit)
        }
        (None, None, Some(name)) => {
            let analyses = app.analyses();
            let first: DiagnosisInfo = analyses.find(id, &name)?;
            from_scenario(analyses.next_experiment(&first)?, command, limit)
        }
        _ => {
            return Err(Problem::new(
                Kind::InvalidField,
                "no signal, or several; allowed is exactly one of segments, toml and diagnosis",
            )
            .hint("{\"segments\": [{\"kind\": \"hold\", \"value\": 10, \"duration_s\": 5}]}"));
        }
    };
    wanted.seed = seed.map_or(wanted.seed, u64::from);
    Ok(wanted)
}

/// A signal without a name is called by its segments.
fn kinds(segments: &[Segment]) -> String {
    let mut names: Vec<&str> = segments.iter().map(Segment::kind).collect();
    names.dedup();
    names.truncate(4);
    names.join(", ")
}

fn stamp() -> String {
    let now = std::time::SystemTime::now();
    format!("experiment-{}", humantime::format_rfc3339_seconds(now).to_string().replace(['-', ':'], ""))
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?
}
