//! Commanding thrust or shaft speed.

use std::sync::Arc;

use axum::extract::{Extension, State};
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::extract::{Json, LeaseId, Path};
use crate::problem::Problem;
use crate::token::Identity;
use crate::view::Setpoint;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(put))
}

/// An accepted setpoint.
#[derive(Serialize, ToSchema)]
struct Accepted {
    /// The setpoint now in force.
    setpoint: Setpoint,
    /// Life of the renewed lease, ms.
    #[schema(minimum = 0, maximum = 60000)]
    expires_in_ms: u64,
}

/// Commands thrust or shaft speed, and renews the lease. The thruster must be armed.
#[utoipa::path(put, path = "/v1/thrusters/{id}/setpoint", tag = "command", request_body = Setpoint,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = String, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force")),
    responses(
        (status = 200, description = "In force", body = Accepted),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`lease-held`, `lease-lost`, `not-armed`, `fault-latched`", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json")))]
async fn put(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
    Json(setpoint): Json<Setpoint>,
) -> Result<axum::Json<Accepted>, Problem> {
    let (lease, now) = app.thruster(&id)?.command(&who.name, lease_id.as_deref(), setpoint)?;
    Ok(axum::Json(Accepted { setpoint, expires_in_ms: lease.expires_in_ms(now) }))
}
