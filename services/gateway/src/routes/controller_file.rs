//! The controller that runs as a file of `config/controllers/`: saved, and put in force again, here or elsewhere.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::header;
use axum::response::IntoResponse;
use kort_control::{ControllerConfig, EstimatorKind, LawKind, ObserverKind, TUNABLES};
use kort_proto::messages::PARAMETERS;
use serde::Deserialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::{ControllerRequest, ControllerView, whole};
use crate::App;
use crate::extract::{Json, LeaseId, Path};
use crate::problem::{Kind, Problem};
use crate::token::Identity;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(save, load))
}

/// A controller to put in force.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"toml": "law = \"velocity_servo\"\n[laws.servo]\nphase_margin_deg = 60\n"}))]
pub struct ControllerFile {
    /// Text of a file of `config/controllers/`. What it leaves out takes its default.
    toml: String,
}

/// Law, observer, estimator and every parameter in force, as a file that `thrusters.ID.controller.file` and
/// `kort soak --controllers` take.
#[utoipa::path(get, path = "/v1/thrusters/{id}/controller/file", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "The file", body = String, content_type = "application/toml",
            headers(("content-disposition" = String, description = "Name to save it under"))),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: the controller is away", body = Problem, content_type = "application/problem+json")))]
async fn save(State(app): State<Arc<App>>, Path(id): Path<String>) -> Result<impl IntoResponse, Problem> {
    let runs = app.thruster(&id)?.controller()?;
    let text = in_force(&app, &id, &runs)?
        .to_toml()
        .map_err(|error| Problem::new(Kind::Internal, error.to_string()))?;
    let now = humantime::format_rfc3339_seconds(std::time::SystemTime::now());
    let about = format!(
        "# The controller of {id} as it ran at {now}, saved by kort {}.\n",
        env!("CARGO_PKG_VERSION")
    );
    let save_as = format!("attachment; filename=\"{id}-{}.toml\"", runs.controller);
    Ok((
        [(header::CONTENT_TYPE, "application/toml".to_owned()), (header::CONTENT_DISPOSITION, save_as)],
        about + &text,
    ))
}

/// Puts a controller file in force, bumpless, also under way. Needs the `Lease-Id` in force while somebody holds one.
#[utoipa::path(put, path = "/v1/thrusters/{id}/controller/file", tag = "command", request_body = ControllerFile,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force, if there is one")),
    responses(
        (status = 200, description = "The law that runs now", body = ControllerView),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`, `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`: not a controller file, a value out of range, or a key that only a start can change", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: the controller is away", body = Problem, content_type = "application/problem+json")))]
async fn load(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease): LeaseId,
    Json(ControllerFile { toml }): Json<ControllerFile>,
) -> Result<axum::Json<ControllerView>, Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    let invalid = |words: String| Problem::new(Kind::InvalidField, words);
    let wanted = ControllerConfig::from_toml_with_all(&toml).map_err(|wrong| {
        Problem::of_many(Kind::InvalidField, &wrong, "config/controllers has examples").within("toml")
    })?;
    let runs = in_force(&app, &id, &thruster.controller()?)?;
    if runs.tuned_as(&wanted) != wanted {
        return Err(invalid("toml: a key differs from what runs that is no parameter of a running controller: observers.use_thrust, observers.use_flow or laws.look_ahead.iterations".into())
            .hint(format!("name the file as thrusters.{id}.controller.file in kort.toml and start anew")));
    }
    let changed: Vec<(String, f64)> = TUNABLES
        .iter()
        .filter(|tunable| (tunable.get)(&wanted) != (tunable.get)(&runs))
        .map(|tunable| (tunable.name.to_owned(), (tunable.get)(&wanted)))
        .collect();
    // A message to the controller holds so many; kinds go with the first.
    let (first, more) = changed.split_at(changed.len().min(PARAMETERS));
    let mut requests = vec![ControllerRequest {
        controller: Some(wanted.law.name().to_owned()),
        observer: Some(wanted.observer.name().to_owned()),
        estimator: Some(wanted.estimator.name().to_owned()),
        parameters: first.iter().cloned().collect(),
    }];
    requests.extend(more.chunks(PARAMETERS).map(|part| ControllerRequest {
        controller: None,
        observer: None,
        estimator: None,
        parameters: part.iter().cloned().collect::<BTreeMap<_, _>>(),
    }));
    whole(async move {
        for request in &requests {
            thruster.set_controller(&who.name, lease.as_deref(), request).await?;
        }
        thruster.controller().map(axum::Json)
    })
    .await
}

/// The whole configuration that runs: what the deployment states, with what the controller tells of itself.
fn in_force(app: &App, id: &str, runs: &ControllerView) -> Result<ControllerConfig, Problem> {
    let mut config = *app.stated_controller(id)?;
    config.law = LawKind::from_name(&runs.controller).unwrap_or(config.law);
    config.observer = ObserverKind::from_name(&runs.observer).unwrap_or(config.observer);
    config.estimator = EstimatorKind::from_name(&runs.estimator).unwrap_or(config.estimator);
    for parameter in &runs.parameters {
        if let Some(value) = parameter.value {
            config
                .set(&parameter.name, value)
                .map_err(|error| Problem::new(Kind::Internal, error.to_string()))?;
        }
    }
    Ok(config)
}
