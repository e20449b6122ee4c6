//! The state of thrusters.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::State;
use axum::http::header;
use axum::response::{IntoResponse, Response};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::extract::Path;
use crate::problem::Problem;
use crate::view::ThrusterState;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(list)).routes(routes!(one))
}

/// The state of every thruster.
#[utoipa::path(get, path = "/v1/thrusters", tag = "thrusters",
    responses((status = 200, description = "Every thruster of the configuration", body = [ThrusterState])))]
async fn list(State(app): State<Arc<App>>) -> Response {
    let states: Vec<Bytes> = app.thrusters().iter().map(|thruster| thruster.state_json()).collect();
    let mut body = b"[".to_vec();
    body.extend(states.join(&b","[..]));
    body.push(b']');
    json(body.into())
}

/// The state of one thruster: setpoint, measured and estimated values, controller, faults, lease.
#[utoipa::path(get, path = "/v1/thrusters/{id}", tag = "thrusters",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "The thruster's state", body = ThrusterState),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn one(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<Response, Problem> {
    Ok(json(app.thruster(&id)?.state_json()))
}

pub fn json(body: Bytes) -> Response {
    ([(header::CONTENT_TYPE, "application/json")], body).into_response()
}
