//! Starting, stopping, listing and fetching recordings.

use std::sync::Arc;

use axum::body::Body;
use axum::extract::{Extension, State};
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use kort_recording::Format;
use serde::Deserialize;
use tokio::io::AsyncReadExt;
use tokio_util::io::ReaderStream;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, Type};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

mod estimates;
mod text;

use crate::App;
use crate::extract::{Json, OptionalJson, Path, Query};
use crate::problem::{Kind, Problem};
use crate::record::{ENDING, RecordingInfo, TAGS_MAX, check_new_name, check_tags};
use crate::token::Identity;

/// Rows a second when the request names no rate.
pub const RATE_DEFAULT_HZ: f64 = 100.0;
const RATE_MAX_HZ: f64 = 5000.0;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new()
        .routes(routes!(list, start, stop))
        .routes(routes!(fetch, tag, remove))
        .routes(routes!(estimates::estimates))
}

/// What to record. Every field may be left out where there is one thruster, and so may the whole body.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"thruster": "t1", "name": "step-100-n", "rate_hz": 100}))]
pub struct RecordingRequest {
    /// Thruster to record; may be left out where there is one alone.
    #[serde(default)]
    thruster: Option<String>,
    /// Name of the recording; made of thruster and time if left out.
    #[serde(default)]
    #[schema(pattern = r"^(?!.*\.(csv|mcap|parquet)$)[A-Za-z0-9][A-Za-z0-9._-]{0,63}$")]
    name: Option<String>,
    /// Largest rate of rows, Hz; the servo's own rate if that is smaller.
    #[serde(default)]
    #[schema(minimum = 0.1, maximum = 5000, default = 100)]
    rate_hz: Option<f64>,
    /// Words to find it by.
    #[serde(default)]
    #[schema(schema_with = tags_schema)]
    tags: Vec<String>,
}

/// What a recording is found by, instead of what it had.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"tags": ["bollard", "new-propeller"]}))]
pub struct TagsRequest {
    /// All its tags; an empty list takes them away.
    #[schema(schema_with = tags_schema)]
    tags: Vec<String>,
}

pub fn tags_schema() -> Schema {
    let tag =
        ObjectBuilder::new().schema_type(Type::String).pattern(Some("^[A-Za-z0-9][A-Za-z0-9._-]{0,31}$"));
    let words =
        "1 to 32 letters, digits, dots, underscores or hyphens each; one that stands twice is kept once";
    ArrayBuilder::new().items(tag).max_items(Some(TAGS_MAX)).description(Some(words)).build().into()
}

/// Rows a second that can be asked for.
pub fn check_rate(rate_hz: f64) -> Result<(), Problem> {
    if (0.1..=RATE_MAX_HZ).contains(&rate_hz) {
        return Ok(());
    }
    Err(Problem::new(Kind::OutOfRange, format!("rate_hz = {rate_hz} is outside 0.1 to {RATE_MAX_HZ}"))
        .hint("the servo's own rate is the most that can be recorded"))
}

/// Which recordings.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct Which {
    /// Only those with this tag.
    #[param(example = "bollard")]
    tag: Option<String>,
}

/// Format of a recording's file.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct FormatQuery {
    /// `csv`, `parquet` or `mcap`; the name's ending decides if left out, else `mcap`.
    #[param(inline)]
    format: Option<FileFormat>,
}

/// A format recordings are written in.
#[derive(Clone, Copy, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum FileFormat {
    Csv,
    Mcap,
    Parquet,
}

impl FileFormat {
    /// Those that are told by a name's ending.
    const ALL: [FileFormat; 3] = [FileFormat::Csv, FileFormat::Mcap, FileFormat::Parquet];

    fn ending(self) -> &'static str {
        match self {
            FileFormat::Csv => "csv",
            FileFormat::Mcap => ENDING,
            FileFormat::Parquet => "parquet",
        }
    }

    fn content_type(self) -> &'static str {
        match self {
            FileFormat::Csv => "text/csv; charset=utf-8",
            FileFormat::Mcap => "application/octet-stream",
            FileFormat::Parquet => "application/vnd.apache.parquet",
        }
    }
}

/// Every recording, or those with a tag; oldest first.
#[utoipa::path(get, path = "/v1/recordings", tag = "recordings", params(Which),
    responses(
        (status = 200, description = "The recordings", body = [RecordingInfo]),
        (status = 400, description = "`malformed-query`", body = Problem, content_type = "application/problem+json")))]
async fn list(
    State(app): State<Arc<App>>,
    Query(Which { tag }): Query<Which>,
) -> Result<axum::Json<Vec<RecordingInfo>>, Problem> {
    let recorder = Arc::clone(app.recorder());
    let mut list = blocking(move || recorder.list()).await?;
    list.retain(|info| tag.as_ref().is_none_or(|tag| info.tags.contains(tag)));
    Ok(axum::Json(list))
}

/// Starts a recording; several may run at once, each under its name.
#[utoipa::path(post, path = "/v1/recordings", tag = "recordings", request_body = Option<RecordingRequest>,
    responses(
        (status = 201, description = "It runs", body = RecordingInfo),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`recording-active`: one of this name is there, or one of this thruster runs and no name was given", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    OptionalJson(request): OptionalJson<RecordingRequest>,
) -> Result<(StatusCode, axum::Json<RecordingInfo>), Problem> {
    let request = request.unwrap_or_default();
    if let Some(name) = &request.name {
        check_new_name("name", name)?;
    }
    let tags = check_tags(request.tags)?;
    let rate_hz = request.rate_hz.unwrap_or(RATE_DEFAULT_HZ);
    check_rate(rate_hz)?;
    let thruster = match (request.thruster, app.thrusters()) {
        (Some(id), _) => id,
        (None, [alone]) => alone.id.clone(),
        (None, several) => {
            let words = format!("missing field `thruster`: there are {}", several.len());
            return Err(Problem::new(Kind::InvalidField, words)
                .hint("name one, or record all with POST /v1/recording-sets")
                .allowed(several.iter().map(|thruster| thruster.id.clone())));
        }
    };
    let subject = app.subject(&thruster)?;
    let recorder = Arc::clone(app.recorder());
    let info = blocking(move || recorder.start(subject, &who, request.name, tags, rate_hz, None)).await??;
    Ok((StatusCode::CREATED, axum::Json(info)))
}

/// Stops the running recording; where several run, `DELETE /v1/recordings/{name}` says which.
#[utoipa::path(delete, path = "/v1/recordings", tag = "recordings",
    responses(
        (status = 200, description = "It is complete", body = RecordingInfo),
        (status = 403, description = "`role-too-low`: it belongs to another", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`no-recording`; `refused`: several run", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refused", body = Problem, content_type = "application/problem+json")))]
async fn stop(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
) -> Result<axum::Json<RecordingInfo>, Problem> {
    let recorder = Arc::clone(app.recorder());
    let stopped =
        blocking(move || match recorder.names_running().as_slice() {
            [] => Err(Problem::new(Kind::NoRecording, "no recording is running")
                .hint("POST /v1/recordings starts one")),
            [name] => recorder.stop(name, &who),
            several => Err(Problem::new(Kind::Refused, format!("{} recordings are running", several.len()))
                .hint("DELETE /v1/recordings/{name} stops one")
                .allowed(several.iter().cloned())),
        });
    stopped.await?.map(axum::Json)
}

/// Gives a recording its tags, also while it runs. Its owner may, or an admin.
#[utoipa::path(patch, path = "/v1/recordings/{name}", tag = "recordings", request_body = TagsRequest,
    params(("name" = String, Path, description = "Name of the recording", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "It has them now", body = RecordingInfo),
        (status = 400, description = "`malformed-path`, `malformed-json`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`role-too-low`: it belongs to another", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-recording`", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json")))]
async fn tag(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(name): Path<String>,
    Json(request): Json<TagsRequest>,
) -> Result<axum::Json<RecordingInfo>, Problem> {
    let tags = check_tags(request.tags)?;
    let recorder = Arc::clone(app.recorder());
    blocking(move || recorder.tag(&name, &who, tags)).await?.map(axum::Json)
}

/// Stops a recording that runs; deletes one that is done. Its owner may, or an admin.
///
/// A recording that went on in further files is stopped by the name it was started by, and by that of the file being written.
#[utoipa::path(delete, path = "/v1/recordings/{name}", tag = "recordings",
    params(("name" = String, Path, description = "Name of the recording", example = "t1-20260101T120000Z")),
    responses(
        (status = 200, description = "It ran, and is complete now", body = RecordingInfo),
        (status = 204, description = "It was done, and is deleted now"),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`role-too-low`: it belongs to another", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-recording`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refused", body = Problem, content_type = "application/problem+json")))]
async fn remove(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(name): Path<String>,
) -> Result<axum::response::Response, Problem> {
    let recorder = Arc::clone(app.recorder());
    let done = blocking(move || {
        let name = name.strip_suffix(".mcap").unwrap_or(&name);
        recorder.remove(name, &who)
    });
    Ok(match done.await?? {
        Some(info) => axum::Json(info).into_response(),
        None => StatusCode::NO_CONTENT.into_response(),
    })
}

/// Fetches a recording's file: `NAME`, `NAME.csv`, `NAME.parquet` or `NAME.mcap`. A running one is sent as far as it is written.
#[utoipa::path(get, path = "/v1/recordings/{name}", tag = "recordings",
    params(("name" = String, Path, description = "Name of the recording, with or without the ending", example = "t1-20260101T120000Z"),
           FormatQuery),
    responses(
        (status = 200, description = "The file", headers(("content-disposition" = String, description = "Name to save it under")),
            content((Vec<u8> = "application/octet-stream"), (Vec<u8> = "application/vnd.apache.parquet"), (String = "text/csv"))),
        (status = 400, description = "`malformed-path`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-recording`: there is none of this name, its file is gone, or nothing of it can be read yet", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`overloaded`: CSV and Parquet are made and sent to one reader at a time", body = Problem, content_type = "application/problem+json")))]
async fn fetch(
    State(app): State<Arc<App>>,
    Path(name): Path<String>,
    Query(FormatQuery { format }): Query<FormatQuery>,
) -> Result<axum::response::Response, Problem> {
    let (stem, ending) = FileFormat::ALL
        .into_iter()
        .find_map(|format| Some((name.strip_suffix(&format!(".{}", format.ending()))?, Some(format))))
        .unwrap_or((&name, None));
    let format = format.or(ending).unwrap_or(FileFormat::Mcap);
    let found = app.recorder().find(stem).map(|path| (path, stem));
    let Some((path, stem)) = found.or_else(|| Some((app.recorder().find(&name)?, name.as_str()))) else {
        return Err(absent(&app, stem).await);
    };
    let save_as = format!("attachment; filename=\"{stem}.{}\"", format.ending());
    let (length, body) = match format {
        FileFormat::Csv => text::other(path, Format::Csv).await?,
        FileFormat::Parquet => text::other(path, Format::Parquet).await?,
        FileFormat::Mcap => as_it_is(&path).await?,
    };
    let mut answer = (
        [(header::CONTENT_TYPE, format.content_type().to_owned()), (header::CONTENT_DISPOSITION, save_as)],
        body,
    )
        .into_response();
    if let Some(length) = length {
        answer.headers_mut().insert(header::CONTENT_LENGTH, length.into());
    }
    Ok(answer)
}

/// The file as far as it is written now; a running recording grows meanwhile.
async fn as_it_is(path: &std::path::Path) -> Result<(Option<usize>, Body), Problem> {
    let file = tokio::fs::File::open(path).await.map_err(|error| unreadable(path, error))?;
    let length = file.metadata().await.map_err(|error| unreadable(path, error))?.len();
    Ok((Some(length as usize), Body::from_stream(ReaderStream::new(file.take(length)))))
}

/// Why there is nothing to send.
async fn absent(app: &App, name: &str) -> Problem {
    let (recorder, name) = (Arc::clone(app.recorder()), name.to_owned());
    blocking(move || recorder.absent(&name)).await.unwrap_or_else(|problem| problem)
}

fn unreadable(path: &std::path::Path, error: impl std::fmt::Display) -> Problem {
    Problem::new(Kind::Internal, format!("{}: {error}", path.display()))
}

/// Work that waits for the disk.
pub async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, Problem> {
    tokio::task::spawn_blocking(work).await.map_err(|error| Problem::new(Kind::Internal, error.to_string()))
}
