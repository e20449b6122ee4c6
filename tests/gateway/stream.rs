//! The WebSocket stream.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::{self, Message};

use crate::asking::{ARM, put_json};
use crate::common::{self, Site, Stack, wait};

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

/// However often it is asked for: a client that draws each draws none twice.
#[test]
fn a_stream_faster_than_the_controller_sends_each_state_once() {
    common::in_real_time(|| {
        let stack = Stack::start_at(Site::new().with_a_fast_controller());
        let url = format!("ws://127.0.0.1:{}/v1/thrusters/t1/stream?hz=500", stack.site.port);
        let (mut socket, _) = tungstenite::connect(&url).unwrap();
        let begun = Instant::now();
        let (mut states, mut same) = (Vec::<String>::new(), 0);
        while begun.elapsed() < Duration::from_secs(2) {
            if let Message::Text(text) = socket.read().unwrap() {
                same += u32::from(states.last().is_some_and(|last| *last == text.as_str()));
                states.push(text.as_str().to_owned());
            }
        }
        assert!(states.len() > 50 && same == 0, "{same} of {} twice", states.len());
    });
}

/// Who closes is answered by a close of the same code, not by the end of the connection.
#[test]
fn a_close_is_answered() {
    let stack = Stack::start();
    let url = format!("ws://127.0.0.1:{}/v1/thrusters/t1/stream?hz=20", stack.site.port);
    let (mut socket, _) = tungstenite::connect(&url).unwrap();
    while !socket.read().unwrap().is_text() {}
    let frame = tungstenite::protocol::CloseFrame { code: 1000.into(), reason: "".into() };
    socket.close(Some(frame)).unwrap();
    let answer = loop {
        match socket.read() {
            Ok(Message::Close(frame)) => break frame.map(|frame| u16::from(frame.code)),
            Ok(_) => (),
            Err(error) => panic!("the connection ends without an answer: {error}"),
        }
    };
    assert_eq!(answer, Some(1000));
    assert!(
        matches!(socket.read(), Err(tungstenite::Error::ConnectionClosed)),
        "and then the connection ends"
    );
}

/// A reader that paused goes on with what is, not with what was: what lay on the way to it when it paused is a quarter of
/// a second of states and no more, whatever the rate and wherever between two pings it stopped.
#[test]
fn a_reader_that_paused_goes_on_with_the_newest_state() {
    common::in_real_time(|| {
        let stack = Stack::start_at(Site::new().with_a_fast_controller());
        for hz in [50, 500] {
            let url = format!("ws://127.0.0.1:{}/v1/thrusters/t1/stream?hz={hz}", stack.site.port);
            let (mut socket, _) = tungstenite::connect(&url).unwrap();
            let begun = Instant::now();
            // It stops right behind a ping that it has answered: the next one comes latest.
            while !matches!(socket.read().unwrap(), Message::Ping(_))
                || begun.elapsed() < Duration::from_millis(1500)
            {}
            socket.flush().unwrap();
            std::thread::sleep(Duration::from_millis(2500));
            let mut times = Vec::new();
            let gap = wait("the first new state", || {
                if let Message::Text(text) = socket.read().unwrap() {
                    let state: Value = serde_json::from_str(&text).unwrap();
                    times.push(state["time_s"].as_f64().unwrap());
                }
                let [.., old, new] = times[..] else { return None };
                (new - old > 1.0).then_some((old - times[0], new - old))
            });
            // A quarter of a second, and what a busy machine adds to it.
            assert!(gap.0 < 0.4, "{hz} Hz: {:.3} s of old states, then a gap of {:.3} s", gap.0, gap.1);
            // From there on every state comes again.
            let before = times.len();
            let again = Instant::now();
            while again.elapsed() < Duration::from_secs(1) {
                if let Message::Text(_) = socket.read().unwrap() {
                    times.push(0.0);
                }
            }
            let came = times.len() - before;
            assert!(came as u32 > hz / 4, "{came} states in a second at {hz} Hz");
        }
    });
}
