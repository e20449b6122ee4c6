//! A live server for Foxglove and its kin, on an address of its own: their WebSocket protocol, read only.
//!
//! Each thruster is two channels of JSON messages: `/ID` with its signals, named as in a recording, and `/ID/state` with its
//! whole state. Nobody is asked who they are, and a page of any site may read along from a browser on this machine: so it is
//! off unless `gateway.foxglove` names an address, which must be of this machine.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use axum::Router;
use axum::extract::State;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::http::StatusCode;
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use kort_proto::signals::SIGNALS;
use serde::Deserialize;
use serde_json::{Map, Value, json};
use tokio::net::TcpListener;
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio::time::{MissedTickBehavior, interval, timeout};

use crate::App;

/// The protocol under its present name and the one it had before.
const PROTOCOLS: [&str; 2] = ["foxglove.sdk.v1", "foxglove.websocket.v1"];
/// Signals are sent this often, states every fifth time.
const EVERY: Duration = Duration::from_millis(20);
const STATE_EACH: u64 = 5;
/// Clients at once, and subscriptions of one.
const CLIENTS_MAX: usize = 8;
const SUBSCRIPTIONS_MAX: usize = 64;
/// A client that takes nothing for so long is let go.
const SEND_WITHIN: Duration = Duration::from_secs(5);
/// Longest message of a client, bytes.
const MESSAGE_BYTES_MAX: usize = 64 << 10;
/// How a message with data begins.
const DATA: u8 = 1;

struct Server {
    app: Arc<App>,
    places: Arc<Semaphore>,
}

/// Serves until the gateway stops.
pub async fn serve(app: Arc<App>, listener: TcpListener) {
    let mut stopping = app.stopping();
    let server = Arc::new(Server { app, places: Arc::new(Semaphore::new(CLIENTS_MAX)) });
    let router = Router::new().fallback(get(open)).with_state(server);
    let stopped = async move { drop(stopping.changed().await) };
    if let Err(error) = axum::serve(listener, router).with_graceful_shutdown(stopped).await {
        tracing::warn!("the server for Foxglove ends: {error}");
    }
}

async fn open(State(server): State<Arc<Server>>, upgrade: WebSocketUpgrade) -> Response {
    let Ok(place) = Arc::clone(&server.places).try_acquire_owned() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "every place is taken").into_response();
    };
    upgrade
        .max_message_size(MESSAGE_BYTES_MAX)
        .protocols(PROTOCOLS)
        .on_upgrade(move |socket| session(server, socket, place))
}

/// What a client says; anything else it may say is passed over.
#[derive(Deserialize)]
#[serde(tag = "op", rename_all = "camelCase")]
enum Said {
    Subscribe {
        subscriptions: Vec<Subscription>,
    },
    #[serde(rename_all = "camelCase")]
    Unsubscribe {
        subscription_ids: Vec<u32>,
    },
    #[serde(other)]
    Other,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Subscription {
    id: u32,
    channel_id: usize,
}

async fn session(server: Arc<Server>, mut socket: WebSocket, _place: OwnedSemaphorePermit) {
    let app = &server.app;
    let info = json!({"op": "serverInfo", "name": format!("kort {}", env!("CARGO_PKG_VERSION")), "capabilities": [],
        "supportedEncodings": [], "metadata": {}});
    for opening in [info, json!({"op": "advertise", "channels": channels(app)})] {
        if !send(&mut socket, Message::Text(opening.to_string().into())).await {
            return;
        }
    }
    let mut stopping = app.stopping();
    let mut tick = interval(EVERY);
    tick.set_missed_tick_behavior(MissedTickBehavior::Skip);
    let mut subscribed: BTreeMap<u32, usize> = BTreeMap::new();
    let mut sent_ns = vec![0; app.thrusters().len()];
    for turn in 0_u64.. {
        tokio::select! {
            _ = stopping.changed() => return,
            said = socket.recv() => match said {
                Some(Ok(Message::Text(text))) => take(&mut subscribed, &text),
                Some(Ok(Message::Close(_)) | Err(_)) | None => return,
                Some(Ok(_)) => {}
            },
            _ = tick.tick() => {
                let rows: Vec<Option<Vec<u8>>> =
                    sent_ns.iter_mut().enumerate().map(|(place, sent_ns)| row(app, place, sent_ns)).collect();
                for (id, channel) in &subscribed {
                    let payload = match (channel / 2, channel % 2) {
                        (place, 0) => rows.get(place).cloned().flatten(),
                        (place, _) if turn.is_multiple_of(STATE_EACH) => {
                            app.thrusters().get(place).map(|thruster| thruster.state_json().to_vec())
                        }
                        _ => None,
                    };
                    let Some(payload) = payload else { continue };
                    if !send(&mut socket, Message::Binary(data(*id, &payload).into())).await {
                        return;
                    }
                }
            }
        }
    }
}

fn take(subscribed: &mut BTreeMap<u32, usize>, text: &str) {
    match serde_json::from_str(text) {
        Ok(Said::Subscribe { subscriptions }) => {
            subscribed.extend(subscriptions.iter().map(|wanted| (wanted.id, wanted.channel_id)));
            while subscribed.len() > SUBSCRIPTIONS_MAX {
                subscribed.pop_last();
            }
        }
        Ok(Said::Unsubscribe { subscription_ids }) => {
            subscribed.retain(|id, _| !subscription_ids.contains(id));
        }
        Ok(Said::Other) | Err(_) => {}
    }
}

/// Two of each thruster, by their place.
fn channels(app: &App) -> Vec<Value> {
    let columns: Vec<&str> = SIGNALS.iter().map(|signal| signal.name).collect();
    let signals = kort_recording::message_schema(&columns).to_string();
    let state = kort_recording::state_schema().to_string();
    let of = |id: usize, topic: String, name: &str, schema: &str| {
        json!({"id": id, "topic": topic, "encoding": "json", "schemaName": name, "schema": schema,
            "schemaEncoding": "jsonschema"})
    };
    let both = app.thrusters().iter().enumerate().flat_map(|(place, thruster)| {
        [
            of(2 * place, format!("/{}", thruster.id), "kort.recording/1", &signals),
            of(2 * place + 1, format!("/{}/state", thruster.id), "kort.state/1", &state),
        ]
    });
    both.collect()
}

/// The newest sample, if it was not sent before: what is not measured is left out.
fn row(app: &App, place: usize, sent_ns: &mut u64) -> Option<Vec<u8>> {
    let heard = app.thrusters()[place].heard();
    let telemetry = heard.telemetry(Instant::now())?;
    if telemetry.time_ns == *sent_ns {
        return None;
    }
    *sent_ns = telemetry.time_ns;
    let mut row = Map::new();
    row.insert("time_s".into(), json!(telemetry.time_ns as f64 * 1e-9));
    for signal in SIGNALS.iter() {
        let value = (signal.get)(&telemetry.signals);
        if value.is_finite() {
            row.insert(signal.name.into(), json!(value));
        }
    }
    serde_json::to_vec(&row).ok()
}

/// A message of a subscription, stamped with the wall time.
fn data(subscription: u32, payload: &[u8]) -> Vec<u8> {
    let now =
        SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0, |since| since.as_nanos() as u64);
    let mut bytes = Vec::with_capacity(13 + payload.len());
    bytes.push(DATA);
    bytes.extend(subscription.to_le_bytes());
    bytes.extend(now.to_le_bytes());
    bytes.extend(payload);
    bytes
}

async fn send(socket: &mut WebSocket, message: Message) -> bool {
    matches!(timeout(SEND_WITHIN, socket.send(message)).await, Ok(Ok(())))
}
