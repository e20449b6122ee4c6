//! Rival commanders, readers that do not read, and half-open sockets.

use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::json;
use tokio_tungstenite::tungstenite::{self, Message};

use crate::common::{Stack, wait};
use crate::table::Table;

/// The second commander is refused until it takes over; then the thruster is at rest within the slew of its law.
pub fn rivals(table: &mut Table) {
    let mut stack = Stack::start();
    stack.thrust(30.0, 60_000);
    let rival = |body: serde_json::Value| {
        let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
        let url = format!("http://127.0.0.1:{}/v1/thrusters/t1/lease", stack.site.port);
        agent.post(&url).send_json(body).expect("an answer").status().as_u16()
    };
    assert_eq!(rival(json!({"holder": "rival"})), 409);
    let mut watch = stack.watch();
    let began = Instant::now();
    assert_eq!(rival(json!({"holder": "rival", "ttl_ms": 60000, "takeover": true})), 201);
    watch.until("rest", |t| t.signals.current_cmd_a == 0.0);
    table.row("two commanders: takeover", "at rest", Duration::from_millis(500), &[began.elapsed()]);
}

/// A reader that stops reading is closed; when it reads again it is not fed what is long past.
pub fn slow_reader(table: &mut Table) {
    let stack = Stack::start();
    let url = format!("ws://127.0.0.1:{}/v1/thrusters/t1/stream?hz=200", stack.site.port);
    let (mut socket, _) = tungstenite::connect(&url).expect("a stream");
    socket.read().expect("a state");
    std::thread::sleep(Duration::from_secs(8));
    let (mut states, mut closed) = (Vec::new(), false);
    while let Ok(message) = socket.read() {
        match message {
            Message::Text(text) => {
                let state: serde_json::Value = serde_json::from_str(&text).expect("JSON");
                states.push(state["time_s"].as_f64().expect("a time"));
            }
            Message::Close(frame) => {
                closed = true;
                assert!(frame.is_some_and(|f| f.reason.contains("ping")), "the close says why");
            }
            _ => (),
        }
    }
    assert!(closed, "a reader that missed three pings is closed with a frame");
    let old = states.last().zip(states.first()).map_or(0.0, |(last, first)| last - first);
    table.row(
        "stream's reader paused for 8 s",
        "span of states it still finds, then closed",
        Duration::from_millis(250),
        &[Duration::from_secs_f64(old)],
    );
}

/// Half-open requests hold no place that the stop needs.
pub fn half_open(table: &mut Table) {
    let stack = Stack::start();
    let port = stack.site.port;
    let half: Vec<TcpStream> = (0..400)
        .filter_map(|_| {
            let mut socket = TcpStream::connect(("127.0.0.1", port)).ok()?;
            socket.write_all(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\nX: ").ok()?;
            Some(socket)
        })
        .collect();
    let measured: Vec<Duration> = (0..10)
        .map(|_| {
            let began = Instant::now();
            wait("stop", || {
                let agent: ureq::Agent =
                    ureq::Agent::config_builder().http_status_as_error(false).build().into();
                let url = format!("http://127.0.0.1:{port}/v1/stop");
                agent.post(&url).send_empty().ok().filter(|answer| answer.status() == 200)
            });
            began.elapsed()
        })
        .collect();
    assert!(half.len() > 350, "{} sockets", half.len());
    table.row("400 half-open sockets", "stop is confirmed", Duration::from_millis(100), &measured);
}
