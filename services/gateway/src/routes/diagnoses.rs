//! Diagnoses of a thruster: started on a recording or on the last minutes, followed, cancelled, read.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::{StatusCode, header};
use axum::response::{Html, IntoResponse, Response};
use kort_thruster::effects;
use kort_thruster::models::ModelName;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::RefOr;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, Type};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::diagnosis::{DiagnosisInfo, Options, Subject};
use crate::extract::{OptionalJson, Path};
use crate::problem::{Kind, Problem};
use crate::record::RecordingState;
use crate::token::Identity;

/// Of the last so many seconds, when the request names neither time nor recording.
const LAST_DEFAULT_S: f64 = 300.0;
const LAST_MAX_S: f64 = 3600.0;
/// Fewer rows cannot be diagnosed at all.
const ROWS_MIN: usize = 100;
/// Effects taken as present at most.
const WITH_MAX: usize = 8;

/// What the report's page may load: nothing but its own style and pictures.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; \
    form-action 'none'; frame-ancestors 'self'";

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(list, start)).routes(routes!(one, remove)).routes(routes!(page))
}

/// What to diagnose: a recording, or the last seconds. Every field may be left out, and so may the whole body.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"last_s": 120}))]
pub struct DiagnosisRequest {
    /// Name of a recording of this thruster.
    #[serde(default)]
    #[schema(pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    recording: Option<String>,
    /// The last so many seconds, as far as the gateway kept them.
    #[serde(default)]
    #[schema(minimum = 1, maximum = 3600, default = 300)]
    last_s: Option<f64>,
    /// Name of an earlier diagnosis: its recordings are fitted together with this one.
    #[serde(default)]
    after: Option<String>,
    /// Model to compare with; model2 if left out.
    #[serde(default = "model_default")]
    #[schema(schema_with = model_schema)]
    model: String,
    /// Effects taken as present and fitted with the model, by their ids.
    #[serde(default)]
    #[schema(schema_with = with_schema)]
    with: Vec<String>,
    /// Seed of everything drawn at random; 1 if left out.
    #[serde(default)]
    seed: Option<u64>,
}

fn model_default() -> String {
    ModelName::Model2.name().to_owned()
}

fn model_schema() -> RefOr<Schema> {
    ObjectBuilder::new()
        .schema_type(Type::String)
        .enum_values(Some(ModelName::ALL.map(ModelName::name)))
        .into()
}

fn with_schema() -> RefOr<Schema> {
    let ids = effects::ALL.iter().map(|effect| effect.id);
    let effect = ObjectBuilder::new().schema_type(Type::String).enum_values(Some(ids));
    ArrayBuilder::new().items(effect).max_items(Some(WITH_MAX)).into()
}

impl Default for DiagnosisRequest {
    fn default() -> DiagnosisRequest {
        DiagnosisRequest {
            recording: None,
            last_s: None,
            after: None,
            model: model_default(),
            with: Vec::new(),
            seed: None,
        }
    }
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
    app.thruster(&id)?;
    let diagnoses = Arc::clone(app.diagnoses());
    blocking(move || Ok(diagnoses.list(&id))).await.map(axum::Json)
}

/// Begins to diagnose a recording, or the last minutes, against the rig description in force: what did the model leave
/// out? It runs in a process of its own behind everything else, one at a time; the state tells its steps.
#[utoipa::path(post, path = "/v1/thrusters/{id}/diagnoses", tag = "diagnoses", request_body = Option<DiagnosisRequest>,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 202, description = "It runs", body = DiagnosisInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-recording`; `unknown-diagnosis`: the one that it comes after", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`diagnosis-active`; `recording-active`: it still runs; `no-recording`: nothing was heard of this thruster yet; `refused`: the recording is another thruster's", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    OptionalJson(request): OptionalJson<DiagnosisRequest>,
) -> Result<(StatusCode, axum::Json<DiagnosisInfo>), Problem> {
    let thruster = Arc::clone(app.thruster(&id)?);
    let rig = Arc::clone(app.rig(&id)?);
    let request = request.unwrap_or_default();
    let options = options(&request)?;
    let after = request.after;
    let subject = match (request.recording, request.last_s) {
        (Some(_), Some(_)) => {
            return Err(Problem::new(
                Kind::InvalidField,
                "both recording and last_s; allowed is one of them",
            )
            .hint("leave one of them out"));
        }
        (Some(name), None) => {
            let theirs = Arc::clone(&app);
            blocking(move || recording(&theirs, &id, name)).await?
        }
        (None, last_s) => last(&app, &id, last_s.unwrap_or(LAST_DEFAULT_S)).await?,
    };
    let diagnoses = Arc::clone(app.diagnoses());
    let info =
        blocking(move || diagnoses.start(&thruster, &rig, &who, subject, after.as_deref(), options)).await?;
    Ok((StatusCode::ACCEPTED, axum::Json(info)))
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
    app.thruster(&id)?;
    let diagnoses = Arc::clone(app.diagnoses());
    let found = blocking(move || {
        let info = diagnoses.find(&id, &diagnosis)?;
        let report = diagnoses.report(&info);
        Ok(DiagnosisView { info, report })
    });
    found.await.map(axum::Json)
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
    let diagnoses = Arc::clone(app.diagnoses());
    let page = blocking(move || diagnoses.page(&diagnoses.find(&id, &diagnosis)?)).await?;
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
    app.thruster(&id)?;
    let diagnoses = Arc::clone(app.diagnoses());
    let done = blocking(move || diagnoses.remove(&id, &diagnosis, &who)).await?;
    Ok(match done {
        Some(info) => axum::Json(info).into_response(),
        None => StatusCode::NO_CONTENT.into_response(),
    })
}

fn options(request: &DiagnosisRequest) -> Result<Options, Problem> {
    if request.model.parse::<ModelName>().is_err() {
        return Err(Problem::new(Kind::OutOfRange, format!("model = {:?} is no model", request.model))
            .hint("leave it out for model2")
            .allowed(ModelName::ALL.map(ModelName::name)));
    }
    if request.with.len() > WITH_MAX {
        let words = format!("with has {} entries; at most {WITH_MAX} are allowed", request.with.len());
        return Err(Problem::new(Kind::OutOfRange, words));
    }
    if let Some(odd) = request.with.iter().find(|id| effects::find(id).is_none()) {
        return Err(Problem::new(Kind::OutOfRange, format!("with names {odd:?}, which is no effect"))
            .hint("`kort explain` lists the catalogue")
            .allowed(effects::ALL.iter().map(|effect| effect.id)));
    }
    Ok(Options { model: request.model.clone(), with: request.with.clone(), seed: request.seed })
}

/// A recording that is whole, and this thruster's.
fn recording(app: &App, thruster: &str, name: String) -> Result<Subject, Problem> {
    let known = app.recorder().list().into_iter().find(|info| info.name == name);
    let file = app.recorder().find(&name);
    let (Some(info), Some(file)) = (known, file) else {
        return Err(Problem::new(Kind::UnknownRecording, format!("there is no recording {name:?}"))
            .hint("GET /v1/recordings lists them; {\"last_s\": 300} takes the last minutes without one"));
    };
    if info.thruster != thruster {
        return Err(Problem::new(
            Kind::Refused,
            format!("recording {name:?} is of thruster {}, not of {thruster}", info.thruster),
        )
        .hint(format!("POST /v1/thrusters/{}/diagnoses", info.thruster)));
    }
    if info.state == RecordingState::Recording {
        return Err(Problem::new(Kind::RecordingActive, format!("recording {name:?} still runs"))
            .hint("DELETE /v1/recordings stops it; {\"last_s\": 300} takes the last minutes as they are"));
    }
    Ok(Subject::Recording(name, file))
}

/// The last seconds, as far as they were kept.
async fn last(app: &App, thruster: &str, last_s: f64) -> Result<Subject, Problem> {
    if !(1.0..=LAST_MAX_S).contains(&last_s) {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("last_s = {last_s} is outside 1 to {LAST_MAX_S}"),
        )
        .hint("gateway.diagnosis.ring_time_s says how much is kept"));
    }
    let rows = app.ring(thruster)?.last(last_s).await;
    if rows.len() < ROWS_MIN {
        return Err(Problem::new(
            Kind::NoRecording,
            format!("only {} rows of thruster {thruster} are at hand; {ROWS_MIN} are needed", rows.len()),
        )
        .hint(
            "drive it for a while, with setpoints that move; GET /readyz says whether its servo is heard",
        ));
    }
    let span_s = match (rows.first(), rows.last()) {
        (Some((first, _)), Some((last, _))) => (last - first) as f64 * 1e-9,
        _ => 0.0,
    };
    Ok(Subject::Last(span_s, rows))
}

/// Does what may wait for the disk beside the runtime.
pub async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, Problem> + Send + 'static,
) -> Result<T, Problem> {
    let done = tokio::task::spawn_blocking(work).await;
    done.map_err(|error| Problem::new(Kind::Internal, error.to_string()))?
}
