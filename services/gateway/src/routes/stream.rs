//! The state, many times a second, over a WebSocket that also takes setpoints.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use axum::extract::ws::{
    CloseFrame, Message, Utf8Bytes, WebSocket, WebSocketUpgrade, rejection::WebSocketUpgradeRejection,
};
use axum::extract::{Extension, State};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use tokio::time::MissedTickBehavior;
use utoipa::IntoParams;
use utoipa_axum::{router::OpenApiRouter, routes};

use super::thrusters::json;
use crate::App;
use crate::extract::{Object, Path, Query};
use crate::problem::{Kind, Problem};
use crate::serve::Seat;
use crate::thruster::Thruster;
use crate::token::{Identity, Role};
use crate::view::{Setpoint, ThrusterState};

const HZ_MAX: f64 = 500.0;
const MESSAGE_BYTES_MAX: usize = 4096;
/// A message up to this size is still read, so that it can be answered; a longer one ends the connection.
const MESSAGE_BYTES_READ: usize = 1 << 20;

/// What the console offers beside its token.
const PROTOCOL: &str = "kort";
/// The client is asked whether it keeps up as often as it is sent states, within these bounds: what it has read, it alone
/// can say, for what lies in its own kernel's buffer counts as taken.
const PING_EVERY: [Duration; 2] = [Duration::from_millis(100), Duration::from_secs(1)];
/// A ping that stays unanswered for so long ends the stream.
const CLOSE_AFTER: Duration = Duration::from_secs(3);
/// A ping that is answered so much later than this client's quickest was: the client is behind, and is sent no more
/// states. With the ping's period it bounds what a reader that pauses finds when it goes on.
const BEHIND_AFTER: Duration = Duration::from_millis(100);
/// What counts as its quickest at most: a far client is no slow one, but one that paused before its first answer is not
/// far.
const AWAY_MAX: Duration = Duration::from_millis(800);
/// A message must leave within this time.
const SEND_WITHIN: Duration = Duration::from_secs(5);

pub fn routes() -> OpenApiRouter<Arc<App>> {
    OpenApiRouter::new().routes(routes!(stream))
}

/// How often.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
struct Rate {
    /// States a second; each is sent once, so that no more come than the controller makes (`controller.rate_hz` of kort.toml).
    #[serde(default = "hz_default")]
    #[param(minimum = 0.1, maximum = 500, default = 50, example = 50)]
    hz: f64,
}

fn hz_default() -> f64 {
    50.0
}

/// What a client may send: a setpoint under its lease, or a stop.
#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "an object with setpoint and lease_id, or with stop")]
pub struct Incoming {
    setpoint: Option<Setpoint>,
    lease_id: Option<String>,
    #[serde(default)]
    stop: bool,
}

/// The thruster's state as a WebSocket stream: one text message with a `ThrusterState` per period, each state once.
///
/// The client may send `{"setpoint": {"thrust_n": 25.0}, "lease_id": "…"}`; what is refused is answered by one
/// problem document. `{"stop": true}` stops every thruster and is answered by `{"stopped": [ids]}`. The gateway pings
/// with the states, ten times a second at most and once at least. A client that does not answer is sent no more states, so
/// that one that paused goes on with the newest behind a quarter of a second of old ones at most (more over a connection
/// whose round trip is long, or where its library reads ahead: `max_queue=1` of Python's websockets); one that answers none
/// for three seconds, or whose token was revoked, is closed. A plain GET, without the WebSocket handshake, is answered by
/// one state.
#[utoipa::path(get, path = "/v1/thrusters/{id}/stream", tag = "thrusters",
    params(("id" = String, Path, description = "Name of the thruster", example = "t1"), Rate),
    responses(
        (status = 101, description = "WebSocket: states flow at the asked rate"),
        (status = 200, description = "No WebSocket handshake: the state now", body = ThrusterState),
        (status = 400, description = "`malformed-query`, `malformed-header`: the handshake is broken", body = Problem, content_type = "application/problem+json"),
        (status = 404, description = "`unknown-thruster`", body = Problem, content_type = "application/problem+json"),
        (status = 422, description = "`out-of-range`: hz", body = Problem, content_type = "application/problem+json"),
        (status = 503, description = "`overloaded`: this address, or all together, have as many streams as there may be; the rest of their connections is left to requests", body = Problem, content_type = "application/problem+json"),
        (status = 426, description = "`upgrade-required`: this connection cannot be upgraded", body = Problem, content_type = "application/problem+json")))]
async fn stream(
    State(app): State<Arc<App>>,
    Path(id): Path<String>,
    Query(Rate { hz }): Query<Rate>,
    Extension(who): Extension<Identity>,
    seat: Option<Extension<Seat>>,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, Problem> {
    use WebSocketUpgradeRejection as Rejection;
    let thruster = Arc::clone(app.thruster(&id)?);
    if !(0.1..=HZ_MAX).contains(&hz) {
        return Err(Problem::new(Kind::OutOfRange, format!("hz = {hz} is outside 0.1 to {HZ_MAX}"))
            .hint("50 is plenty for eyes"));
    }
    match upgrade {
        Ok(upgrade) => {
            if let Some(Extension(Seat(slot))) = seat {
                app.connections().stream(&slot).map_err(|cap| {
                    Problem::new(
                        Kind::Overloaded,
                        format!("{cap} streams are open, which is all there may be"),
                    )
                    .hint("close streams that nobody reads; requests pass all the same")
                })?;
            }
            let upgrade = upgrade.max_message_size(MESSAGE_BYTES_READ).max_frame_size(MESSAGE_BYTES_READ);
            let session = move |socket| {
                let period = Duration::from_secs_f64(1.0 / hz);
                Session { app, thruster, who, lease: None, asked_at: None, away: None, sent: None }
                    .serve(socket, period)
            };
            Ok(upgrade.protocols([PROTOCOL]).on_upgrade(session).into_response())
        }
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

/// One client of the stream.
struct Session {
    app: Arc<App>,
    thruster: Arc<Thruster>,
    who: Identity,
    /// The lease it commanded with last: it is told when that is taken over.
    lease: Option<String>,
    /// When the ping went out that is not answered yet.
    asked_at: Option<Instant>,
    /// How quick its quickest answer to a ping was.
    away: Option<Duration>,
    /// The state that was sent last.
    sent: Option<Bytes>,
}

impl Session {
    async fn serve(mut self, mut socket: WebSocket, period: Duration) {
        let mut tick = interval(period);
        let [often, seldom] = PING_EVERY;
        let mut ping = interval(period.clamp(often, seldom));
        let mut stop = self.app.stopping();
        let _open = self.app.streams().open();
        loop {
            let message = tokio::select! {
                biased;
                _ = stop.changed() => close(1001, "the gateway stops"),
                received = socket.recv() => match received {
                    Some(Ok(Message::Close(_))) => return answered(socket).await,
                    Some(Ok(received)) => match self.received(received).await {
                        Some(answer) => answer,
                        None => continue,
                    },
                    Some(Err(error)) => why_closed(&error),
                    None => return,
                },
                _ = ping.tick() => match self.ask() {
                    Some(message) => message,
                    None => continue,
                },
                _ = tick.tick() => match self.state() {
                    Some(message) => message,
                    None => continue,
                },
            };
            let last = matches!(message, Message::Close(_));
            // A client that takes nothing must not keep its old states in the queue, nor this task for ever.
            let sent = tokio::time::timeout(SEND_WITHIN, socket.send(message)).await;
            if last || !matches!(sent, Ok(Ok(()))) {
                return;
            }
        }
    }

    /// The next ping, or the end of a client that answers none, or whose token is no more.
    fn ask(&mut self) -> Option<Message> {
        if !self.app.gate().stands(&self.who) {
            return Some(revoked());
        }
        if let Some(at) = self.asked_at {
            return (at.elapsed() >= CLOSE_AFTER)
                .then(|| close(1008, "three seconds of pings were not answered"));
        }
        self.asked_at = Some(Instant::now());
        Some(Message::Ping(Vec::new().into()))
    }

    /// The newest state. None for a client that is behind: what it would read later is old by then.
    fn state(&mut self) -> Option<Message> {
        if self.asked_at.is_some_and(|at| at.elapsed() > self.away.unwrap_or_default() + BEHIND_AFTER) {
            return None;
        }
        if let Some(lost) = &self.lease {
            let taken = self.thruster.desk().lease.taken_over(lost).is_some();
            if taken {
                let told = self.thruster.desk().may(self.lease.as_deref(), Instant::now());
                self.lease = None;
                return told.err().map(|problem| problem_text(&problem));
            }
        }
        let state = self.thruster.state_json();
        // It is rendered once: the same bytes are the same state, which this client has.
        let known = self.sent.as_ref().is_some_and(|sent| sent.as_ptr() == state.as_ptr());
        self.sent = Some(state.clone());
        (!known).then(|| text(&state))
    }

    /// What a client's message is answered with.
    async fn received(&mut self, message: Message) -> Option<Message> {
        match message {
            Message::Text(body) => match self.command(&body).await {
                Ok(answer) => answer,
                Err(problem) => Some(problem_text(&problem)),
            },
            Message::Pong(_) => {
                if let Some(at) = self.asked_at.take() {
                    self.away = Some(self.away.unwrap_or(AWAY_MAX).min(at.elapsed()));
                }
                None
            }
            Message::Ping(_) | Message::Close(_) => None,
            Message::Binary(_) => Some(close(1003, "commands are JSON in text messages")),
        }
    }

    async fn command(&mut self, body: &str) -> Result<Option<Message>, Problem> {
        if !self.app.gate().stands(&self.who) {
            return Ok(Some(revoked()));
        }
        let incoming = parse(body)?;
        // As POST /v1/stop has it.
        let stops = incoming.stop && self.app.gate().all_may_stop();
        if self.who.role < Role::Pilot && !stops {
            return Err(Problem::new(
                Kind::RoleTooLow,
                format!(
                    "token {:?} has the role {}; commanding needs pilot",
                    self.who.name,
                    self.who.role.name()
                ),
            ));
        }
        if incoming.stop {
            let stopped = super::stop::stop_all(&self.app, &self.who.name).await?;
            return Ok(Some(text(serde_json::json!({ "stopped": stopped }).to_string().as_bytes())));
        }
        let missing =
            |field| Problem::new(Kind::InvalidField, format!("missing field `{field}`")).hint(EXAMPLE);
        let setpoint = incoming.setpoint.ok_or_else(|| missing("setpoint"))?;
        let lease = incoming.lease_id.ok_or_else(|| missing("lease_id"))?;
        self.thruster.command(&self.who.name, Some(&lease), setpoint)?;
        self.lease = Some(lease);
        Ok(None)
    }
}

/// A client's close is answered by the library, which sends its answer as long as it is asked for more.
async fn answered(mut socket: WebSocket) {
    let ended = async { while let Some(Ok(_)) = socket.recv().await {} };
    let _ = tokio::time::timeout(SEND_WITHIN, ended).await;
}

const EXAMPLE: &str = r#"send {"setpoint": {"thrust_n": 25.0}, "lease_id": "…"}, or {"stop": true}"#;

/// Reads a text message.
pub fn parse(body: &str) -> Result<Incoming, Problem> {
    if body.len() > MESSAGE_BYTES_MAX {
        return Err(Problem::new(
            Kind::BodyTooLarge,
            format!("the message has {} bytes; allowed are {MESSAGE_BYTES_MAX}", body.len()),
        )
        .hint("no command needs that much"));
    }
    serde_json::from_str(body).map(|Object(incoming)| incoming).map_err(|error| {
        let kind = if error.is_data() { Kind::InvalidField } else { Kind::MalformedJson };
        Problem::new(kind, error.to_string()).hint(EXAMPLE)
    })
}

/// The close frame for what a client sent against the protocol (RFC 6455, section 7.4.1).
fn why_closed(error: &axum::Error) -> Message {
    let words = error.to_string();
    let lower = words.to_lowercase();
    if lower.contains("too long") || lower.contains("too big") || lower.contains("capacity") {
        close(1009, "the message is too large")
    } else if lower.contains("utf-8") || lower.contains("utf8") {
        close(1007, "the message is not UTF-8")
    } else {
        close(1002, "the message breaks the WebSocket protocol")
    }
}

/// What let it in is no more.
fn revoked() -> Message {
    close(1008, "the token was revoked")
}

fn close(code: u16, reason: &'static str) -> Message {
    Message::Close(Some(CloseFrame { code, reason: reason.into() }))
}

fn interval(period: Duration) -> tokio::time::Interval {
    let mut interval = tokio::time::interval(period);
    interval.set_missed_tick_behavior(MissedTickBehavior::Skip);
    interval
}

fn problem_text(problem: &Problem) -> Message {
    text(&serde_json::to_vec(problem).unwrap_or_default())
}

fn text(json: &[u8]) -> Message {
    Message::Text(Utf8Bytes::from(String::from_utf8_lossy(json).as_ref()))
}
