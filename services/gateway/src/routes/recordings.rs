//! Starting, stopping, listing and fetching recordings.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use serde::Deserialize;
use tokio_util::io::ReaderStream;
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::extract::{OptionalJson, Path, Query};
use crate::problem::{Kind, Problem};
use crate::record::{FORMATS, RecordingInfo, is_name};

/// Rows a second when the request names no rate.
const RATE_DEFAULT_HZ: f64 = 100.0;
const RATE_MAX_HZ: f64 = 5000.0;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(list, start, stop)).routes(routes!(fetch))
}

/// What to record. Every field may be left out, and so may the whole body.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"thruster": "t1", "name": "step-100-n", "rate_hz": 100}))]
struct RecordingRequest {
    /// Thruster to record; the first of the configuration if left out.
    #[serde(default)]
    #[schema(nullable = false)]
    thruster: Option<String>,
    /// Name of the recording; made of thruster and time if left out.
    #[serde(default)]
    #[schema(pattern = "^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    name: Option<String>,
    /// Largest rate of rows, Hz; the servo's own rate if that is smaller.
    #[serde(default)]
    #[schema(minimum = 0.1, maximum = 5000, default = 100)]
    rate_hz: Option<f64>,
}

/// Format of a recording's file.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct FormatQuery {
    /// `csv` or `mcap`; the name's ending decides if left out, else `mcap`.
    #[param(inline)]
    format: Option<FileFormat>,
}

/// A format recordings are written in.
#[derive(Clone, Copy, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum FileFormat {
    Csv,
    Mcap,
}

/// Every recording, oldest first.
#[utoipa::path(get, path = "/v1/recordings", tag = "recordings",
    responses((status = 200, description = "Every recording", body = [RecordingInfo])))]
async fn list(State(app): State<Arc<App>>) -> Result<axum::Json<Vec<RecordingInfo>>, Problem> {
    let recorder = Arc::clone(app.recorder());
    blocking(move || recorder.list()).await.map(axum::Json)
}

/// Starts a recording; at most one runs.
#[utoipa::path(post, path = "/v1/recordings", tag = "recordings", request_body = Option<RecordingRequest>,
    responses(
        (status = 201, description = "It runs", body = RecordingInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`recording-active`: one is running, or has this name", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    OptionalJson(request): OptionalJson<RecordingRequest>,
) -> Result<(StatusCode, axum::Json<RecordingInfo>), Problem> {
    let request = request.unwrap_or_default();
    if let Some(name) = request.name.as_ref().filter(|name| !is_name(name)) {
        return Err(Problem::new(Kind::OutOfRange, format!("name = {name:?} is not allowed"))
            .hint("1 to 64 letters, digits, dots, underscores or hyphens; the first a letter or digit"));
    }
    let rate_hz = request.rate_hz.unwrap_or(RATE_DEFAULT_HZ);
    if !(0.1..=RATE_MAX_HZ).contains(&rate_hz) {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("rate_hz = {rate_hz} is outside 0.1 to {RATE_MAX_HZ}"),
        )
        .hint("the servo's own rate is the most that can be recorded"));
    }
    let thruster = match request.thruster {
        Some(id) => app.thruster(&id)?.id.clone(),
        None => app.thrusters().first().map(|thruster| thruster.id.clone()).unwrap_or_default(),
    };
    let recorder = Arc::clone(app.recorder());
    let info = blocking(move || recorder.start(&thruster, request.name, rate_hz)).await??;
    Ok((StatusCode::CREATED, axum::Json(info)))
}

/// Stops the running recording.
#[utoipa::path(delete, path = "/v1/recordings", tag = "recordings",
    responses(
        (status = 200, description = "It is complete", body = RecordingInfo),
        (status = 409, description = "`no-recording`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refused", body = Problem, content_type = "application/problem+json")))]
async fn stop(State(app): State<Arc<App>>) -> Result<axum::Json<RecordingInfo>, Problem> {
    let recorder = Arc::clone(app.recorder());
    blocking(move || recorder.stop()).await?.map(axum::Json)
}

/// Fetches a recording's file: `NAME`, `NAME.csv` or `NAME.mcap`. A running one is sent as far as it is written.
#[utoipa::path(get, path = "/v1/recordings/{name}", tag = "recordings",
    params(("name" = String, Path, description = "Name of the recording, with or without the ending", example = "t1-20260101T120000Z"),
           FormatQuery),
    responses(
        (status = 200, description = "The file", headers(("content-disposition" = String, description = "Name to save it under")),
            content((Vec<u8> = "application/octet-stream"), (String = "text/csv"))),
        (status = 400, description = "`malformed-path`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-recording`", body = Problem, content_type = "application/problem+json")))]
async fn fetch(
    State(app): State<Arc<App>>,
    Path(name): Path<String>,
    Query(FormatQuery { format }): Query<FormatQuery>,
) -> Result<impl IntoResponse, Problem> {
    let asked = format.map(|format| match format {
        FileFormat::Csv => "csv",
        FileFormat::Mcap => "mcap",
    });
    let (stem, ending) = FORMATS
        .iter()
        .find_map(|format| Some((name.strip_suffix(&format!(".{format}"))?, Some(*format))))
        .unwrap_or((&name, None));
    let format = asked.or(ending).unwrap_or("mcap");
    let path = app.recorder().find(stem, format).or_else(|| app.recorder().find(&name, format)).ok_or_else(
        || {
            Problem::new(Kind::UnknownRecording, format!("there is no recording {name:?}"))
                .hint("GET /v1/recordings lists them")
        },
    )?;
    let file = tokio::fs::File::open(&path)
        .await
        .map_err(|error| Problem::new(Kind::Internal, format!("{}: {error}", path.display())))?;
    let kind = if format == "csv" { "text/csv; charset=utf-8" } else { "application/octet-stream" };
    let save_as = format!("attachment; filename=\"{stem}.{format}\"");
    Ok((
        [(header::CONTENT_TYPE, kind.to_owned()), (header::CONTENT_DISPOSITION, save_as)],
        Body::from_stream(ReaderStream::new(file)),
    ))
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
    tokio::task::spawn_blocking(work).await.map_err(|error| Problem::new(Kind::Internal, error.to_string()))
}
