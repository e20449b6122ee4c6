//! Diagnoses of a thruster: started on a recording or on the last minutes, followed, cancelled, read.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::{StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::analyses::{self, AnalysisRequest, blocking};
use crate::App;
use crate::analysis::DiagnosisInfo;
use crate::extract::{OptionalJson, Path};
use crate::problem::Problem;
use crate::token::Identity;

/// What the report's page may load: nothing but its own style and pictures.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
    form-action 'none'; frame-ancestors 'self'";

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(list, start)).routes(routes!(one, remove)).routes(routes!(page))
}

/// A diagnosis with its report.
#[derive(Serialize, ToSchema)]
struct DiagnosisView {
    #[serde(flatten)]
    info: DiagnosisInfo,
    /// The document of `kort diagnose --json` (`kort.diagnosis/2`); null until it is done.
    #[schema(value_type = Object, nullable)]
    report: Value,
}

/// Every diagnosis of a thruster, oldest first.
#[utoipa::path(get, path = "/v1/thrusters/{id}/diagnoses", tag = "diagnoses",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "Every diagnosis that is kept", body = [DiagnosisInfo]),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn list(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Result<axum::Json<Vec<DiagnosisInfo>>, Problem> {
    analyses::list(&app, id).await
}

/// Begins to diagnose a recording, or the last minutes, against the rig description in force: what did the model leave
/// out? It runs in a process of its own behind everything else, one at a time of diagnoses and fits together; the state
/// tells its steps. Needs the role pilot, and no lease.
#[utoipa::path(post, path = "/v1/thrusters/{id}/diagnoses", tag = "diagnoses", request_body = Option<AnalysisRequest>,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 202, description = "It runs", body = DiagnosisInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-recording`; `unknown-diagnosis`: the one that it comes after", body = Problem, content_type = "application/problem+json"),
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
) -> Result<(StatusCode, axum::Json<DiagnosisInfo>), Problem> {
    analyses::start(app, who, id, request).await
}

/// A diagnosis, how far it is, and its report once it is done.
#[utoipa::path(get, path = "/v1/thrusters/{id}/diagnoses/{diagnosis}", tag = "diagnoses",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("diagnosis" = String, Path, description = "Name of the diagnosis", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The diagnosis", body = DiagnosisView),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-diagnosis`", body = Problem, content_type = "application/problem+json")))]
async fn one(
    State(app): State<Arc<App>>,
    Path((id, diagnosis)): Path<(String, String)>,
) -> Result<axum::Json<DiagnosisView>, Problem> {
    let (info, report) = analyses::one(&app, id, diagnosis).await?;
    Ok(axum::Json(DiagnosisView { info, report }))
}

/// The report as one self-contained page.
#[utoipa::path(get, path = "/v1/thrusters/{id}/diagnoses/{diagnosis}/report", tag = "diagnoses",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("diagnosis" = String, Path, description = "Name of the diagnosis", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "The page", body = String, content_type = "text/html"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-diagnosis`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: it has no report", body = Problem, content_type = "application/problem+json")))]
async fn page(
    State(app): State<Arc<App>>,
    Path((id, diagnosis)): Path<(String, String)>,
) -> Result<impl IntoResponse, Problem> {
    app.thruster(&id)?;
    let analyses = Arc::clone(app.analyses());
    let page = blocking(move || analyses.page(&analyses.find::<DiagnosisInfo>(&id, &diagnosis)?)).await?;
    Ok(([(header::CONTENT_SECURITY_POLICY, POLICY)], Html(page)))
}

/// Cancels a diagnosis that runs; deletes one that is past. Its owner may, or an admin.
#[utoipa::path(delete, path = "/v1/thrusters/{id}/diagnoses/{diagnosis}", tag = "diagnoses",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("diagnosis" = String, Path, description = "Name of the diagnosis", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "It ran, and is cancelled", body = DiagnosisInfo),
        (status = 204, description = "It was past, and is deleted"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`role-too-low`: it belongs to another", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-diagnosis`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn remove(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path((id, diagnosis)): Path<(String, String)>,
) -> Result<Response, Problem> {
    analyses::remove::<DiagnosisInfo>(&app, who, id, diagnosis).await
}
