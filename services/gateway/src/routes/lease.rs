//! Taking, renewing and giving up command.

use std::sync::Arc;

use axum::extract::{Extension, State};
use axum::http::StatusCode;
use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize};
use utoipa::ToSchema;
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::extract::{Json, LeaseId, Path};
use crate::lease::{Lease, TTL_DEFAULT_MS, TTL_MAX_MS, Wanted};
use crate::problem::{Kind, Problem};
use crate::token::{Identity, PROCESSES};

const HOLDER_CHARS_MAX: usize = 64;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(take, renew, give))
}

/// Who wants command, and for how long.
#[derive(Deserialize, ToSchema)]
#[serde(deny_unknown_fields, expecting = "an object with holder")]
#[schema(example = json!({"holder": "bench", "ttl_ms": 10000}))]
pub struct LeaseRequest {
    /// Name shown to everybody else who asks: 1 to 64 characters, no control characters.
    #[schema(min_length = 1, max_length = 64, pattern = r"^[^\u0000-\u001f\u007f-\u009f]+$")]
    holder: String,
    /// Life of the lease without a command, ms.
    #[serde(default = "ttl_default_ms", deserialize_with = "whole_number")]
    #[schema(minimum = 1, maximum = 60000, default = 500)]
    ttl_ms: i64,
    /// Take command from whoever has it; the thruster goes to rest, its holder is told, and the event log says so.
    #[serde(default)]
    takeover: bool,
}

fn ttl_default_ms() -> i64 {
    TTL_DEFAULT_MS as i64
}

/// JSON knows one kind of number: 500.0 is as whole as 500.
fn whole_number<'de, D: Deserializer<'de>>(deserializer: D) -> Result<i64, D::Error> {
    let value = f64::deserialize(deserializer)?;
    // The range is checked later, with words of its own; what is negative or huge is outside of it.
    if value.fract() == 0.0 {
        Ok(value as i64)
    } else {
        Err(D::Error::custom(format!("ttl_ms = {value} is not a whole number of milliseconds")))
    }
}

/// A lease in force.
#[derive(Serialize, ToSchema)]
pub struct LeaseGrant {
    /// Send it as header `Lease-Id` with every command; keep it to yourself.
    #[schema(example = "6f1d3c0a9be24f7f8a52b0c1d2e3f405", pattern = "^[0-9a-f]{32}$")]
    lease_id: String,
    /// Life left, ms.
    #[schema(minimum = 0, maximum = 60000)]
    expires_in_ms: u64,
}

impl LeaseGrant {
    fn of(lease: &Lease, now: std::time::Instant) -> LeaseGrant {
        LeaseGrant { lease_id: lease.id.clone(), expires_in_ms: lease.expires_in_ms(now) }
    }
}

/// Controls, marks without width, and those that turn the direction of text: by them a name in console and log would be read as
/// another.
fn is_unseen(c: char) -> bool {
    let mark = matches!(
        c,
        '\u{ad}'
            | '\u{61c}'
            | '\u{180e}'
            | '\u{200b}'..='\u{200f}'
            | '\u{2028}'..='\u{202e}'
            | '\u{2060}'..='\u{206f}'
            | '\u{feff}'
            | '\u{fff9}'..='\u{fffb}'
            | '\u{e0000}'..='\u{e007f}'
    );
    c.is_control() || mark
}

/// Takes command. Every accepted command renews the lease; when it ends, thrust is ramped to zero.
#[utoipa::path(post, path = "/v1/thrusters/{id}/lease", tag = "command", request_body = LeaseRequest,
    params(("id" = String, Path, description = "Name of the thruster", example = "t1")),
    responses(
        (status = 201, description = "Command is yours", body = LeaseGrant),
        (status = 400, description = "`malformed-json`, `malformed-body`", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`lease-held`: another holder has it, `holder` says who", body = Problem, content_type = "application/problem+json"),
        (status = 413, description = "`body-too-large`", body = Problem, content_type = "application/problem+json"),
        (status = 415, description = "`unsupported-media-type`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`invalid-field`, `out-of-range`", body = Problem, content_type = "application/problem+json")))]
async fn take(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    Json(request): Json<LeaseRequest>,
) -> Result<(StatusCode, axum::Json<LeaseGrant>), Problem> {
    let thruster = app.thruster(&id)?;
    let (name, chars) = (&request.holder, request.holder.chars().count());
    if !(1..=HOLDER_CHARS_MAX).contains(&chars) || name.trim() != name || name.chars().any(is_unseen) {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("holder = {name:?} has {chars} characters; allowed are 1 to {HOLDER_CHARS_MAX}, no blank first or last, none that is not seen"),
        )
        .hint("a short name that others recognise, for example \"bench\""));
    }
    if PROCESSES.contains(&request.holder.as_str()) {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("holder = {:?} is what the event log calls a process of the service", request.holder),
        )
        .hint("a short name that others recognise, for example \"bench\""));
    }
    let Some(ttl_ms) = u64::try_from(request.ttl_ms).ok().filter(|ms| (1..=TTL_MAX_MS).contains(ms)) else {
        return Err(Problem::new(
            Kind::OutOfRange,
            format!("ttl_ms = {} is outside 1 to {TTL_MAX_MS}", request.ttl_ms),
        )
        .hint("a lease is renewed by every accepted command; it need not be long"));
    };
    let wanted = Wanted { holder: &request.holder, token: &who.name, ttl_ms, takeover: request.takeover };
    let (lease, now) = thruster.take_lease(&wanted).await?;
    Ok((StatusCode::CREATED, axum::Json(LeaseGrant::of(&lease, now))))
}

/// Renews the lease without commanding anything.
#[utoipa::path(put, path = "/v1/thrusters/{id}/lease", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = String, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force")),
    responses(
        (status = 200, description = "The lease lives on", body = LeaseGrant),
        (status = 400, description = "`malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json")))]
async fn renew(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
) -> Result<axum::Json<LeaseGrant>, Problem> {
    let (lease, now) = app.thruster(&id)?.renew_lease(lease_id.as_deref())?;
    Ok(axum::Json(LeaseGrant::of(&lease, now)))
}

/// Gives command up; thrust is ramped to zero.
#[utoipa::path(delete, path = "/v1/thrusters/{id}/lease", tag = "command",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"),
           ("Lease-Id" = String, Header, pattern = "^[!-~]+$", description = "The lease_id of the lease in force")),
    responses(
        (status = 204, description = "Nobody has command now"),
        (status = 400, description = "`malformed-header`", body = Problem, content_type = "application/problem+json"),
        (status = 403, description = "`lease-required`: header `Lease-Id` is missing", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 409, description = "`lease-held`, `lease-lost`", body = Problem, content_type = "application/problem+json")))]
async fn give(
    State(app): State<Arc<App>>,
    Extension(who): Extension<Identity>,
    Path(id): Path<String>,
    LeaseId(lease_id): LeaseId,
) -> Result<StatusCode, Problem> {
    app.thruster(&id)?.give_lease(&who.name, lease_id.as_deref())?;
    Ok(StatusCode::NO_CONTENT)
}
