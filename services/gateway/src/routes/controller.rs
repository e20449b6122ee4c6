//! Which control law runs, and its parameters.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::{Extension, State};
use kort_control::{EstimatorKind, LawKind, ObserverKind, TUNABLES};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{AdditionalProperties, ObjectBuilder, Schema, SchemaType, Type};
use utoipa_axum::{router::OpenApiRouter, routes};

use super::whole;
use crate::App;
use crate::extract::{Json, LeaseId, Path};
use crate::problem::Problem;
use crate::token::Identity;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(get, put))
}

/// The control law that runs.
#[derive(Serialize, ToSchema)]
pub struct ControllerView {
    /// Its name.
    #[schema(example = "velocity_servo")]
    pub controller: String,
    /// Observer beside it.
    pub observer: String,
    /// Estimator beside it.
    pub estimator: String,
    /// Its parameters.
    pub parameters: Vec<LawParameter>,
    /// Every law that can be chosen.
    pub available: Vec<String>,
    /// Every observer that can be chosen.
    pub observers: Vec<&'static str>,
    /// Every estimator that can be chosen.
    pub estimators: Vec<&'static str>,
}

/// A parameter of a control law.
#[derive(Serialize, ToSchema)]
pub struct LawParameter {
    /// Name.
    pub name: String,
    /// Value in force.
    pub value: Option<f64>,
    /// SI unit.
    pub unit: String,
    /// Smallest allowed value; null if not bounded.
    pub low: Option<f64>,
    /// Largest allowed value; null if not bounded.
    pub high: Option<f64>,
}

/// A law to switch to, parameters to change, or both.
#[derive(Clone, Debug, Default, PartialEq, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"controller": "velocity_servo"}))]
pub struct ControllerRequest {
    /// Law to switch to; left out or null keeps the present one.
    #[serde(default, alias = "name")]
    #[schema(schema_with = law_schema)]
    pub controller: Option<String>,
    /// Observer to switch to; left out or null keeps the present one.
    #[serde(default)]
    #[schema(schema_with = observer_schema)]
    pub observer: Option<String>,
    /// Estimator to switch to; left out or null keeps the present one.
    #[serde(default)]
    #[schema(schema_with = estimator_schema)]
    pub estimator: Option<String>,
    /// Parameters to change, by name; the others keep their value.
    #[serde(default)]
    #[schema(schema_with = parameters_schema)]
    pub parameters: BTreeMap<String, f64>,
}

fn names_schema(names: impl Iterator<Item = &'static str>) -> RefOr<Schema> {
    let names = names.map(serde_json::Value::from).chain([serde_json::Value::Null]);
    let kinds = SchemaType::from_iter([Type::String, Type::Null]);
    ObjectBuilder::new().schema_type(kinds).enum_values(Some(names)).into()
}

fn law_schema() -> RefOr<Schema> {
    names_schema(LawKind::ALL.into_iter().map(LawKind::name))
}

fn observer_schema() -> RefOr<Schema> {
    names_schema(ObserverKind::ALL.into_iter().map(ObserverKind::name))
}

fn estimator_schema() -> RefOr<Schema> {
    names_schema(EstimatorKind::ALL.into_iter().map(EstimatorKind::name))
}

fn parameters_schema() -> RefOr<Schema> {
    let none = ObjectBuilder::new().additional_properties(Some(AdditionalProperties::FreeForm(false)));
    TUNABLES
        .iter()
        .fold(none, |object, tunable| {
            let number = ObjectBuilder::new()
                .schema_type(Type::Number)
                .description(Some(format!("{} Unit: {}.", tunable.what, tunable.unit)))
                .minimum(Some(tunable.least))
                .maximum(Some(tunable.most));
            object.property(tunable.name, number)
        })
        .into()
}

/// Which control law runs, its parameters, and the laws to choose from.
#[utoipa::path(get, path = "/v1/thrusters/{id}/controller", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "The control law", body = ControllerView),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: the controller is away", body = Problem, content_type = "application/problem+json")))]
async fn get(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Result<axum::Json<ControllerView>, Problem> {
    Ok(axum::Json(app.thruster(&id)?.controller()?))
}

/// Switches the control law, bumpless, also under way. Needs the `Lease-Id` in force while somebody holds one.
#[utoipa::path(put, path = "/v1/thrusters/{id}/controller", tag = "command", request_body = ControllerRequest,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force, if there is one")),
    responses(
        (status = 200, description = "The law that runs now", body = ControllerView),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`, `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`unknown-controller`, `invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: the controller is away", body = Problem, content_type = "application/problem+json")))]
async fn put(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
    Json(request): Json<ControllerRequest>,
) -> Result<axum::Json<ControllerView>, Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    whole(async move {
        thruster.set_controller(&who.name, lease_id.as_deref(), &request).await?;
        thruster.controller().map(axum::Json)
    })
    .await
}
