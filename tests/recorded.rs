//! What the service recorded, in the hands of others: the laboratory without a rig description, and a stranger's reader.
//!
//! The stranger is Python's `mcap` package, which tests/run.sh installs; `KORT_PYTHON` names its interpreter.

mod common;

use std::process::Command;
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use common::{KORT, Stack, kill, run, wait};
use serde_json::{Value, json};

/// Starts a recording of this name.
fn record(stack: &Stack, name: &str) {
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let url = format!("http://127.0.0.1:{}/v1/recordings", stack.site.port);
    let started = agent.post(url).send_json(json!({"name": name, "rate_hz": 100})).expect("an answer");
    assert_eq!(started.status(), 201);
}

/// A recording of the service says which rig it is of: it is diagnosed by its own word, and the same as with `--rig`.
#[test]
fn a_recording_of_the_service_is_diagnosed_without_a_rig() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        record(&stack, "steps");
        for newton in [40.0, 80.0, 30.0] {
            stack.thrust(newton, 60_000);
            std::thread::sleep(Duration::from_millis(1500));
        }
        let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
        agent
            .delete(format!("http://127.0.0.1:{}/v1/recordings", stack.site.port))
            .call()
            .expect("an answer");
        let file = stack.site.folder.path().join("recordings/steps.mcap");
        let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/whitcomb-yoerger-1999.toml");
        let diagnose = |more: &[&str]| -> Value {
            let out = run(Command::new(KORT).args(["diagnose", "--json"]).args(more).arg(&file));
            let words = String::from_utf8_lossy(&out.stderr);
            assert!(matches!(out.status.code(), Some(0 | 3)), "{words}");
            let mut report: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
            report["seconds"] = Value::Null;
            report
        };
        let report = diagnose(&[]);
        assert_eq!(report["schema"], "kort.diagnosis/2");
        assert_eq!(report["rig"], "whitcomb-yoerger-1999", "{report}");
        let given = diagnose(&["--rig", rig]);
        assert_eq!((&report["verdict"], &report["baseline"]), (&given["verdict"], &given["baseline"]));
    });
}

/// A disk that takes its time to begin a recording, here a pipe that nobody reads, holds up who asked for it, and no more.
#[test]
fn a_recording_that_the_disk_holds_up_does_not_touch_the_thrust() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(50.0, 60_000);
        let folder = stack.site.folder.path().join("recordings");
        let pipe = folder.join(".slow.draft");
        assert!(run(Command::new("mkfifo").arg(&pipe)).status.success());
        let url = format!("http://127.0.0.1:{}/v1/recordings", stack.site.port);
        let asked = std::thread::spawn(move || ureq::post(url).send_json(json!({"name": "slow"})).is_ok());
        wait("the file", || folder.join("slow.mcap").is_file().then_some(()));
        let mut watch = stack.watch();
        let from_ns = watch.next().time_ns;
        // Longer than a gateway may be silent, and than the setpoint then takes to zero.
        watch.until("a second", |t| {
            assert!(t.armed == 1 && t.faults == 0, "{t:?}");
            t.time_ns > from_ns + 1_200_000_000
        });
        assert!(!asked.is_finished(), "the disk still holds it up");
        std::fs::read(&pipe).expect("what it writes");
        assert!(asked.join().unwrap(), "it runs after all");
    });
}

/// kill -9 of the gateway: another's reader finds all but the last second, with setpoint, law, limits, faults, events,
/// rig, and the estimates with their standard errors.
#[test]
fn a_stranger_reads_the_file_of_a_killed_gateway_up_to_its_last_second() {
    let Ok(python) = std::env::var("KORT_PYTHON") else {
        println!("not run: KORT_PYTHON names no interpreter with the package mcap");
        return;
    };
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.expect("PUT", "/controller", Some(json!({"estimator": "rls"})));
        record(&stack, "torn");
        stack.thrust(50.0, 60_000);
        wait("an estimate with its error", || {
            let state = stack.state()?;
            state["estimated"]["parameters"]
                .as_array()?
                .iter()
                .any(|p| p["std_error"].is_number())
                .then_some(())
        });
        std::thread::sleep(Duration::from_millis(1200));
        let gateway = stack.process_of("gateway");
        kill(gateway, "KILL");
        let killed_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos() as i128;
        let file = stack.site.folder.path().join("recordings/torn.mcap");
        let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/read_mcap.py");
        let out = run(Command::new(&python).arg(script).arg(&file));
        assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
        let read: Value = serde_json::from_slice(&out.stdout).expect("one JSON document");
        assert_eq!(read["indexed"], false, "it was killed: {read}");
        for topic in ["/t1", "/t1/state"] {
            let last_ns = i128::from(read["topics"][topic]["last_ns"].as_i64().expect("messages"));
            let lost_s = (killed_ns - last_ns) as f64 * 1e-9;
            assert!((-0.1..1.0).contains(&lost_s), "{topic}: the last {lost_s} s are missing");
        }
        assert!(read["topics"]["/events"]["messages"].as_u64() > Some(0), "{read}");
        // What the fields are, and in which unit: of the signals, and of what stands beside them.
        let fields = |topic: &str| read["topics"][topic]["fields"].clone();
        let (rows, beside) = (fields("/t1"), fields("/t1/state"));
        assert_eq!(rows["thrust_n"]["unit"], "N", "{rows}");
        assert!(
            rows["thrust_n"]["description"].as_str().is_some_and(|words| words.ends_with("[N]")),
            "{rows}"
        );
        let flow = &beside["estimated"]["properties"]["flow_m_s"];
        assert_eq!((&flow["type"], &flow["unit"]), (&json!("number"), &json!("m/s")), "{beside}");
        assert_eq!(fields("/events")["detail"]["type"], "string");
        let state = &read["state"];
        assert_eq!(
            (&state["armed"], &state["setpoint"]["thrust_n"]),
            (&json!(true), &json!(50.0)),
            "{state}"
        );
        assert!(state["controller"].is_string() && state["limits"].is_array() && state["faults"].is_array());
        let estimates = state["estimated"]["parameters"].as_array().expect("estimates");
        assert!(estimates.iter().any(|p| p["std_error"].as_f64().is_some_and(|e| e > 0.0)), "{estimates:?}");
        assert!(
            read["about"]["kort"]["rig"].as_str().is_some_and(|rig| rig.contains("[propeller]")),
            "{read}"
        );
    });
}
