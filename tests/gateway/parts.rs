//! Recordings that go on in further files: each part is a recording of its own, and together they are one.

use serde_json::{Value, json};

use crate::asking::{JSON, assert_problem, send};
use crate::common::{self, Site, Stack, wait};

/// A service whose recordings go on in another file every second or so.
fn rotating() -> Stack {
    let site = Site::new();
    site.add("[gateway]", "recording = { file_bytes_max = 65536, free_bytes_min = 0 }");
    Stack::start_at(site)
}

pub fn record(port: u16, name: &str) {
    let body = json!({"name": name, "rate_hz": 200}).to_string();
    let begun = send(port, "POST", "/v1/recordings", &[JSON], body.as_bytes());
    assert_eq!(begun.status, 201, "{name}: {}", begun.text());
}

pub fn list(port: u16) -> Vec<Value> {
    send(port, "GET", "/v1/recordings", &[], b"").json().as_array().unwrap().clone()
}

/// The part that is being written, once it is none of these.
fn going_on(port: u16, past: &[&str]) -> String {
    wait("the recording to go on in another file", || {
        let running = list(port).into_iter().find(|info| info["state"] == "recording")?;
        Some(running["name"].as_str()?.to_owned()).filter(|name| !past.contains(&name.as_str()))
    })
}

#[test]
fn the_part_being_written_is_tagged_and_stopped_by_its_own_name_and_never_deleted_under_way() {
    common::in_real_time(|| {
        let stack = rotating();
        let port = stack.site.port;
        record(port, "base");
        assert_eq!(going_on(port, &["base"]), "base-2");
        let tagged = send(port, "PATCH", "/v1/recordings/base-2", &[JSON], br#"{"tags": ["tow"]}"#);
        assert_eq!((tagged.status, &tagged.json()["name"]), (200, &json!("base-2")), "{}", tagged.text());
        let done = send(port, "DELETE", "/v1/recordings/base-2", &[], b"");
        assert_eq!(done.status, 200, "it ran: {}", done.text());
        let done = done.json();
        assert_eq!((&done["name"], &done["state"]), (&json!("base-2"), &json!("complete")), "{done}");
        assert_eq!(done["tags"], json!(["tow"]), "what was given while it ran stays");
        let listed: Vec<_> =
            list(port).iter().map(|info| (info["name"].clone(), info["tags"].clone())).collect();
        assert_eq!(listed, [(json!("base"), json!([])), (json!("base-2"), json!(["tow"]))]);
        assert_eq!(send(port, "GET", "/v1/recordings/base-2", &[], b"").status, 200);
        assert_eq!(stack.state().unwrap()["faults"], json!([]));
        assert_eq!(send(port, "DELETE", "/v1/recordings/base-2", &[], b"").status, 204, "it is done");
        // By the name it was started by it is stopped as a whole, whichever part is being written.
        record(port, "whole");
        assert_eq!(going_on(port, &["whole"]), "whole-2");
        assert_eq!(send(port, "DELETE", "/v1/recordings/whole", &[], b"").json()["name"], "whole-2");
    });
}

#[test]
fn a_name_that_is_taken_is_passed_over_and_a_long_one_has_room_for_its_number() {
    common::in_real_time(|| {
        let stack = rotating();
        let port = stack.site.port;
        record(port, "x-2");
        assert_eq!(send(port, "DELETE", "/v1/recordings/x-2", &[], b"").status, 200);
        record(port, "x");
        assert_eq!(going_on(port, &["x"]), "x-3");
        assert_eq!(send(port, "DELETE", "/v1/recordings/x", &[], b"").status, 200);
        let long = "n".repeat(64);
        record(port, &long);
        let second = going_on(port, &[&long]);
        assert_eq!(second, format!("{long}-2"));
        assert_eq!(send(port, "GET", &format!("/v1/recordings/{second}"), &[], b"").status, 200);
        assert_eq!(send(port, "DELETE", &format!("/v1/recordings/{second}"), &[], b"").status, 200);
        let longer = json!({"name": "n".repeat(65)}).to_string();
        let refused = send(port, "POST", "/v1/recordings", &[JSON], longer.as_bytes());
        assert_problem(&refused, 422, "out-of-range", "65 characters");
    });
}

/// A counter goes up alone, and tells what the list tells.
#[test]
fn the_rows_of_all_parts_are_counted() {
    common::in_real_time(|| {
        let stack = rotating();
        let port = stack.site.port;
        let counted = |name: &str| -> f64 {
            let line = format!("kort_recording_{name}_total{{thruster=\"t1\"}} ");
            let metrics = stack.text("/metrics").unwrap();
            metrics.lines().find_map(|l| l.strip_prefix(&line)).unwrap().parse().unwrap()
        };
        record(port, "base");
        let mut last = 0.0;
        wait("a third part", || {
            let now = counted("rows");
            assert!(now >= last, "{last} rows, and then {now}");
            last = now;
            list(port).iter().any(|info| info["name"] == "base-3").then_some(())
        });
        assert_eq!(send(port, "DELETE", "/v1/recordings", &[], b"").status, 200);
        let all: f64 = list(port).iter().map(|info| info["rows"].as_f64().unwrap()).sum();
        assert_eq!(counted("rows"), all);
        let lost: f64 = list(port).iter().map(|info| info["lost_samples"].as_f64().unwrap()).sum();
        assert_eq!(counted("lost_samples"), lost);
    });
}
