//! The interface of the built program from outside: routes, leases, bad input, stream, recordings.

mod common;

use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use common::{Site, Stack, kill, wait};
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{self, Message};

/// An answer: status, headers in lower case, body.
struct Answer {
    status: u16,
    head: String,
    body: Vec<u8>,
}

impl Answer {
    fn json(&self) -> Value {
        serde_json::from_slice(&self.body)
            .unwrap_or_else(|e| panic!("{e}: {}", String::from_utf8_lossy(&self.body)))
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }
}

/// One request as bytes on a socket, so that broken ones can be sent too.
fn send(port: u16, method: &str, path: &str, headers: &[(&str, &str)], body: &[u8]) -> Answer {
    let mut socket = wait("a connection", || TcpStream::connect(("127.0.0.1", port)).ok());
    socket.set_read_timeout(Some(Duration::from_secs(15))).unwrap();
    let mut request = format!("{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n");
    if !body.is_empty() || method != "GET" {
        request += &format!("Content-Length: {}\r\n", body.len());
    }
    for (name, value) in headers {
        request += &format!("{name}: {value}\r\n");
    }
    socket.write_all(format!("{request}\r\n").as_bytes()).unwrap();
    let _ = socket.write_all(body); // a refused body is not read to its end
    let mut bytes = Vec::new();
    let _ = socket.read_to_end(&mut bytes);
    let split = bytes.windows(4).position(|four| four == b"\r\n\r\n").expect("a whole head");
    let head = String::from_utf8_lossy(&bytes[..split]).to_lowercase();
    let status = head.split(' ').nth(1).and_then(|code| code.parse().ok()).expect("a status");
    let mut body = bytes.split_off(split + 4);
    if head.contains("transfer-encoding: chunked") {
        body = unchunk(&body);
    }
    Answer { status, head, body }
}

fn unchunk(mut rest: &[u8]) -> Vec<u8> {
    let mut whole = Vec::new();
    while let Some(end) = rest.windows(2).position(|two| two == b"\r\n") {
        let length = usize::from_str_radix(std::str::from_utf8(&rest[..end]).unwrap(), 16).unwrap();
        if length == 0 {
            break;
        }
        whole.extend_from_slice(&rest[end + 2..end + 2 + length]);
        rest = &rest[end + 4 + length..];
    }
    whole
}

const ARM: &str = "/v1/thrusters/t1/arm";
const JSON: (&str, &str) = ("Content-Type", "application/json");

fn put_json(port: u16, method: &str, path: &str, lease: &str, body: &str) -> Answer {
    send(port, method, path, &[JSON, ("Lease-Id", lease)], body.as_bytes())
}

fn assert_problem(answer: &Answer, status: u16, slug: &str, what: &str) {
    assert_eq!(answer.status, status, "{what}: {}", answer.text());
    assert!(answer.head.contains("content-type: application/problem+json"), "{what}: {}", answer.head);
    let problem = answer.json();
    assert_eq!(problem["type"], format!("urn:kort:problem:{slug}"), "{what}: {problem}");
    assert_eq!(problem["status"], status, "{what}");
    assert!(
        !problem["title"].as_str().unwrap().is_empty() && !problem["detail"].as_str().unwrap().is_empty(),
        "{what}"
    );
}

/// Method, path, headers and body of a request; status and type of its answer.
type Case<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)], &'a str, u16, &'a str);

#[test]
fn every_error_is_a_problem_document_with_its_type() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let t1 = "/v1/thrusters/t1";
        let lease = format!("{t1}/lease");
        let big = format!("{{\"holder\": \"{}\"}}", "x".repeat(100_000));
        let cases: &[Case] = &[
            ("GET", "/nowhere", &[], "", 404, "unknown-route"),
            ("GET", "/v1", &[], "", 404, "unknown-route"),
            ("GET", "/docs/nothing.js", &[], "", 404, "unknown-route"),
            ("POST", "/v1/thrusters", &[], "", 405, "method-not-allowed"),
            ("DELETE", t1, &[], "", 405, "method-not-allowed"),
            ("PATCH", "/metrics", &[], "", 405, "method-not-allowed"),
            ("GET", "/v1/thrusters/t9", &[], "", 404, "unknown-thruster"),
            ("GET", "/v1/thrusters/%ff", &[], "", 400, "malformed-path"),
            ("POST", "/v1/thrusters/t9/lease", &[JSON], r#"{"holder": "a"}"#, 404, "unknown-thruster"),
            ("POST", &lease, &[JSON], r#"{"holder": "#, 400, "malformed-json"),
            ("POST", &lease, &[JSON], "", 400, "malformed-json"),
            ("POST", &lease, &[], r#"{"holder": "a"}"#, 415, "unsupported-media-type"),
            (
                "POST",
                &lease,
                &[("Content-Type", "text/plain")],
                r#"{"holder": "a"}"#,
                415,
                "unsupported-media-type",
            ),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl": 5}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"ttl_ms": 500}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"holder": 7}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": 0.5}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"holder": ""}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": 60001}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": 0}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": -5}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], &big, 413, "body-too-large"),
            ("PUT", &lease, &[], "", 403, "lease-required"),
            ("DELETE", &lease, &[("Lease-Id", "made-up")], "", 409, "lease-lost"),
            ("DELETE", &lease, &[("Lease-Id", "")], "", 400, "malformed-header"),
            ("GET", "/v1/thrusters/t1/stream?hz=fast", &[], "", 400, "malformed-query"),
            ("GET", "/v1/thrusters/t1/stream?rate=5", &[], "", 400, "malformed-query"),
            ("GET", "/v1/thrusters/t1/stream?hz=100000", &[], "", 422, "out-of-range"),
            ("GET", "/v1/thrusters/t1/stream?hz=NaN", &[], "", 422, "out-of-range"),
            (
                "PUT",
                "/v1/thrusters/t1/controller",
                &[JSON],
                r#"{"controller": "magic"}"#,
                422,
                "unknown-controller",
            ),
            ("PUT", "/v1/thrusters/t1/controller", &[JSON], r#"{"law": "magic"}"#, 422, "invalid-field"),
            ("GET", "/v1/recordings/none", &[], "", 404, "unknown-recording"),
            ("GET", "/v1/recordings/..%2f..%2fkort.toml", &[], "", 404, "unknown-recording"),
            ("GET", "/v1/recordings/none?format=xml", &[], "", 400, "malformed-query"),
            ("DELETE", "/v1/recordings", &[], "", 409, "no-recording"),
            ("POST", "/v1/recordings", &[JSON], r#"{"name": "../x"}"#, 422, "out-of-range"),
            ("POST", "/v1/recordings", &[JSON], r#"{"rate_hz": 0}"#, 422, "out-of-range"),
            ("POST", "/v1/recordings", &[JSON], r#"{"thruster": "t9"}"#, 404, "unknown-thruster"),
            (
                "POST",
                "/v1/thrusters/t1/arm",
                &[("Origin", "http://elsewhere.example")],
                "",
                403,
                "foreign-origin",
            ),
            ("GET", "/v1/thrusters/t1/stream", &[("Origin", "null")], "", 403, "foreign-origin"),
            ("GET", "/v1/events?since=yesterday", &[], "", 422, "out-of-range"),
            ("GET", "/v1/events?limit=0", &[], "", 422, "out-of-range"),
            ("GET", "/v1/thrusters", &[("Authorization", "Basic eHg6eHg=")], "", 400, "malformed-header"),
            ("GET", "/v1/thrusters", &[("Authorization", "Bearer nobody.00")], "", 401, "token-required"),
            ("GET", "/v1/faults/9999", &[], "", 404, "unknown-fault"),
            ("GET", "/v1/faults/x", &[], "", 400, "malformed-path"),
        ];
        for (method, path, headers, body, status, slug) in cases {
            let answer = send(port, method, path, headers, body.as_bytes());
            assert_problem(&answer, *status, slug, &format!("{method} {path} {body:.60}"));
            if *status == 405 {
                assert!(answer.head.contains("\nallow: "), "405 names what is allowed: {}", answer.head);
            }
        }
        assert_eq!(stack.state().unwrap()["lease"], Value::Null);
    });
}

#[test]
fn a_setpoint_that_is_not_allowed_never_reaches_the_drive() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let path = "/v1/thrusters/t1/setpoint";
        let range = stack.state().unwrap()["range"]["thrust_n"].as_f64().unwrap();
        assert!(range > 100.0, "the stand gives more than 100 N: {range}");
        let lease = stack.expect("POST", "/lease", Some(json!({"holder": "bench", "ttl_ms": 60000})));
        let id = lease["lease_id"].as_str().unwrap().to_owned();

        let disarmed = put_json(port, "PUT", path, &id, r#"{"thrust_n": 25.0}"#);
        assert_problem(&disarmed, 409, "not-armed", "disarmed");
        assert_eq!(put_json(port, "POST", ARM, &id, "").status, 200);
        let beyond = format!(r#"{{"thrust_n": {}}}"#, range + 0.1);
        let cases = [
            (r#"{"thrust_n": NaN}"#, 400, "malformed-json"),
            (r#"{"thrust_n": Infinity}"#, 400, "malformed-json"),
            (r#"{"thrust_n": 1e999}"#, 400, "malformed-json"),
            (r#"{"thrust_n": "25"}"#, 422, "invalid-field"),
            (r#"{"thrust_n": null}"#, 422, "invalid-field"),
            (r#"{"thrust": 25}"#, 422, "invalid-field"),
            (r#"{"thrust_n": 25, "speed_rad_s": 5}"#, 422, "invalid-field"),
            (r#"{}"#, 422, "invalid-field"),
            (r#"[25]"#, 422, "invalid-field"),
            (r#"{"speed_rad_s": -1e9}"#, 422, "out-of-range"),
            (beyond.as_str(), 422, "out-of-range"),
        ];
        for (body, status, slug) in cases {
            let answer = put_json(port, "PUT", path, &id, body);
            assert_problem(&answer, status, slug, body);
        }
        let refused = put_json(port, "PUT", path, &id, &beyond).json();
        let detail = refused["detail"].as_str().unwrap();
        assert!(
            detail.contains(&format!("-{range:?} to {range:?} N")) && refused["hint"].is_string(),
            "{refused}"
        );
        let mut watch = stack.watch();
        for _ in 0..200 {
            assert_eq!(watch.next().signals.current_cmd_a, 0.0, "nothing that was refused moves the drive");
        }

        let accepted = put_json(port, "PUT", path, &id, r#"{"thrust_n": 60}"#);
        assert_eq!(accepted.status, 200, "{}", accepted.text());
        stack.watch().until("thrust", |t| (t.signals.thrust_n - 60.0).abs() < 12.0);
    });
}

#[test]
fn one_commander_at_a_time_and_an_ended_lease_ends_the_thrust() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let lease = "/v1/thrusters/t1/lease";
        let take = |body: &str| send(port, "POST", lease, &[JSON], body.as_bytes());
        let first = take(r#"{"holder": "bench", "ttl_ms": 1500}"#);
        assert_eq!(first.status, 201, "{}", first.text());
        let grant = first.json();
        let id = grant["lease_id"].as_str().unwrap();
        assert!((1..=1500).contains(&grant["expires_in_ms"].as_u64().unwrap()), "{grant}");

        let second = take(r#"{"holder": "bridge", "ttl_ms": 1000}"#);
        assert_problem(&second, 409, "lease-held", "a second holder");
        assert_eq!(second.json()["holder"], "bench");
        let path = "/v1/thrusters/t1/setpoint";
        let foreign = put_json(port, "PUT", path, "0123456789abcdef0123456789abcdef", r#"{"thrust_n": 5}"#);
        assert_problem(&foreign, 409, "lease-held", "a command with a foreign lease");
        assert_eq!(foreign.json()["holder"], "bench");
        assert_problem(
            &send(port, "PUT", path, &[JSON], br#"{"thrust_n": 5}"#),
            409,
            "lease-held",
            "no lease at all while somebody holds one",
        );
        assert_problem(
            &put_json(port, "POST", "/v1/thrusters/t1/arm", "wrong", ""),
            409,
            "lease-held",
            "arming against the lease",
        );

        assert_eq!(put_json(port, "POST", ARM, id, "").status, 200);
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(2500) {
            let answer = put_json(port, "PUT", path, id, r#"{"thrust_n": 60}"#);
            assert_eq!(answer.status, 200, "every accepted command renews the lease: {}", answer.text());
            std::thread::sleep(Duration::from_millis(50));
        }
        let state = stack.state().unwrap();
        assert_eq!(
            (&state["setpoint"], &state["lease"]["holder"]),
            (&json!({"thrust_n": 60.0}), &json!("bench"))
        );

        // Nobody commands any more: the lease runs out, thrust ends, and the old id is worth nothing.
        let zero = stack.watch().until("zero", |t| t.signals.current_cmd_a == 0.0);
        assert_eq!(zero.faults, 0, "an ended lease is no fault");
        wait("the state to say so", || {
            let state = stack.state()?;
            (state["lease"].is_null() && state["setpoint"] == json!({"thrust_n": 0.0})).then_some(())
        });
        assert_problem(
            &put_json(port, "PUT", path, id, r#"{"thrust_n": 60}"#),
            409,
            "lease-lost",
            "an old lease",
        );
        let given = take(r#"{"holder": "bridge"}"#).json();
        assert!(given["expires_in_ms"].as_u64().unwrap() <= 500, "the default life is 500 ms: {given}");
        let id = given["lease_id"].as_str().unwrap();
        let _ = put_json(port, "PUT", lease, id, "");
        let gave = put_json(port, "DELETE", lease, id, "");
        assert!(
            gave.status == 204 || gave.json()["type"] == "urn:kort:problem:lease-lost",
            "{}",
            gave.text()
        );
    });
}

#[test]
fn the_stream_shows_the_state_at_the_asked_rate_and_takes_setpoints() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let url = format!("ws://127.0.0.1:{}/v1/thrusters/t1/stream?hz=50", stack.site.port);
        let (mut socket, _) = tungstenite::connect(&url).unwrap();
        let next = |socket: &mut tungstenite::WebSocket<_>| -> Value {
            loop {
                if let Message::Text(text) = socket.read().unwrap() {
                    return serde_json::from_str(&text).unwrap();
                }
            }
        };
        let start = Instant::now();
        let mut last = f64::NEG_INFINITY;
        for _ in 0..50 {
            let state = next(&mut socket);
            let time_s = state["time_s"].as_f64().unwrap();
            assert!(time_s >= last, "time goes on: {last} then {time_s}");
            last = time_s;
            assert_eq!(state["id"], "t1");
        }
        let took = start.elapsed().as_secs_f64();
        assert!(took > 0.8, "50 states at 50 Hz took {took} s");

        for (message, slug) in [
            ("{", "malformed-json"),
            (r#"{"setpoint": {"thrust_n": 5}}"#, "invalid-field"),
            (r#"{"setpoint": {}, "lease_id": "x"}"#, "invalid-field"),
            (&format!(r#"{{"lease_id": "{}"}}"#, "x".repeat(5000)), "body-too-large"),
            (r#"{"setpoint": {"thrust_n": 5}, "lease_id": "x"}"#, "lease-lost"),
            (r#"{"setpoint": {"thrust_n": 1e9}, "lease_id": "x"}"#, "out-of-range"),
        ] {
            socket.send(Message::text(message)).unwrap();
            let problem =
                wait("a problem", || Some(next(&mut socket)).filter(|answer| answer["title"].is_string()));
            assert_eq!(problem["type"], format!("urn:kort:problem:{slug}"), "{message}: {problem}");
        }

        socket.send(Message::text(r#"{"stop": true}"#)).unwrap();
        let stopped = wait("the stop's answer", || {
            Some(next(&mut socket)).filter(|answer| answer["stopped"].is_array())
        });
        assert_eq!(stopped["stopped"], json!(["t1"]));
        let lease = stack.expect("POST", "/lease", Some(json!({"holder": "stream", "ttl_ms": 20000})));
        let id = lease["lease_id"].as_str().unwrap();
        assert_eq!(put_json(stack.site.port, "POST", ARM, id, "").status, 200);
        socket
            .send(Message::text(
                json!({"setpoint": {"speed_rad_s": 30.0}, "lease_id": lease["lease_id"]}).to_string(),
            ))
            .unwrap();
        wait("the shaft to follow the stream's setpoint", || {
            let state = next(&mut socket);
            assert!(state["title"].is_null(), "{state}");
            let speed = state["measured"]["shaft_speed_rad_s"].as_f64()?;
            (state["setpoint"] == json!({"speed_rad_s": 30.0}) && (speed - 30.0).abs() < 6.0).then_some(())
        });
    });
}

#[test]
fn who_breaks_the_protocol_is_closed_with_a_reason_and_who_loses_the_lease_is_told() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let url = format!("ws://127.0.0.1:{}/v1/thrusters/t1/stream?hz=20", stack.site.port);
        let code = |message: Message| -> u16 {
            let (mut socket, _) = tungstenite::connect(&url).unwrap();
            socket.send(message).unwrap();
            loop {
                match socket.read() {
                    Ok(Message::Close(frame)) => return frame.map_or(0, |frame| frame.code.into()),
                    Ok(_) => (),
                    Err(_) => return 0,
                }
            }
        };
        assert_eq!(code(Message::binary(vec![1, 2, 3])), 1003);
        let lease = stack.expect("POST", "/lease", Some(json!({"holder": "stream", "ttl_ms": 20000})));
        let id = lease["lease_id"].as_str().unwrap().to_owned();
        let port = stack.site.port;
        assert_eq!(put_json(port, "POST", ARM, &id, "").status, 200);
        let (mut socket, _) = tungstenite::connect(&url).unwrap();
        socket
            .send(Message::text(json!({"setpoint": {"thrust_n": 5.0}, "lease_id": id}).to_string()))
            .unwrap();
        wait("the setpoint", || (stack.state()?["setpoint"]["thrust_n"] == 5.0).then_some(()));
        stack.expect("POST", "/lease", Some(json!({"holder": "bridge", "takeover": true})));
        let told = wait("the word of the takeover", || match socket.read().unwrap() {
            Message::Text(text) => {
                serde_json::from_str::<Value>(&text).ok().filter(|answer| answer["title"].is_string())
            }
            _ => None,
        });
        assert_eq!(
            (&told["type"], &told["holder"]),
            (&json!("urn:kort:problem:lease-lost"), &json!("bridge"))
        );
    });
}

/// What a stranger and a later diagnosis need stands in the file, and several recordings run at once.
#[test]
fn a_recording_holds_its_context_and_is_deleted_by_name() {
    common::in_real_time(|| {
        let mut stack = Stack::start_at(Site::new().with_t2());
        let port = stack.site.port;
        for (thruster, name) in [("t1", "one"), ("t2", "two")] {
            let body = json!({"thruster": thruster, "name": name, "rate_hz": 200}).to_string();
            assert_eq!(send(port, "POST", "/v1/recordings", &[JSON], body.as_bytes()).status, 201);
        }
        assert_problem(&send(port, "DELETE", "/v1/recordings", &[], b""), 409, "refused", "two run");
        stack.thrust(40.0, 60_000);
        std::thread::sleep(Duration::from_millis(1500));
        let metrics = stack.text("/metrics").unwrap();
        assert!(metrics.contains("kort_recording_active{thruster=\"t2\"} 1"), "{metrics}");
        for name in ["one", "two"] {
            let done = send(port, "DELETE", &format!("/v1/recordings/{name}"), &[], b"");
            assert_eq!((done.status, &done.json()["state"]), (200, &json!("complete")));
        }
        let file = send(port, "GET", "/v1/recordings/one", &[], b"").body;
        let recording = kort_recording::Recording::decode("one", file.as_slice(), None).unwrap();
        assert!(
            recording.losses.is_empty() && recording.notes.iter().all(|n| !n.contains("left out")),
            "{recording:?}"
        );
        let rig = std::fs::read_to_string(concat!(
            env!("CARGO_MANIFEST_DIR"),
            "/config/thrusters/whitcomb-yoerger-1999.toml"
        ));
        assert_eq!(recording.about["rig"], rig.unwrap());
        for key in ["kort_version", "rig_revision", "started", "thruster", "owner"] {
            assert!(!recording.about[key].is_empty(), "{key}");
        }
        let text = String::from_utf8_lossy(&file);
        assert!(text.contains("kort.state/1") && text.contains("kort.event/1"));
        // Wall time: the log does not begin in 1970.
        let path = stack.site.folder.path().join("one.mcap");
        std::fs::write(&path, &file).unwrap();
        let fit = common::run(std::process::Command::new(common::KORT).args(["fit", "--json"]).arg(&path));
        assert!(fit.status.success(), "no --rig is needed: {}", String::from_utf8_lossy(&fit.stderr));
        let torn = stack.site.folder.path().join("torn.mcap");
        std::fs::write(&torn, &file[..file.len() * 2 / 3]).unwrap();
        let fit = common::run(std::process::Command::new(common::KORT).args(["fit", "--json"]).arg(&torn));
        assert_eq!(fit.status.code(), Some(3), "{}", String::from_utf8_lossy(&fit.stderr));
        assert!(String::from_utf8_lossy(&fit.stderr).contains("cut off"), "the loss is named");
        assert_eq!(send(port, "DELETE", "/v1/recordings/one", &[], b"").status, 204);
        assert_problem(
            &send(port, "GET", "/v1/recordings/one", &[], b""),
            404,
            "unknown-recording",
            "deleted",
        );
    });
}

#[test]
fn a_recording_is_written_listed_and_fetched_in_both_formats() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let port = stack.site.port;
        let started = send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "step", "rate_hz": 100}"#);
        assert_eq!(started.status, 201, "{}", started.text());
        assert_problem(
            &send(port, "POST", "/v1/recordings", &[], b""),
            409,
            "recording-active",
            "a second recording",
        );
        stack.thrust(60.0, 60_000);
        std::thread::sleep(Duration::from_millis(1000));
        let stopped = send(port, "DELETE", "/v1/recordings", &[], b"").json();
        assert_eq!((&stopped["name"], &stopped["state"]), (&json!("step"), &json!("complete")), "{stopped}");
        let list = send(port, "GET", "/v1/recordings", &[], b"").json();
        assert_eq!(list[0]["rows"], stopped["rows"], "{list}");

        let csv = send(port, "GET", "/v1/recordings/step.csv", &[], b"");
        assert!(csv.head.contains("content-type: text/csv"), "{}", csv.head);
        assert_eq!(csv.body, send(port, "GET", "/v1/recordings/step?format=csv", &[], b"").body);
        let mcap = send(port, "GET", "/v1/recordings/step.mcap", &[], b"");
        assert!(
            mcap.body.starts_with(b"\x89MCAP0\r\n") && mcap.body.ends_with(b"\x89MCAP0\r\n"),
            "a whole MCAP"
        );

        let read = |name: &str, bytes: &[u8]| kort_recording::Recording::decode(name, bytes, None).unwrap();
        let (csv, mcap) = (read("step.csv", &csv.body), read("step.mcap", &mcap.body));
        assert_eq!(csv.rows() as u64, stopped["rows"].as_u64().unwrap());
        assert!(csv.losses.is_empty() && mcap.losses.is_empty());
        assert_eq!(csv.time_s, mcap.time_s);
        for column in csv.columns.iter().filter(|column| column.samples() > 0) {
            let other =
                mcap.column(&column.name).unwrap_or_else(|| panic!("{} is not in the MCAP", column.name));
            assert!(
                column.values.iter().zip(other).all(|(a, b)| a == b || (a.is_nan() && b.is_nan())),
                "{}",
                column.name
            );
        }
        assert!((csv.period_s() - 0.01).abs() < 0.002, "period {} s", csv.period_s());
        let thrust = csv.column("thrust_n").unwrap();
        assert!(thrust.iter().any(|n| (n - 60.0).abs() < 12.0), "the step is in the recording");
        assert!(
            csv.column("flow_m_s").unwrap().iter().any(|v| v.is_nan()),
            "a slow sensor leaves empty cells"
        );
    });
}

#[test]
fn a_killed_gateway_leaves_a_recording_that_reads_to_its_last_flush() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let port = stack.site.port;
        assert_eq!(send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "torn"}"#).status, 201);
        stack.thrust(40.0, 60_000);
        std::thread::sleep(Duration::from_millis(1500));
        let gateway = stack.process_of("gateway");
        kill(gateway, "KILL");
        wait("another gateway", || stack.process("gateway").filter(|pid| *pid != gateway));
        let list = wait("the list", || {
            let answer = std::panic::catch_unwind(|| send(port, "GET", "/v1/recordings", &[], b"")).ok()?;
            (answer.status == 200).then(|| answer.json())
        });
        assert_eq!((&list[0]["name"], &list[0]["state"]), (&json!("torn"), &json!("torn")), "{list}");
        for format in ["csv", "mcap"] {
            let file = send(port, "GET", &format!("/v1/recordings/torn?format={format}"), &[], b"");
            let recording = kort_recording::Recording::decode("torn", file.body.as_slice(), None).unwrap();
            assert!(recording.rows() > 50, "{format}: {} rows of some 150", recording.rows());
        }
    });
}

#[test]
fn a_control_law_is_switched_under_way_and_its_parameters_are_set() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(60.0, 60_000);
        let before = stack.expect("GET", "/controller", None);
        for law in before["available"].as_array().unwrap() {
            let (status, answer) =
                stack.http("PUT", "/controller", Some(json!({"controller": law}))).unwrap();
            if status == 409 {
                continue; // this rig lacks what the law needs, and the answer says so
            }
            assert_eq!((status, &answer["controller"]), (200, law), "{answer}");
            let state = stack.state().unwrap();
            assert_eq!(
                (&state["armed"], &state["faults"]),
                (&json!(true), &json!([])),
                "{law}: a switch is bumpless"
            );
        }
        let set = stack.expect("PUT", "/controller", Some(json!({"parameters": {"phase_margin_deg": 50.0}})));
        let margin =
            set["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "phase_margin_deg").unwrap();
        assert_eq!(margin["value"], 50.0);
        let (status, answer) = stack
            .http("PUT", "/controller", Some(json!({"parameters": {"phase_margin_deg": 500.0}})))
            .unwrap();
        assert!((400..500).contains(&status) && answer["detail"].is_string(), "{status} {answer}");
    });
}

#[test]
fn a_gateway_alone_says_what_is_away_and_still_shows_its_console() {
    let site = Site::new();
    let mut gateway = site.spawn("gateway");
    let ready = send(site.port, "GET", "/readyz", &[], b"");
    assert_problem(&ready, 503, "not-ready", "without servo and controller");
    assert_eq!(send(site.port, "GET", "/healthz", &[], b"").status, 200);
    let state = send(site.port, "GET", "/v1/thrusters", &[], b"").json();
    assert_eq!((&state[0]["armed"], &state[0]["measured"]["thrust_n"]), (&json!(false), &Value::Null));
    assert_problem(
        &send(site.port, "POST", "/v1/thrusters/t1/arm", &[], b""),
        503,
        "not-ready",
        "arming nothing",
    );
    assert!(send(site.port, "GET", "/", &[], b"").text().contains("<title>kort console</title>"));
    kill(gateway.id(), "TERM");
    let status = wait("the gateway to end", || gateway.try_wait().unwrap());
    assert_eq!(status.code(), Some(0), "{}", site.log());
}

#[test]
fn the_openapi_document_names_every_route_and_each_answers() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let document = send(port, "GET", "/openapi.json", &[], b"").json();
        for route in [
            "/",
            "/metrics",
            "/healthz",
            "/readyz",
            "/openapi.json",
            "/v1/thrusters",
            "/v1/thrusters/{id}",
            "/v1/recordings",
            "/v1/thrusters/{id}/lease",
            "/v1/thrusters/{id}/arm",
            "/v1/thrusters/{id}/disarm",
            "/v1/recordings/{name}",
            "/v1/thrusters/{id}/clear-faults",
            "/v1/thrusters/{id}/setpoint",
            "/v1/thrusters/{id}/controller",
            "/v1/thrusters/{id}/excitation",
            "/v1/thrusters/{id}/history",
            "/v1/thrusters/{id}/stream",
            "/v1/thrusters/{id}/rig",
            "/v1/thrusters/{id}/rig/rollback",
            "/v1/thrusters/{id}/rig/revisions",
            "/v1/thrusters/{id}/rig/revisions/{number}",
            "/v1/thrusters/{id}/diagnoses",
            "/v1/thrusters/{id}/diagnoses/{diagnosis}",
            "/v1/thrusters/{id}/diagnoses/{diagnosis}/report",
        ] {
            assert!(document["paths"][route].is_object(), "{route} is not documented");
        }
        for (path, methods) in document["paths"].as_object().unwrap() {
            let real = path
                .replace("{id}", "t1")
                .replace("{name}", "none")
                .replace("{code}", "4")
                .replace("{number}", "1");
            let real = real.replace("{diagnosis}", "none");
            for method in methods.as_object().unwrap().keys() {
                let answer = send(port, &method.to_uppercase(), &real, &[], b"");
                let documented = &document["paths"][path][method]["responses"][answer.status.to_string()];
                assert!(
                    documented.is_object(),
                    "{method} {path} answered {}, which is not documented",
                    answer.status
                );
            }
        }
        assert_eq!(send(port, "GET", "/docs/", &[], b"").status, 200);
        assert_eq!(send(port, "GET", "/docs/swagger-ui-bundle.js", &[], b"").status, 200);
    });
}
