//! Arming, disarming, clearing faults. Each answers once servo and controller have done it.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::response::Response;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::thrusters::json;
use super::whole;
use crate::App;
use crate::extract::{LeaseId, Path};
use crate::problem::Problem;
use crate::token::Identity;
use crate::view::ThrusterState;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(arm)).routes(routes!(disarm)).routes(routes!(clear_faults))
}

/// Arms the drive, at zero: only a setpoint that comes after moves it. Needs the `Lease-Id` in force.
#[utoipa::path(post, path = "/v1/thrusters/{id}/arm", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = String, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force")),
    responses(
        (status = 200, description = "Armed", body = ThrusterState),
        (status = 400, description = "`malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`fault-latched`, `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json")))]
async fn arm(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
) -> Result<Response, Problem> {
    let thruster = app.thruster(&id)?;
    thruster.arm(&who.name, lease_id.as_deref()).await?;
    Ok(json(thruster.state_json()))
}

/// Disarms: zero torque at once. Anybody may, with or without the lease.
#[utoipa::path(post, path = "/v1/thrusters/{id}/disarm", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "Disarmed", body = ThrusterState),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: the servo is away", body = Problem, content_type = "application/problem+json")))]
async fn disarm(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
) -> Result<Response, Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    // Who asked is told also where nobody waits for the answer.
    whole(async move {
        thruster.disarm(&who.name).await?;
        Ok(json(thruster.state_json()))
    })
    .await
}

/// Clears latched faults whose cause is gone. The thruster stays disarmed. Needs the `Lease-Id` in force while somebody holds one.
#[utoipa::path(post, path = "/v1/thrusters/{id}/clear-faults", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force, if there is one")),
    responses(
        (status = 200, description = "No fault is latched", body = ThrusterState),
        (status = 400, description = "`malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`fault-latched`: the cause is still there; `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json")))]
async fn clear_faults(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
) -> Result<Response, Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    whole(async move {
        thruster.clear_faults(&who.name, lease_id.as_deref()).await?;
        Ok(json(thruster.state_json()))
    })
    .await
}
