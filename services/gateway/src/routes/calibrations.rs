//! Calibrations of a thruster: begun under the lease, gone on with stage by stage, aborted, read.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::analyses::blocking;
use crate::App;
use crate::calibration::CalibrationInfo;
use crate::extract::{Json, LeaseId, OptionalJson, Path};
use crate::problem::{Kind, Problem};
use crate::token::Identity;

/// Shares of the largest drive that may be asked for.
const SHARE: std::ops::RangeInclusive<f64> = 0.05..=1.0;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new()
        .routes(routes!(list, start))
        .routes(routes!(one, remove))
        .routes(routes!(go_on))
        .routes(routes!(rig))
        .routes(routes!(recording))
}

/// How to calibrate. The field may be left out, and so may the whole body.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"share": 0.2}))]
pub struct CalibrationRequest {
    /// Share of the largest drive that the session goes up to.
    #[serde(default = "half")]
    #[schema(minimum = 0.05, maximum = 1, default = 0.5)]
    share: f64,
}

fn half() -> f64 {
    0.5
}

/// Agreement to a stage.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"stage": "first_movement"}))]
pub struct GoOnRequest {
    /// The stage that is agreed to: the one that `asks` speaks of.
    stage: String,
}

/// A calibration with its report.
#[derive(Serialize, ToSchema)]
struct CalibrationView {
    #[serde(flatten)]
    info: CalibrationInfo,
    /// The document of `kort calibrate --json` (`kort.calibration/1`); null where there is none.
    #[schema(value_type = Object, nullable)]
    report: Value,
}

/// Every calibration of a thruster, oldest first.
#[utoipa::path(get, path = "/v1/thrusters/{id}/calibrations", tag = "calibrations",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "Every calibration that is kept", body = [CalibrationInfo]),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn list(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Result<axum::Json<Vec<CalibrationInfo>>, Problem> {
    app.thruster(&id)?;
    let calibrations = Arc::clone(app.calibrations());
    blocking(move || Ok(calibrations.list(&id))).await.map(axum::Json)
}

/// Begins a guided calibration on the thruster's drive, from the rig description in force. Nothing moves yet: each stage says
/// in `asks` what it is about to do and how far the shaft will turn, and waits for `…/go-on`. Needs the lease, and a
/// thruster that is disarmed; it ends at zero torque when the lease does, with DELETE, disarm, stop, or a fault.
#[utoipa::path(post, path = "/v1/thrusters/{id}/calibrations", tag = "calibrations", request_body = Option<CalibrationRequest>,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = String, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force")),
    responses(
        (status = 202, description = "It begins", body = CalibrationInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`calibration-active`; `lease-held`, `lease-lost`; `fault-latched`; `refused`: it is armed", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
    OptionalJson(request): OptionalJson<CalibrationRequest>,
) -> Result<(StatusCode, axum::Json<CalibrationInfo>), Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    let rig = Arc::clone(app.rig(&id)?);
    let share = request.map_or_else(half, |request| request.share);
    if !SHARE.contains(&share) {
        let words = format!("share = {share} is outside {} to {}", SHARE.start(), SHARE.end());
        return Err(Problem::new(Kind::OutOfRange, words).hint("leave it out for a half"));
    }
    let calibrations = Arc::clone(app.calibrations());
    let info =
        blocking(move || calibrations.start(&thruster, &rig, &who, lease_id.as_deref(), share)).await?;
    Ok((StatusCode::ACCEPTED, axum::Json(info)))
}

/// A calibration, how far it is, what it asks, and its report once it is over.
#[utoipa::path(get, path = "/v1/thrusters/{id}/calibrations/{calibration}", tag = "calibrations",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("calibration" = String, Path, description = "Name of the calibration", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The calibration", body = CalibrationView),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-calibration`", body = Problem, content_type = "application/problem+json")))]
async fn one(
    State(app): State<Arc<App>>,
    Path((id, calibration)): Path<(String, String)>,
) -> Result<axum::Json<CalibrationView>, Problem> {
    app.thruster(&id)?;
    let calibrations = Arc::clone(app.calibrations());
    let found = blocking(move || {
        let info = calibrations.find(&id, &calibration)?;
        let report = calibrations.report(&info);
        Ok(CalibrationView { info, report })
    });
    found.await.map(axum::Json)
}

/// Agrees to the stage that is asked for: the drive moves. Needs the lease.
#[utoipa::path(post, path = "/v1/thrusters/{id}/calibrations/{calibration}/go-on", tag = "calibrations", request_body = GoOnRequest,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("calibration" = String, Path, description = "Name of the calibration", example = "t1-20260101T120000Z"),
           ("Lease-Id" = String, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force")),
    responses(
        (status = 200, description = "It goes on", body = CalibrationInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`, `malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-calibration`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: it asks for another stage, or for none; `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`", body = Problem, content_type = "application/problem+json")))]
async fn go_on(
    State(app): State<Arc<App>>,
    Path((id, calibration)): Path<(String, String)>,
    LeaseId(lease_id): LeaseId,
    Json(request): Json<GoOnRequest>,
) -> Result<axum::Json<CalibrationInfo>, Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    let calibrations = Arc::clone(app.calibrations());
    let info =
        blocking(move || calibrations.go_on(&thruster, &calibration, lease_id.as_deref(), &request.stage));
    info.await.map(axum::Json)
}

/// Aborts a calibration that runs, at zero torque; deletes one that is past. Anybody may who may command, lease or not.
#[utoipa::path(delete, path = "/v1/thrusters/{id}/calibrations/{calibration}", tag = "calibrations",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("calibration" = String, Path, description = "Name of the calibration", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "It ran, and is at zero", body = CalibrationInfo),
        (status = 204, description = "It was past, and is deleted"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-calibration`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: the servo is away", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn remove(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path((id, calibration)): Path<(String, String)>,
) -> Result<Response, Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    let calibrations = Arc::clone(app.calibrations());
    let name = who.name.clone();
    let ended = blocking(move || calibrations.remove(&id, &calibration, &who)).await?;
    Ok(match ended {
        Some(info) => {
            if info.drives {
                thruster.disarm(&name).await?;
            }
            axum::Json(info).into_response()
        }
        None => StatusCode::NO_CONTENT.into_response(),
    })
}

/// The calibrated rig description; `POST …/rig` puts it in force.
#[utoipa::path(get, path = "/v1/thrusters/{id}/calibrations/{calibration}/rig", tag = "calibrations",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("calibration" = String, Path, description = "Name of the calibration", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The rig description", body = String, content_type = "application/toml"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-calibration`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: it did not come to its end", body = Problem, content_type = "application/problem+json")))]
async fn rig(State(app): State<Arc<App>>, Path(of): Path<(String, String)>) -> Result<Response, Problem> {
    file(&app, of, "calibrated.toml", "application/toml; charset=utf-8").await
}

/// The recording of the session, MCAP.
#[utoipa::path(get, path = "/v1/thrusters/{id}/calibrations/{calibration}/recording", tag = "calibrations",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("calibration" = String, Path, description = "Name of the calibration", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The recording", body = Vec<u8>, content_type = "application/octet-stream"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-calibration`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: it did not come to its end", body = Problem, content_type = "application/problem+json")))]
async fn recording(
    State(app): State<Arc<App>>,
    Path(of): Path<(String, String)>,
) -> Result<Response, Problem> {
    file(&app, of, "recording.mcap", "application/octet-stream").await
}

async fn file(
    app: &App,
    (id, calibration): (String, String),
    name: &'static str,
    kind: &'static str,
) -> Result<Response, Problem> {
    app.thruster(&id)?;
    let calibrations = Arc::clone(app.calibrations());
    let bytes = blocking(move || calibrations.file(&calibrations.find(&id, &calibration)?, name)).await?;
    Ok(([(header::CONTENT_TYPE, kind)], bytes).into_response())
}
