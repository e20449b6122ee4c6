//! The event log.

use std::sync::Arc;

use axum::extract::State;
use kort_proto::events::Event;
use serde::{Deserialize, Serialize};
use time::OffsetDateTime;
use time::format_description::well_known::Rfc3339;
use utoipa::openapi::schema::{KnownFormat, ObjectBuilder, OneOfBuilder, Schema, SchemaFormat, Type};
use utoipa::{IntoParams, ToSchema};
use utoipa_axum::{router::OpenApiRouter, routes};

use crate::App;
use crate::extract::Query;
use crate::problem::{Kind, Problem};
use crate::view::BeforeView;

/// Events in one answer when the query names no limit, and at most.
const LIMIT_DEFAULT: usize = 200;
const LIMIT_MAX: usize = 5000;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(list))
}

/// Which events.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct Since {
    /// Only later ones: the `id` of an event, or a time in RFC 3339 (a `+` of its offset is `%2B` in an address).
    #[param(schema_with = since_schema, example = "2026-01-01T12:00:00Z")]
    since: Option<String>,
    /// At most so many: the first of those after `since`, the newest where it is left out.
    #[param(minimum = 1, maximum = 5000, default = 200)]
    limit: Option<usize>,
}

/// Something that happened.
#[derive(Serialize, ToSchema)]
struct EventView {
    /// Grows from event to event.
    id: u64,
    /// Wall time, RFC 3339.
    time: String,
    /// What happened.
    #[schema(value_type = String, example = "armed")]
    kind: kort_proto::events::EventKind,
    /// The thruster; null where it concerns all.
    thruster: Option<String>,
    /// Who did it: holder and token, the token's name where it is not the one that the lease was taken with, or a process.
    who: String,
    /// What exactly, in words.
    detail: String,
    /// Code of the fault, where it is about one.
    fault: Option<u32>,
    /// When it came about, RFC 3339, where that was long before it was told.
    since: Option<String>,
    /// How often it happened since then, where the same was repeated and is told once; else null.
    times: Option<u64>,
    /// What the thruster did just before a stop that nobody asked for.
    before: Option<BeforeView>,
}

impl From<Event> for EventView {
    fn from(event: Event) -> EventView {
        let Event { id, time, kind, thruster, who, detail, fault, since, times, before, .. } = event;
        let before =
            before.map(|b| BeforeView { thrust_n: b.thrust_n, shaft_speed_rad_s: b.shaft_speed_rad_s });
        EventView { id, time, kind, thruster, who, detail, fault, since, times, before }
    }
}

/// Who armed, took over, commanded and switched, what tripped and what restarted; oldest first.
///
/// Without `since` these are the newest. With it they are the first after it: who asks again with the `id` of the last one
/// misses none that is kept on the disk (five files of 1 MiB).
#[utoipa::path(get, path = "/v1/events", tag = "thrusters", params(Since),
    responses(
        (status = 200, description = "The events", body = [EventView]),
        (status = 400, description = "`malformed-query`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`out-of-range`: since, limit", body = Problem, content_type = "application/problem+json")))]
async fn list(
    State(app): State<Arc<App>>,
    Query(Since { since, limit }): Query<Since>,
) -> Result<axum::Json<Vec<EventView>>, Problem> {
    let limit = limit.unwrap_or(LIMIT_DEFAULT);
    if !(1..=LIMIT_MAX).contains(&limit) {
        return Err(Problem::new(Kind::OutOfRange, format!("limit = {limit} is outside 1 to {LIMIT_MAX}")));
    }
    let found = match since.as_deref().map(after).transpose()? {
        None => app.events().newest(limit),
        // May read files.
        Some(after) => tokio::task::spawn_blocking(move || app.events().after(after, limit))
            .await
            .map_err(|error| Problem::new(Kind::Internal, error.to_string()))?,
    };
    Ok(axum::Json(found.into_iter().map(EventView::from).collect()))
}

/// An id or a time: two schemas, so that a client's generator makes no word that is neither.
fn since_schema() -> Schema {
    let id = ObjectBuilder::new()
        .schema_type(Type::Integer)
        .minimum(Some(0))
        .maximum(Some(u64::MAX))
        .description(Some("the `id` of the last event that is known"));
    let time = ObjectBuilder::new()
        .schema_type(Type::String)
        .format(Some(SchemaFormat::KnownFormat(KnownFormat::DateTime)))
        .description(Some("wall time"));
    OneOfBuilder::new().item(id).item(time).into()
}

/// The id after which events are wanted: ids are microseconds of wall time.
fn after(since: &str) -> Result<u64, Problem> {
    if let Ok(id) = since.parse() {
        return Ok(id);
    }
    let time = OffsetDateTime::parse(since, &Rfc3339).map_err(|_| {
        Problem::new(Kind::OutOfRange, format!("since = {since:?} is neither the id of an event nor a time"))
            .hint("2026-01-01T12:00:00Z, or the id of the last event that is known")
    })?;
    // Before 1970 nothing happened.
    Ok(u64::try_from(time.unix_timestamp_nanos() / 1000).unwrap_or(0))
}
