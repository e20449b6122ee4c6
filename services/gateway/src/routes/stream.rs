//! The state, many times a second, over a WebSocket that also takes setpoints.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::State;
use axum::extract::ws::{
    Message, Utf8Bytes, WebSocket, WebSocketUpgrade, rejection::WebSocketUpgradeRejection,
};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use tokio::time::MissedTickBehavior;
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::thrusters::json;
use crate::App;
use crate::extract::{Path, Query};
use crate::problem::{Kind, Problem};
use crate::thruster::Thruster;
use crate::view::{Setpoint, ThrusterState};

const HZ_MAX: f64 = 500.0;
const MESSAGE_BYTES_MAX: usize = 4096;
/// A message up to this size is still read, so that it can be answered; a longer one ends the connection.
const MESSAGE_BYTES_READ: usize = 1 << 20;

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(stream))
}

/// How often.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct Rate {
    /// States a second.
    #[serde(default = "hz_default")]
    #[param(minimum = 0.1, maximum = 500, default = 50, example = 50)]
    hz: f64,
}

fn hz_default() -> f64 {
    50.0
}

/// What a client may send.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with setpoint and lease_id")]
struct Incoming {
    setpoint: Setpoint,
    lease_id: String,
}

/// The thruster's state as a WebSocket stream: one text message with a `ThrusterState` per period.
///
/// The client may send `{"setpoint": {"thrust_n": 25.0}, "lease_id": "…"}`; what is refused is answered by one
/// problem document. A plain GET, without the WebSocket handshake, is answered by one state.
#[utoipa::path(get, path = "/v1/thrusters/{id}/stream", tag = "thrusters",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), Rate),
    responses(
        (status = 101, description = "WebSocket: states flow at the asked rate"),
        (status = 200, description = "No WebSocket handshake: the state now", body = ThrusterState),
        (status = 400, description = "`malformed-query`, `malformed-header`: the handshake is broken", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`out-of-range`: hz", body = Problem, content_type = "application/problem+json"),
        (status = 426, description = "`upgrade-required`: this connection cannot be upgraded", body = Problem, content_type = "application/problem+json")))]
async fn stream(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Query(Rate { hz }): Query<Rate>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    use WebSocketUpgradeRejection as Rejection;
    let thruster = Arc::clone(app.thruster(&id)?);
    if !(0.1..=HZ_MAX).contains(&hz) {
        return Err(Problem::new(Kind::OutOfRange, format!("hz = {hz} is outside 0.1 to {HZ_MAX}"))
            .hint("50 is plenty for eyes"));
    }
    match upgrade {
        Ok(upgrade) => Ok(upgrade
            .max_message_size(MESSAGE_BYTES_READ)
            .on_upgrade(move |socket| serve(app, thruster, socket, Duration::from_secs_f64(1.0 / hz)))
            .into_response()),
        Err(Rejection::InvalidConnectionHeader(_) | Rejection::InvalidUpgradeHeader(_)) => {
            Ok(json(thruster.state_json()))
        }
        Err(Rejection::ConnectionNotUpgradable(_)) => {
            Err(Problem::new(Kind::UpgradeRequired, "this connection cannot become a WebSocket")
                .hint("use HTTP/1.1"))
        }
        Err(other) => Err(Problem::new(Kind::MalformedHeader, other.body_text())),
    }
}

async fn serve(app: Arc<App>, thruster: Arc<Thruster>, mut socket: WebSocket, period: Duration) {
    let mut tick = tokio::time::interval(period);
    tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut stop = app.stopping();
    loop {
        let message = tokio::select! {
            _ = tick.tick() => text(&thruster.state_json()),
            received = socket.recv() => match received {
                Some(Ok(Message::Text(body))) => match command(&thruster, &body) {
                    Ok(()) => continue,
                    Err(problem) => text(&serde_json::to_vec(&problem).unwrap_or_default()),
                },
                Some(Ok(Message::Binary(_))) => text(&serde_json::to_vec(
                    &Problem::new(Kind::MalformedBody, "a binary message came; commands are JSON in text messages")).unwrap_or_default()),
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => continue,
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
            },
            _ = stop.changed() => Message::Close(None),
        };
        let last = matches!(message, Message::Close(_));
        if socket.send(message).await.is_err() || last {
            return;
        }
    }
}

fn command(thruster: &Thruster, body: &str) -> Result<(), Problem> {
    if body.len() > MESSAGE_BYTES_MAX {
        return Err(Problem::new(
            Kind::BodyTooLarge,
            format!("the message has {} bytes; allowed are {MESSAGE_BYTES_MAX}", body.len()),
        )
        .hint("no command needs that much"));
    }
    let incoming: Incoming = serde_json::from_str(body).map_err(|error| {
        let kind = if error.is_data() { Kind::InvalidField } else { Kind::MalformedJson };
        Problem::new(kind, error.to_string())
            .hint(r#"send {"setpoint": {"thrust_n": 25.0}, "lease_id": "…"}"#)
    })?;
    thruster.command(Some(&incoming.lease_id), incoming.setpoint).map(|_| ())
}

fn text(json: &[u8]) -> Message {
    Message::Text(Utf8Bytes::from(String::from_utf8_lossy(json).as_ref()))
}
