//! Tokens under way: what becomes of a stream whose token is revoked, and of others among a flood of wrong ones.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{self, Message, client::IntoClientRequest};

use crate::common::{self, Site, Stack, kill, wait};
use crate::{T1, ask, token};

/// A service that asks for tokens, and one of them.
fn guarded(role: &str) -> (Site, String, std::process::Child) {
    let site = Site::new();
    site.add("[gateway]", "require_tokens = true");
    let bearer = format!("Bearer {}", token(&site, "bridge", role));
    let supervisor = site.spawn("up");
    wait("the gateway", || {
        (ask(site.port, "GET", "/readyz", &[("Authorization", &bearer)], "").0 == 200).then_some(())
    });
    (site, bearer, supervisor)
}

/// On loopback too, where others come through a proxy or it is said so; and the reason told is the true one.
#[test]
fn a_gateway_on_loopback_says_why_it_asks_for_tokens() {
    for key in ["require_tokens", "behind_tls_proxy"] {
        let site = Site::new();
        site.add("[gateway]", &format!("{key} = true"));
        let out = common::run(&mut site.command("up"));
        let words = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{key}: {words}");
        for part in [&format!("`gateway.{key}` = true"), "tokens.toml holds no token", "kort token new"] {
            assert!(words.contains(part), "{key}, {part}: {words}");
        }
        assert!(!words.contains("is reached from other machines"), "{key}: {words}");
        token(&site, "bridge", "pilot");
        let mut supervisor = site.spawn("up");
        wait("the gateway", || (ask(site.port, "GET", "/healthz", &[], "").0 == 200).then_some(()));
        assert_eq!(ask(site.port, "GET", T1, &[], "").0, 401, "{key}");
        kill(supervisor.id(), "TERM");
        supervisor.wait().unwrap();
    }
}

/// A token may be of too low a role for a stop where nobody needs one: it stops all the same, either way, by its own name.
#[test]
fn where_nobody_needs_a_token_a_viewer_stops_by_its_own_name() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let bearer = format!("Bearer {}", token(&stack.site, "eye", "viewer"));
        let stopped = || {
            let (_, events) = ask(port, "GET", "/v1/events", &[], "");
            let events = events.as_array().unwrap();
            let of = |event: &&Value| event["kind"] == "stopped" && event["who"] == "eye";
            events.iter().filter(of).count()
        };
        assert_eq!(ask(port, "POST", "/v1/stop", &[("Authorization", &bearer)], "").0, 200);
        wait("the first stop", || (stopped() == 1).then_some(()));
        let mut request = format!("ws://127.0.0.1:{port}{T1}/stream?hz=50").into_client_request().unwrap();
        request.headers_mut().insert("authorization", bearer.parse().unwrap());
        let (mut socket, _) = tungstenite::connect(request).unwrap();
        let mut answer = |sent: Value| {
            socket.send(Message::text(sent.to_string())).unwrap();
            wait("an answer", || {
                let Message::Text(text) = socket.read().unwrap() else { return None };
                serde_json::from_str::<Value>(&text).ok().filter(|told| told["measured"].is_null())
            })
        };
        assert_eq!(answer(json!({"stop": true}))["stopped"], json!(["t1"]));
        wait("the second stop", || (stopped() == 2).then_some(()));
        let refused = answer(json!({"setpoint": {"thrust_n": 1.0}, "lease_id": "x"}));
        assert_eq!(refused["type"], "urn:kort:problem:role-too-low", "it commands nothing: {refused}");
    });
}

/// They would stand in the event log for the service itself, or for whoever needs no token.
#[test]
fn no_token_is_called_as_the_event_log_calls_a_process() {
    let site = Site::new();
    for name in ["servo", "controller", "gateway", "supervisor", "local"] {
        let mut command = std::process::Command::new(common::KORT);
        command.args(["token", "new", name, "--role", "pilot", "--config"]).arg(site.config());
        let out = common::run(command.current_dir(site.folder.path()));
        let words = String::from_utf8_lossy(&out.stderr);
        assert!(
            out.status.code() == Some(2) && words.contains("what the event log calls"),
            "{name}: {words}"
        );
    }
}

#[test]
fn a_stream_ends_with_the_token_that_opened_it_and_commands_nothing_more() {
    common::in_real_time(|| {
        let (site, bearer, mut supervisor) = guarded("pilot");
        let with = |method: &str, path: &str, body: &str| {
            ask(site.port, method, &format!("{T1}{path}"), &[("Authorization", &bearer)], body)
        };
        let (status, grant) = with("POST", "/lease", r#"{"holder": "bridge", "ttl_ms": 60000}"#);
        assert_eq!(status, 201, "{grant}");
        let mut request =
            format!("ws://127.0.0.1:{}{T1}/stream?hz=50", site.port).into_client_request().unwrap();
        request.headers_mut().insert("authorization", bearer.parse().unwrap());
        let (mut socket, _) = tungstenite::connect(request).unwrap();

        // Another token that comes or goes is no reason.
        let eye = format!("Bearer {}", token(&site, "eye", "viewer"));
        for _ in 0..100 {
            assert!(!socket.read().unwrap().is_close());
        }
        let file = site.folder.path().join("tokens.toml");
        let kept = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, kept.replace("[tokens.bridge]", "[tokens.gone]")).unwrap();
        let revoked = Instant::now();
        let command = json!({"setpoint": {"thrust_n": 5.0}, "lease_id": grant["lease_id"]});
        socket.send(Message::text(command.to_string())).unwrap();
        let frame = loop {
            match socket.read().unwrap() {
                Message::Close(frame) => break frame.expect("a reason"),
                Message::Text(text) => {
                    let told: Value = serde_json::from_str(&text).unwrap();
                    assert_eq!(told["id"], "t1", "no command is looked at any more: {told}");
                }
                _ => (),
            }
        };
        assert!(u16::from(frame.code) == 1008 && frame.reason.contains("revoked"), "{frame:?}");
        assert!(revoked.elapsed() < Duration::from_secs(2), "{:?}", revoked.elapsed());
        // Nor does it hold command any longer.
        let state = loop {
            let (_, state) = ask(site.port, "GET", T1, &[("Authorization", &eye)], "");
            if state["lease"].is_null() || revoked.elapsed() > Duration::from_secs(5) {
                break state;
            }
        };
        assert!(state["lease"].is_null() && revoked.elapsed() < Duration::from_secs(3), "{state}");
        kill(supervisor.id(), "TERM");
        supervisor.wait().unwrap();
    });
}

/// A lease's id is no name: who commands with somebody else's is told by the token that it was sent with, whichever way
/// it came, and the holder beside it.
#[test]
fn a_command_under_the_lease_of_another_is_told_by_its_sender() {
    common::in_real_time(|| {
        let (site, bridge, mut supervisor) = guarded("pilot");
        let mate = format!("Bearer {}", token(&site, "mate", "pilot"));
        let path = |what: &str| format!("{T1}/{what}");
        let body = r#"{"holder": "desk", "ttl_ms": 60000}"#;
        let (status, grant) = ask(site.port, "POST", &path("lease"), &[("Authorization", &bridge)], body);
        assert_eq!(status, 201, "{grant}");
        let lease = grant["lease_id"].as_str().unwrap();
        let with = |bearer: &str, method: &str, what: &str, body: &str| {
            let headers = [("Authorization", bearer), ("Lease-Id", lease)];
            let (status, answer) = ask(site.port, method, &path(what), &headers, body);
            assert_eq!(status, 200, "{what}: {answer}");
        };
        with(&mate, "POST", "arm", "");
        with(&bridge, "PUT", "setpoint", r#"{"thrust_n": 5.0}"#);
        with(&mate, "PUT", "setpoint", r#"{"thrust_n": 6.0}"#);
        let events = wait("the events", || {
            let (_, events) = ask(site.port, "GET", "/v1/events", &[("Authorization", &bridge)], "");
            let of = |event: &Value| {
                let kind = event["kind"].as_str()?.to_owned();
                Some((kind, event["who"].as_str()?.to_owned(), event["detail"].as_str()?.to_owned()))
            };
            let events: Vec<_> = events.as_array()?.iter().filter_map(of).collect();
            (events.iter().filter(|(kind, ..)| kind == "commanded").count() == 2).then_some(events)
        });
        for (kind, who, words) in [
            ("armed", "mate", "mate under the lease of desk (bridge) armed"),
            ("commanded", "desk (bridge)", "desk (bridge) commands thrust_n = 5"),
            ("commanded", "mate", "mate under the lease of desk (bridge) commands thrust_n = 6"),
        ] {
            let wanted = (kind.to_owned(), who.to_owned(), words.to_owned());
            assert!(events.contains(&wanted), "{wanted:?} in {events:?}");
        }
        kill(supervisor.id(), "TERM");
        supervisor.wait().unwrap();
    });
}

/// How long a right token takes that was not seen before, and a request that shows a wrong one.
fn a_first_token(site: &Site) -> (Duration, String) {
    let first = format!("Bearer {}", token(site, "mate", "viewer"));
    let began = Instant::now();
    assert_eq!(ask(site.port, "GET", T1, &[("Authorization", &first)], "").0, 200);
    let took = began.elapsed();
    let wrong = "Bearer chief.00";
    assert_eq!(ask(site.port, "GET", T1, &[("Authorization", wrong)], "").0, 401);
    (
        took,
        format!(
            "POST /v1/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\nAuthorization: {wrong}\r\n\r\n"
        ),
    )
}

/// Argon2 is heavy on purpose. Who makes it work holds up himself alone: a stop of another address, with a token that
/// this gateway has not seen before, is no later for it.
#[test]
fn a_flood_of_wrong_tokens_holds_up_no_stop_of_another_peer() {
    common::in_real_time(|| {
        let (site, _, mut supervisor) = guarded("viewer");
        let pilot = token(&site, "chief", "pilot");
        let (one, request) = a_first_token(&site);
        let flood: Vec<TcpStream> = (0..60)
            .filter_map(|_| {
                let mut socket = TcpStream::connect(("127.0.0.1", site.port)).ok()?;
                socket.write_all(request.repeat(4).as_bytes()).ok()?;
                Some(socket)
            })
            .collect();
        assert_eq!(flood.len(), 60);
        let began = Instant::now();
        let answer = from_another_peer(site.port, &pilot);
        let took = began.elapsed();
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        // Its own token; the rest is for a machine shared with others.
        assert!(took < 10 * one + Duration::from_secs(1), "{took:?}, where one takes {one:?}");
        drop(flood);
        kill(supervisor.id(), "TERM");
        supervisor.wait().unwrap();
    });
}

/// Wrong tokens from many peers, all for a stop: a right one that was never seen does not wait for those that came before it.
#[test]
fn wrong_tokens_of_many_peers_do_not_hold_up_a_stop() {
    common::in_real_time(|| {
        let (site, _, mut supervisor) = guarded("viewer");
        let pilot = token(&site, "chief", "pilot");
        let (one, request) = a_first_token(&site);
        let flood: Vec<TcpStream> = (0..120u8)
            .map(|host| {
                let mut socket = from([127, 0, 1, host], site.port);
                socket.write_all(request.repeat(4).as_bytes()).unwrap();
                socket
            })
            .collect();
        let began = Instant::now();
        let answer = from_another_peer(site.port, &pilot);
        let took = began.elapsed();
        println!(
            "a stop among {} peers' wrong tokens took {took:?}, where one alone takes {one:?}",
            flood.len()
        );
        assert!(answer.starts_with("HTTP/1.1 200"), "{answer}");
        // Each of the 480 would take as long, were it argon2 that refuses it.
        assert!(took < 8 * one + Duration::from_millis(300), "{took:?}, where one takes {one:?}");
        drop(flood);
        kill(supervisor.id(), "TERM");
        supervisor.wait().unwrap();
    });
}

/// A connection that comes from this address of the machine.
fn from(address: [u8; 4], port: u16) -> TcpStream {
    tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap().block_on(async {
        let socket = tokio::net::TcpSocket::new_v4().unwrap();
        socket.bind((address, 0).into()).unwrap();
        let stream = socket.connect(([127, 0, 0, 1], port).into()).await.unwrap().into_std().unwrap();
        stream.set_nonblocking(false).unwrap();
        stream
    })
}

fn from_another_peer(port: u16, token: &str) -> String {
    let mut stream = from([127, 0, 0, 2], port);
    let head = "POST /v1/stop HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\nConnection: close\r\n";
    stream.write_all(format!("{head}Authorization: Bearer {token}\r\n\r\n").as_bytes()).unwrap();
    let mut answer = String::new();
    stream.read_to_string(&mut answer).unwrap();
    answer
}
