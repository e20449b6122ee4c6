//! Fits of the model to a thruster: started on a recording or on the last minutes, followed, cancelled, read.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::analyses::{self, AnalysisRequest, blocking};
use crate::App;
use crate::analysis::FitInfo;
use crate::extract::{OptionalJson, Path};
use crate::problem::Problem;
use crate::token::Identity;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(list, start)).routes(routes!(one, remove)).routes(routes!(rig))
}

/// A fit with its report.
#[derive(Serialize, ToSchema)]
struct FitView {
    #[serde(flatten)]
    info: FitInfo,
    /// The document of `kort fit --json` (`kort.fit/1`); null until it is done.
    #[schema(value_type = Object, nullable)]
    report: Value,
}

/// Every fit of a thruster, oldest first.
#[utoipa::path(get, path = "/v1/thrusters/{id}/fits", tag = "fits",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "Every fit that is kept", body = [FitInfo]),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn list(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Result<axum::Json<Vec<FitInfo>>, Problem> {
    analyses::list(&app, id).await
}

/// Begins to fit a recording, or the last minutes: which values of the model's parameters, within what the rig description
/// in force states of them, go with what was measured? It runs in a process of its own behind everything else, one at a time
/// of diagnoses and fits together; the state tells its steps. Needs the role pilot, and no lease.
#[utoipa::path(post, path = "/v1/thrusters/{id}/fits", tag = "fits", request_body = Option<AnalysisRequest>,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 202, description = "It runs", body = FitInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-recording`; `unknown-fit`: the one that it comes after", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`diagnosis-active`, `fit-active`: one runs; `recording-active`: it still runs; `no-recording`: nothing was heard of this thruster yet; `refused`: the recording is another thruster's", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    OptionalJson(request): OptionalJson<AnalysisRequest>,
) -> Result<(StatusCode, axum::Json<FitInfo>), Problem> {
    analyses::start(app, who, id, request).await
}

/// A fit, how far it is, and its report once it is done.
#[utoipa::path(get, path = "/v1/thrusters/{id}/fits/{fit}", tag = "fits",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("fit" = String, Path, description = "Name of the fit", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The fit", body = FitView),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-fit`", body = Problem, content_type = "application/problem+json")))]
async fn one(
    State(app): State<Arc<App>>,
    Path((id, fit)): Path<(String, String)>,
) -> Result<axum::Json<FitView>, Problem> {
    let (info, report) = analyses::one(&app, id, fit).await?;
    Ok(axum::Json(FitView { info, report }))
}

/// The rig description with the fitted values, each with twice its standard error as tolerance; `POST …/rig` with the fit's
/// name puts it in force.
#[utoipa::path(get, path = "/v1/thrusters/{id}/fits/{fit}/rig", tag = "fits",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("fit" = String, Path, description = "Name of the fit", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The rig description", body = String, content_type = "application/toml"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-fit`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: it did not come to its end", body = Problem, content_type = "application/problem+json")))]
async fn rig(
    State(app): State<Arc<App>>,
    Path((id, fit)): Path<(String, String)>,
) -> Result<impl IntoResponse, Problem> {
    app.thruster(&id)?;
    let analyses = Arc::clone(app.analyses());
    let text = blocking(move || analyses.rig(&analyses.find::<FitInfo>(&id, &fit)?)).await?;
    Ok(([(header::CONTENT_TYPE, "application/toml; charset=utf-8")], text))
}

/// Cancels a fit that runs; deletes one that is past. Its owner may, or an admin.
#[utoipa::path(delete, path = "/v1/thrusters/{id}/fits/{fit}", tag = "fits",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("fit" = String, Path, description = "Name of the fit", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "It ran, and is cancelled", body = FitInfo),
        (status = 204, description = "It was past, and is deleted"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`role-too-low`: it belongs to another", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-fit`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn remove(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path((id, fit)): Path<(String, String)>,
) -> Result<Response, Problem> {
    analyses::remove::<FitInfo>(&app, who, id, fit).await
}
