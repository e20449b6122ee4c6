//! Recordings: written, listed, fetched, and left by a killed gateway.

use std::time::Duration;

use serde_json::json;

use crate::asking::{JSON, assert_problem, send};
use crate::common::{self, Site, Stack, kill, wait};

/// One word begins a recording of every thruster, on one time, and one ends them.
#[test]
fn a_set_records_every_thruster_on_one_time() {
    common::in_real_time(|| {
        let stack = Stack::start_at(Site::new().with_t2());
        let port = stack.site.port;
        let sets = "/v1/recording-sets";
        let begun =
            send(port, "POST", sets, &[JSON], br#"{"name": "dive", "rate_hz": 200, "tags": ["pool"]}"#);
        assert_eq!((begun.status, &begun.json()["name"]), (201, &json!("dive")));
        let again = send(port, "POST", sets, &[JSON], br#"{"name": "dive"}"#);
        assert_problem(&again, 409, "recording-active", "the same name");
        let long = json!({"name": "a".repeat(48)}).to_string();
        assert_problem(&send(port, "POST", sets, &[JSON], long.as_bytes()), 422, "out-of-range", "too long");
        std::thread::sleep(Duration::from_millis(1500));
        let done = send(port, "DELETE", "/v1/recording-sets/dive", &[], b"");
        assert_eq!(done.status, 200);
        let done = done.json()["recordings"].clone();
        for (place, thruster) in ["t1", "t2"].iter().enumerate() {
            let info = &done[place];
            assert_eq!((&info["thruster"], &info["set"]), (&json!(thruster), &json!("dive")), "{info}");
            assert_eq!((&info["state"], &info["tags"]), (&json!("complete"), &json!(["pool"])), "{info}");
            assert_eq!(info["started"], done[0]["started"], "{info}");
            let file = send(port, "GET", &format!("/v1/recordings/dive-{thruster}"), &[], b"").body;
            let recording = kort_recording::Recording::decode("dive", file.as_slice(), None).unwrap();
            let (first, last) = (recording.time_s[0], recording.time_s[recording.rows() - 1]);
            assert!(first < 0.5 && last > 1.0, "{thruster}: {first} to {last} s");
        }
        assert_problem(
            &send(port, "DELETE", "/v1/recording-sets/dive", &[], b""),
            409,
            "no-recording",
            "over",
        );
    });
}

/// What a stranger and a later diagnosis need stands in the file, and several recordings run at once.
#[test]
fn a_recording_holds_its_context_and_is_deleted_by_name() {
    common::in_real_time(|| {
        let mut stack = Stack::start_at(Site::new().with_t2());
        let port = stack.site.port;
        let nobody = send(port, "POST", "/v1/recordings", &[JSON], b"{}");
        assert_problem(&nobody, 422, "invalid-field", "of two thrusters neither is meant");
        assert_eq!(nobody.json()["allowed"], json!(["t1", "t2"]));
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
        // With an ending it would stand for a file of another: nobody could tell `step.mcap` from the file of `step`.
        for name in ["step.mcap", "other.csv"] {
            let body = json!({ "name": name }).to_string();
            let refused = send(port, "POST", "/v1/recordings", &[JSON], body.as_bytes());
            assert_problem(&refused, 422, "out-of-range", name);
        }
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
        // Nobody asked for its end: it is told, and an alert has what to look at.
        let events = send(port, "GET", "/v1/events", &[], b"").text();
        assert!(events.contains("recording torn ended by itself: the gateway was killed"), "{events}");
        let metrics = send(port, "GET", "/metrics", &[], b"").text();
        assert!(metrics.contains("kort_recordings_failed_total{thruster=\"t1\"} 1"), "{metrics}");
        for format in ["csv", "mcap"] {
            let file = send(port, "GET", &format!("/v1/recordings/torn?format={format}"), &[], b"");
            let recording = kort_recording::Recording::decode("torn", file.body.as_slice(), None).unwrap();
            assert!(recording.rows() > 50, "{format}: {} rows of some 150", recording.rows());
        }
    });
}

/// A recording that nobody stops ends at its time, and none begins that would leave too little space to others; the
/// thrust goes on.
#[test]
fn a_recording_ends_at_its_time_and_leaves_space_to_others() {
    common::in_real_time(|| {
        let site = Site::new();
        site.add("[gateway]", "recording = { time_max_s = 1.0, free_bytes_min = 0 }");
        let mut stack = Stack::start_at(site);
        let port = stack.site.port;
        stack.thrust(30.0, 60_000);
        assert_eq!(send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "short"}"#).status, 201);
        let ended = wait("the recording to end", || {
            let list = send(port, "GET", "/v1/recordings", &[], b"").json();
            Some(list[0].clone()).filter(|info| info["state"] != "recording")
        });
        assert_eq!(ended["state"], "complete", "{ended}");
        assert!(ended["cause"].as_str().unwrap().contains("time_max_s = 1"), "{ended}");
        assert!((1.0..1.2).contains(&ended["duration_s"].as_f64().unwrap()), "{ended}");
        let t = stack.watch().next();
        assert!(t.armed == 1 && t.faults == 0, "the thrust is untouched: {t:?}");
    });
    let site = Site::new();
    site.add("[gateway]", "recording = { free_bytes_min = 1000000000000000 }");
    let stack = Stack::start_at(site);
    let port = stack.site.port;
    let refused = send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "none"}"#);
    assert_problem(&refused, 507, "recording-failed", "too little space");
    assert!(refused.text().contains("free_bytes_min"), "{}", refused.text());
    assert_eq!(send(port, "GET", "/v1/recordings", &[], b"").json(), json!([]), "nothing is left of it");
}

/// A recording that cannot begin leaves nothing behind: its name is free once there is space.
#[test]
fn a_recording_that_a_full_disk_refuses_does_not_keep_its_name() {
    use rustix::process::{Pid, Resource, Rlimit, getrlimit, prlimit};
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let gateway = i32::try_from(stack.process_of("gateway")).ok().and_then(Pid::from_raw);
        let usual = getrlimit(Resource::Fsize);
        let start = || send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "dive"}"#);
        // Files may not grow beyond what the head of a recording needs: to whoever writes, a full disk.
        prlimit(gateway, Resource::Fsize, Rlimit { current: Some(1024), ..usual }).unwrap();
        let refused = start();
        prlimit(gateway, Resource::Fsize, usual).unwrap();
        assert!(matches!(refused.status, 500 | 507), "{}", refused.text());
        let file = stack.site.folder.path().join("recordings/dive.mcap");
        assert!(!file.exists(), "nothing is left of it");
        assert_eq!(send(port, "GET", "/v1/recordings", &[], b"").json(), json!([]));
        let begun = start();
        assert_eq!(begun.status, 201, "{}", begun.text());
        assert_eq!(send(port, "DELETE", "/v1/recordings/dive", &[], b"").status, 200);
    });
}

/// A folder that was removed meanwhile is made anew.
#[test]
fn a_removed_folder_is_made_again_by_the_next_recording() {
    common::in_real_time(|| {
        let stack = Stack::start_at(Site::new());
        let folder = stack.site.folder.path().join("recordings");
        std::fs::remove_dir_all(&folder).unwrap();
        let begun = send(stack.site.port, "POST", "/v1/recordings", &[JSON], br#"{"name": "again"}"#);
        assert_eq!(begun.status, 201, "{}", begun.text());
        let done = send(stack.site.port, "DELETE", "/v1/recordings/again", &[], b"");
        assert_eq!((done.status, &done.json()["state"]), (200, &json!("complete")));
        assert!(folder.join("again.mcap").is_file());
    });
}
