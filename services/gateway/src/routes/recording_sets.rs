//! One recording of every thruster.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::StatusCode;
use serde::Deserialize;
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::recordings::{RATE_DEFAULT_HZ, blocking, check_rate, tags_schema};
use crate::App;
use crate::extract::{OptionalJson, Path};
use crate::problem::{Kind, Problem};
use crate::record::{RecordingSet, check_new_name, check_tags};
use crate::token::Identity;

/// Longest name: a hyphen and a thruster's id make a recording's of it.
const NAME_MAX: usize = 47;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(start)).routes(routes!(stop))
}

/// How to record. Every field may be left out, and so may the whole body.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"name": "dive-1", "rate_hz": 100}))]
pub struct RecordingSetRequest {
    /// Name of the set; made of the time if left out. Its recordings are called `NAME-THRUSTER`.
    #[serde(default)]
    #[schema(pattern = r"^(?!.*\.(csv|mcap|parquet)$)[A-Za-z0-9][A-Za-z0-9._-]{0,46}$")]
    name: Option<String>,
    /// Largest rate of rows, Hz; the servo's own rate if that is smaller.
    #[serde(default)]
    #[schema(minimum = 0.1, maximum = 5000, default = 100)]
    rate_hz: Option<f64>,
    /// Words to find them by.
    #[serde(default)]
    #[schema(schema_with = tags_schema)]
    tags: Vec<String>,
}

/// Starts a recording of every thruster at one instant: their `time_s` counts from the same zero.
#[utoipa::path(post, path = "/v1/recording-sets", tag = "recordings", request_body = Option<RecordingSetRequest>,
    responses(
        (status = 201, description = "They run", body = RecordingSet),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`recording-active`: one of such a name is there; none was started", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refuses", body = Problem, content_type = "application/problem+json")))]
async fn start(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    OptionalJson(request): OptionalJson<RecordingSetRequest>,
) -> Result<(StatusCode, axum::Json<RecordingSet>), Problem> {
    let request = request.unwrap_or_default();
    if let Some(name) = &request.name {
        check_new_name("name", name)?;
        if name.len() > NAME_MAX {
            let words = format!("name has {} characters, more than {NAME_MAX}", name.len());
            return Err(Problem::new(Kind::OutOfRange, words).hint("a thruster's id is put behind it"));
        }
    }
    let tags = check_tags(request.tags)?;
    let rate_hz = request.rate_hz.unwrap_or(RATE_DEFAULT_HZ);
    check_rate(rate_hz)?;
    let subjects: Result<Vec<_>, _> =
        app.thrusters().iter().map(|thruster| app.subject(&thruster.id)).collect();
    let (subjects, recorder) = (subjects?, Arc::clone(app.recorder()));
    let started =
        blocking(move || recorder.start_set(subjects, &who, request.name, &tags, rate_hz)).await??;
    Ok((StatusCode::CREATED, axum::Json(started)))
}

/// Stops the recordings of a set.
#[utoipa::path(delete, path = "/v1/recording-sets/{name}", tag = "recordings",
    params(("name" = String, Path, description = "Name of the set", example = "dive-1")),
    responses(
        (status = 200, description = "They are complete", body = RecordingSet),
        (status = 400, description = "`malformed-path`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`role-too-low`: they belong to another", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`no-recording`: none of this set runs", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`recording-failed`: the disk refused", body = Problem, content_type = "application/problem+json")))]
async fn stop(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(name): Path<String>,
) -> Result<axum::Json<RecordingSet>, Problem> {
    let recorder = Arc::clone(app.recorder());
    blocking(move || recorder.stop_set(&name, &who)).await?.map(axum::Json)
}
