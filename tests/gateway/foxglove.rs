//! The live server for Foxglove, as its protocol has it, and the layout that plots it.

use kort_proto::signals::SIGNALS;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::{Message, connect};

use crate::common::{self, KORT, Site, Stack, kill, run, wait};

#[test]
fn signals_come_live_in_foxgloves_protocol() {
    common::in_real_time(|| {
        let site = Site::new();
        let port = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
        site.add("[gateway]", &format!("foxglove = \"127.0.0.1:{port}\""));
        let mut stack = Stack::start_at(site);
        stack.thrust(40.0, 60_000);
        let mut request = format!("ws://127.0.0.1:{port}").into_client_request().unwrap();
        request.headers_mut().insert("Sec-WebSocket-Protocol", "foxglove.websocket.v1".parse().unwrap());
        let (mut socket, answer) = connect(request).unwrap();
        assert_eq!(answer.headers()["sec-websocket-protocol"], "foxglove.websocket.v1");
        let mut text =
            || -> Value { serde_json::from_str(socket.read().unwrap().to_text().unwrap()).unwrap() };
        assert_eq!(text()["op"], "serverInfo");
        let advertised = text();
        let channels = advertised["channels"].as_array().unwrap().clone();
        let topics: Vec<&str> = channels.iter().map(|channel| channel["topic"].as_str().unwrap()).collect();
        assert_eq!(topics, ["/t1", "/t1/state"]);
        let schema: Value = serde_json::from_str(channels[0]["schema"].as_str().unwrap()).unwrap();
        assert!(
            schema["properties"]["thrust_n"]["description"].as_str().unwrap().contains("[N]"),
            "{schema}"
        );
        let wanted = json!({"op": "subscribe", "subscriptions": [
            {"id": 7, "channelId": channels[0]["id"]}, {"id": 9, "channelId": channels[1]["id"]}]});
        socket.send(Message::text("nonsense")).unwrap();
        socket.send(Message::text(wanted.to_string())).unwrap();
        let (mut rows, mut states, mut last) = (0, 0, (0.0, 0));
        while rows < 20 || states == 0 {
            let Message::Binary(bytes) = socket.read().unwrap() else { continue };
            assert_eq!(bytes[0], 1);
            let id = u32::from_le_bytes(bytes[1..5].try_into().unwrap());
            let stamp_ns = u64::from_le_bytes(bytes[5..13].try_into().unwrap());
            let message: Value = serde_json::from_slice(&bytes[13..]).unwrap();
            match id {
                7 => {
                    let time_s = message["time_s"].as_f64().unwrap();
                    assert!(time_s > last.0 && stamp_ns > last.1, "{message}");
                    assert!(message["shaft_speed_rad_s"].is_f64(), "{message}");
                    (rows, last) = (rows + 1, (time_s, stamp_ns));
                }
                9 => {
                    assert!(message["estimated"]["thrust_n"].is_f64(), "{message}");
                    states += 1;
                }
                other => panic!("nobody asked for {other}"),
            }
        }
        let age_s = std::time::SystemTime::now().duration_since(std::time::UNIX_EPOCH).unwrap().as_secs_f64()
            - last.1 as f64 * 1e-9;
        assert!((0.0..20.0).contains(&age_s), "stamped with the wall time: {age_s} s ago");
    });
}

/// It asks for no token: so it stays on this machine, and off where tokens are wanted.
#[test]
fn it_is_refused_where_it_would_open_what_is_closed() {
    for (line, words) in [
        ("foxglove = \"0.0.0.0:8765\"", "addresses of this machine"),
        ("foxglove = \"127.0.0.1:8765\"\nrequire_tokens = true", "require_tokens"),
        ("foxglove = \"here\"", "IP:PORT"),
        ("foxglove = \"127.0.0.1:0\"", "1 to 65535"),
        ("foxglove = \"127.0.0.1:{own}\"", "that of gateway.bind"),
    ] {
        let site = Site::new();
        site.add("[gateway]", &line.replace("{own}", &site.port.to_string()));
        let checked = run(std::process::Command::new(KORT).arg("check").arg(site.config()));
        let said =
            String::from_utf8_lossy(&checked.stderr).into_owned() + &String::from_utf8_lossy(&checked.stdout);
        assert!(!checked.status.success() && said.contains(words), "{line}: {said}");
    }
}

/// A port that is taken is told before anything starts; one that is taken later costs nothing but itself.
#[test]
fn a_taken_port_is_told_and_keeps_no_gateway_from_running() {
    let site = Site::new();
    let taken = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    site.add("[gateway]", &format!("foxglove = \"127.0.0.1:{port}\""));
    let out = run(&mut site.command("up"));
    let said = String::from_utf8_lossy(&out.stderr);
    assert!(
        !out.status.success() && said.contains(&format!("gateway.foxglove = 127.0.0.1:{port}")),
        "{said}"
    );
    drop(taken);
    let stack = Stack::start_at(site);
    let first = stack.process_of("gateway");
    // Its successor finds the port with somebody else.
    kill(first, "KILL");
    let taken = wait("the port", || std::net::TcpListener::bind(("127.0.0.1", port)).ok());
    wait("a successor", || stack.process("gateway").filter(|pid| *pid != first));
    wait("its word", || stack.site.log().contains("another port, or leave the key out").then_some(()));
    stack.wait_until_up();
    drop(taken);
}

#[test]
fn the_layout_plots_signals_that_there_are() {
    let layout: Value = serde_json::from_str(include_str!("../../docs/foxglove/kort.json")).unwrap();
    let mut plotted = 0;
    for panel in layout["configById"].as_object().unwrap().values() {
        for path in panel["paths"].as_array().into_iter().flatten() {
            let path = path["value"].as_str().unwrap();
            let known = path.strip_prefix("/t1.").is_some_and(|name| SIGNALS.iter().any(|s| s.name == name));
            let estimated =
                ["thrust_n", "flow_m_s", "ambient_m_s"].map(|name| format!("/t1/state.estimated.{name}"));
            assert!(known || estimated.iter().any(|one| one == path), "{path}");
            plotted += 1;
        }
    }
    assert!(plotted >= 8, "{plotted}");
}
