//! Is the gateway alive, and can it command?

use std::sync::Arc;

use axum::extract::State;
use serde::Serialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::problem::Problem;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(healthz)).routes(routes!(readyz))
}

/// The gateway's own state.
#[derive(Serialize, ToSchema)]
struct Health {
    /// `ok` whenever an answer comes at all.
    #[schema(example = "ok")]
    status: &'static str,
}

/// Is the gateway process alive? Says nothing of servo and controller.
#[utoipa::path(get, path = "/healthz", tag = "health",
    responses((status = 200, description = "The gateway answers", body = Health)))]
async fn healthz() -> axum::Json<Health> {
    axum::Json(Health { status: "ok" })
}

/// Can thrusters be commanded? 503 with the reason while servo or controller is away.
#[utoipa::path(get, path = "/readyz", tag = "health",
    responses(
        (status = 200, description = "Servo and controller of every thruster are heard", body = Health),
        (status = 503, description = "`not-ready`: which process is away", body = Problem, content_type = "application/problem+json")))]
async fn readyz(State(app): State<Arc<App>>) -> Result<axum::Json<Health>, Problem> {
    for thruster in app.thrusters() {
        thruster.ready()?;
    }
    Ok(axum::Json(Health { status: "ok" }))
}
