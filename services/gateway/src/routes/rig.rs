//! The rig description in force, its revisions, and the way back.

use std::sync::Arc;

use axum::body::Bytes;
use axum::extract::{DefaultBodyLimit, Extension, FromRequest, Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::{Deserialize, Serialize};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

use super::whole;
use crate::App;
use crate::analysis::{Analysis, DiagnosisInfo, FitInfo};
use crate::extract::{Json, LeaseId, Path, Query};
use crate::problem::{Kind, Problem};
use crate::rig::{Asker, Entry, Making, Revised, Revision, RigDesk};
use crate::token::Identity;

/// Largest rig description, bytes: the shipped ones have up to four thousand.
const RIG_BYTES_MAX: usize = 256 * 1024;
/// Longest note.
const NOTE_CHARS_MAX: usize = 500;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new()
        .routes(routes!(current, revise))
        .routes(routes!(roll_back))
        .routes(routes!(list))
        .routes(routes!(one))
        .layer(DefaultBodyLimit::max(RIG_BYTES_MAX))
}

/// A revision with its text.
#[derive(Serialize, ToSchema)]
struct RigView {
    #[serde(flatten)]
    entry: Entry,
    /// Is it the one in force?
    in_force: bool,
    /// The rig description, TOML.
    toml: String,
}

/// A revision in the list.
#[derive(Serialize, ToSchema)]
struct RevisionView {
    #[serde(flatten)]
    entry: Entry,
    /// Is it the one in force?
    in_force: bool,
}

/// A revision to put in force: exactly one of `toml`, `diagnosis`, `fit` and `revision`.
#[derive(Default, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object")]
#[schema(example = json!({"revision": 1, "note": "the friction was the cable's"}))]
pub struct RigRequest {
    /// A whole rig description, TOML.
    #[serde(default)]
    toml: Option<String>,
    /// Name of a diagnosis: the rig that it was compared with, and what it found.
    #[serde(default)]
    diagnosis: Option<String>,
    /// Name of a fit: the rig that it was compared with, and the values that it found.
    #[serde(default)]
    fit: Option<String>,
    /// Number of a revision that is kept.
    #[serde(default)]
    #[schema(minimum = 1)]
    revision: Option<u32>,
    /// Words to keep with it.
    #[serde(default)]
    #[schema(max_length = 500)]
    note: Option<String>,
}

/// How.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct How {
    /// Check and compare only: nothing changes.
    #[serde(default)]
    #[param(default = false)]
    dry_run: bool,
}

/// As what.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct FormatQuery {
    /// `json`, or the bare text as `toml`.
    #[serde(default)]
    #[param(inline)]
    format: Format,
}

/// A format of an answer.
#[derive(Clone, Copy, Default, PartialEq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
enum Format {
    #[default]
    Json,
    Toml,
}

/// A body that is a rig description, or a JSON object that names one.
pub struct RigBody(RigRequest);

impl<S: Send + Sync> FromRequest<S> for RigBody {
    type Rejection = Problem;

    async fn from_request(request: Request, state: &S) -> Result<RigBody, Problem> {
        let kind = request.headers().get(header::CONTENT_TYPE).and_then(|kind| kind.to_str().ok());
        let plain = kind.is_some_and(|kind| {
            let kind = kind.split(';').next().unwrap_or_default().trim();
            ["application/toml", "text/plain", "text/x-toml"]
                .iter()
                .any(|known| kind.eq_ignore_ascii_case(known))
        });
        let told = |problem: Problem| match problem.status() {
            StatusCode::PAYLOAD_TOO_LARGE => {
                Problem::new(Kind::BodyTooLarge, format!("the body is larger than {RIG_BYTES_MAX} bytes"))
                    .hint("a rig description has some thousand bytes")
            }
            _ => problem,
        };
        if !plain {
            return Json::from_request(request, state).await.map(|Json(body)| RigBody(body)).map_err(told);
        }
        let bytes = Bytes::from_request(request, state).await.map_err(|rejection| told(rejection.into()))?;
        let toml = String::from_utf8(bytes.into()).map_err(|_| {
            Problem::new(Kind::InvalidRig, "the rig description is not UTF-8").hint("save the file as UTF-8")
        })?;
        Ok(RigBody(RigRequest { toml: Some(toml), ..RigRequest::default() }))
    }
}

/// The rig description in force.
#[utoipa::path(get, path = "/v1/thrusters/{id}/rig", tag = "rig",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), FormatQuery),
    responses(
        (status = 200, description = "The revision in force", content((RigView = "application/json"), (String = "application/toml"))),
        (status = 400, description = "`malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn current(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Query(FormatQuery { format }): Query<FormatQuery>,
) -> Result<Response, Problem> {
    let desk = app.rig(&id)?;
    Ok(shown(desk, desk.book().current(), format))
}

/// Every revision that was ever put in force, oldest first.
#[utoipa::path(get, path = "/v1/thrusters/{id}/rig/revisions", tag = "rig",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 200, description = "Every revision", body = [RevisionView]),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json")))]
async fn list(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
) -> Result<axum::Json<Vec<RevisionView>>, Problem> {
    let (entries, current) = app.rig(&id)?.book().entries();
    let shown = entries.into_iter().map(|entry| RevisionView { in_force: entry.number == current, entry });
    Ok(axum::Json(shown.collect()))
}

/// One revision with its text.
#[utoipa::path(get, path = "/v1/thrusters/{id}/rig/revisions/{number}", tag = "rig",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("number" = u32, Path, description = "Number of the revision", example = 1), FormatQuery),
    responses(
        (status = 200, description = "The revision", content((RigView = "application/json"), (String = "application/toml"))),
        (status = 400, description = "`malformed-path`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-revision`", body = Problem, content_type = "application/problem+json")))]
async fn one(
    State(app): State<Arc<App>>,
    Path((id, number)): Path<(String, u32)>,
    Query(FormatQuery { format }): Query<FormatQuery>,
) -> Result<Response, Problem> {
    let desk = app.rig(&id)?;
    Ok(shown(desk, kept(desk, number)?, format))
}

/// Puts a revision of the rig description in force, bumpless, also under way: checked as `kort check` does, and what
/// differs is shown. The body is the text itself (`text/plain` or `application/toml`), or JSON that names a revision.
/// With `dry_run=true` nothing changes. Needs the role admin, and the `Lease-Id` in force while somebody holds one.
#[utoipa::path(post, path = "/v1/thrusters/{id}/rig", tag = "rig",
    request_body(content((RigRequest = "application/json"), (String = "text/plain"), (String = "application/toml"))),
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), How,
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force, if there is one")),
    responses(
        (status = 200, description = "What is in force now, and what differs", body = Revised),
        (status = 400, description = "`malformed-json`, `malformed-body`, `malformed-header`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`, `unknown-diagnosis`, `unknown-fit`, `unknown-revision`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: the drive is of another kind, or the diagnosis or fit has nothing for the revision in force; `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-rig`, `invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses; nothing has changed", body = Problem, content_type = "application/problem+json")))]
async fn revise(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    Query(How { dry_run }): Query<How>,
    LeaseId(lease): LeaseId,
    RigBody(body): RigBody,
) -> Result<axum::Json<Revised>, Problem> {
    let desk = app.rig(&id)?;
    let chars = body.note.as_ref().map(|note| note.chars().count());
    if let Some(long) = chars.filter(|chars| *chars > NOTE_CHARS_MAX) {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("note has {long} characters; at most {NOTE_CHARS_MAX} are allowed"),
        )
        .hint("make it shorter"));
    }
    let (text, source) = wanted(&app, &id, &body)?;
    let making = Making { source, who: who.name.clone(), note: body.note };
    let (desk, asker) = (Arc::clone(desk), Asker { who: who.name, lease });
    whole(async move { desk.revise(&asker, &text, making, dry_run).await.map(axum::Json) }).await
}

/// Goes back to the revision that was in force before the present one, bumpless. With `dry_run=true` nothing changes. Needs
/// the role admin, and the `Lease-Id` in force while somebody holds one.
#[utoipa::path(post, path = "/v1/thrusters/{id}/rig/rollback", tag = "rig",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), How,
           ("Lease-Id" = Option<String>, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force, if there is one")),
    responses(
        (status = 200, description = "What is in force now, and what differs", body = Revised),
        (status = 400, description = "`malformed-header`, `malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`refused`: there is no revision before; `lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-rig`: this kort does not take the revision before any more", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`not-ready`: servo or controller is away", body = Problem, content_type = "application/problem+json"),
        (status = 507, description = "`storage-failed`: the disk refuses; nothing has changed", body = Problem, content_type = "application/problem+json")))]
async fn roll_back(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    Query(How { dry_run }): Query<How>,
    LeaseId(lease): LeaseId,
) -> Result<axum::Json<Revised>, Problem> {
    let (desk, asker) = (Arc::clone(app.rig(&id)?), Asker { who: who.name, lease });
    whole(async move { desk.roll_back(&asker, dry_run).await.map(axum::Json) }).await
}

/// The text that a request names, and where it comes from.
fn wanted(app: &App, id: &str, body: &RigRequest) -> Result<(String, String), Problem> {
    let desk = app.rig(id)?;
    match (&body.toml, &body.diagnosis, &body.fit, body.revision) {
        (Some(toml), None, None, None) => Ok((toml.clone(), "file".into())),
        (None, Some(name), None, None) => found::<DiagnosisInfo>(app, desk, id, name),
        (None, None, Some(name), None) => found::<FitInfo>(app, desk, id, name),
        (None, None, None, Some(number)) => {
            let (entry, text) = kept(desk, number)?;
            Ok((text.to_string(), format!("revision {}", entry.number)))
        }
        _ => Err(Problem::new(Kind::InvalidField, "exactly one of toml, diagnosis, fit and revision must be there")
            .hint("send the file itself as text/plain, or {\"toml\": \"…\"}, {\"diagnosis\": \"…\"}, {\"fit\": \"…\"}, {\"revision\": 1}")),
    }
}

/// What an analysis found, for the revision in force.
fn found<A: Analysis>(app: &App, desk: &RigDesk, id: &str, name: &str) -> Result<(String, String), Problem> {
    let info: A = app.analyses().find(id, name)?;
    let text = app.analyses().found(&info, &desk.book().current().0.revision)?;
    Ok((text, format!("{} {name}", A::KIND.entry().name)))
}

fn kept(desk: &RigDesk, number: u32) -> Result<Revision, Problem> {
    desk.book().revision(number).ok_or_else(|| {
        let (entries, _) = desk.book().entries();
        Problem::new(Kind::UnknownRevision, format!("there is no revision {number} of the rig"))
            .hint("GET …/rig/revisions lists them")
            .allowed(entries.iter().map(|entry| entry.number.to_string()))
    })
}

fn shown(desk: &RigDesk, (entry, text): Revision, format: Format) -> Response {
    if format == Format::Toml {
        return ([(header::CONTENT_TYPE, "application/toml")], text.to_string()).into_response();
    }
    let in_force = entry.number == desk.book().current().0.number;
    axum::Json(RigView { entry, in_force, toml: text.to_string() }).into_response()
}
