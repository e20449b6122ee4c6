//! `kort calibrate` on a living servo: what it says before it drives, a wiring fault, and Ctrl-C.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

use crate::common::{Site, Stack, wait};

/// A session on this site, nobody asked.
fn calibrate(site: &Site, more: &[&str]) -> std::process::Command {
    let mut command = site.command("calibrate");
    command.args(["--json", "-o", "new.toml"]).args(more);
    command.stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Attempts at a session that a machine which stands still, as a busy one does, ends before its time.
const ATTEMPTS: usize = 4;

/// Whether the servo ended it because its commands or its own tick came late.
fn was_held_up(talk: &str) -> bool {
    talk.contains("command_timeout") || talk.contains("loop_stalled")
}

/// A session to its end that no machine standing still cut short: exit code, what it said, its report.
fn undisturbed(site: &Site, more: &[&str]) -> (Option<i32>, String, Vec<u8>) {
    for _ in 0..ATTEMPTS {
        let output = calibrate(site, more).output().unwrap();
        let talk = String::from_utf8_lossy(&output.stderr).into_owned();
        if !was_held_up(&talk) {
            return (output.status.code(), talk, output.stdout);
        }
    }
    panic!("held up {ATTEMPTS} times");
}

#[test]
fn a_reversed_encoder_is_named_and_no_rig_is_written() {
    let site = Site::new();
    site.add("[thrusters.t1]", "simulation = { sensor_fault = \"reversed\" }");
    let (code, talk, report) = undisturbed(&site, &["--yes"]);
    assert_eq!(code, Some(1), "{talk}");
    let report: Value = serde_json::from_slice(&report).unwrap();
    assert_eq!(report["schema"], "kort.calibration/1");
    let stopped = report["stopped"].as_str().unwrap();
    assert!(stopped.contains("the shaft sensor is reversed") && stopped.contains("hint:"), "{stopped}");
    // Said before it was done; nothing after it was begun.
    assert!(talk.contains("first_movement: ") && !talk.contains("working_range: "), "{talk}");
    assert!(!site.folder.path().join("new.toml").exists());
    // What it was seen by is kept.
    assert_eq!(report["recording"], "new.csv.gz", "{report}");
    assert!(std::fs::metadata(site.folder.path().join("new.csv.gz")).unwrap().len() > 1000);
}

#[test]
fn ctrl_c_ends_it_at_zero_and_nobody_who_is_not_there_agrees() {
    let site = Site::new();
    let rest = (0..ATTEMPTS).find_map(|_| interrupted(&site)).expect("a session that was not held up");
    assert!(rest.contains("drive off"), "the servo ends in order: {rest}");
    assert!(rest.contains("aborted"), "{rest}");
    // Without --yes and without a terminal nothing is driven, and a file that somebody left empty stays.
    let left = site.folder.path().join("new.toml");
    std::fs::write(&left, "").unwrap();
    let (code, talk, _) = undisturbed(&site, &[]);
    assert_eq!(code, Some(1), "{talk}");
    assert!(talk.contains("nobody agreed to zeros") && talk.contains("--yes"), "{talk}");
    assert!(left.exists());
}

/// A session that is interrupted in its first movement, and what it said after that; none where it was held up.
fn interrupted(site: &Site) -> Option<String> {
    let mut child = calibrate(site, &["--yes"]).spawn().unwrap();
    let mut talk = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    let before: Vec<String> =
        talk.by_ref().take_while(|line| !line.starts_with("first_movement: ")).collect();
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw).unwrap();
    // It may have ended by itself, where it was held up.
    let _ = kill_process(pid, Signal::INT);
    let rest: Vec<String> = talk.collect();
    let (rest, status) = (rest.join("\n"), child.wait().unwrap());
    if was_held_up(&before.join("\n")) || was_held_up(&rest) {
        return None;
    }
    assert_eq!(status.code(), Some(1), "{before:?} {rest}");
    Some(rest)
}

/// Waits until the calibration asks for a stage, and returns its words; a session that is over was held up.
fn asked(stack: &Stack, id: &str, stage: &str) -> Option<String> {
    wait("the stage to be asked for, or an end", || {
        let info = stack.expect("GET", &format!("/calibrations/{id}"), None);
        if info["state"] != "running" {
            assert!(was_held_up(&info.to_string()), "{info}");
            return Some(None);
        }
        let words = info["asks"].as_str().filter(|_| info["stage"] == stage)?;
        Some(Some(words.to_owned()))
    })
}

fn over(stack: &Stack, id: &str) -> Value {
    wait("the calibration to be over", || {
        let info = stack.expect("GET", &format!("/calibrations/{id}"), None);
        (info["state"] != "running").then_some(info)
    })
}

/// Begins a session; a controller that stood aside for one before is heard again within its next periods.
fn begin(stack: &Stack, body: Option<Value>) -> Value {
    wait("the controller to be heard", || {
        let (status, begun) = stack.http("POST", "/calibrations", body.clone())?;
        (status != 503).then(|| {
            assert!(status < 300, "{status} {begun}");
            begun
        })
    })
}

fn kind(answer: Option<(u16, Value)>) -> (u16, String) {
    let (status, body) = answer.expect("an answer");
    (status, body["type"].as_str().unwrap_or_default().trim_start_matches("urn:kort:problem:").to_owned())
}

/// The service's own servo, asked for by the interface: it says what it will do, needs the lease at every step, bears
/// nobody beside it, and ends at zero with a word; then the controller drives again as if nothing had been.
#[test]
fn a_running_service_calibrates_under_the_lease_and_drives_on_after_it() {
    let mut stack = Stack::start();
    let none = |stack: &Stack| kind(stack.http("POST", "/calibrations", None));
    assert_eq!(none(&stack), (403, "lease-required".into()), "nobody has the lease");
    stack.command(0.0, 60_000);
    assert_eq!(none(&stack), (409, "refused".into()), "it is armed");
    stack.expect("POST", "/disarm", None);
    let odd = kind(stack.http("POST", "/calibrations", Some(json!({"share": 1.5}))));
    assert_eq!(odd, (422, "out-of-range".into()));

    let go_on = |stack: &Stack, id: &str, stage: &str| {
        stack.http("POST", &format!("/calibrations/{id}/go-on"), Some(json!({"stage": stage})))
    };
    let aborted = (0..ATTEMPTS).find_map(|_| {
        let begun = begin(&stack, Some(json!({"share": 0.2})));
        let id = begun["id"].as_str().unwrap().to_owned();
        let words = asked(&stack, &id, "zeros")?;
        assert!(words.contains("the shaft stands"), "{words}");
        assert_eq!(stack.state().unwrap()["calibration"]["stage"], "zeros");
        for (method, path, body) in [
            ("POST", "/arm", None),
            ("PUT", "/setpoint", Some(json!({"thrust_n": 5.0}))),
            ("POST", "/calibrations", None),
        ] {
            assert_eq!(kind(stack.http(method, path, body)), (409, "calibration-active".into()), "{path}");
        }
        assert_eq!(kind(go_on(&stack, &id, "working_range")), (409, "refused".into()));
        assert_eq!(go_on(&stack, &id, "zeros").unwrap().0, 200);
        let words = asked(&stack, &id, "first_movement")?;
        assert!(words.contains("the shaft turns by some 0.08 rad a pulse"), "{words}");
        assert_eq!(go_on(&stack, &id, "first_movement").unwrap().0, 200);
        asked(&stack, &id, "direction")?;
        assert_eq!(stack.expect("DELETE", &format!("/calibrations/{id}"), None)["id"], id.as_str());
        assert_eq!(stack.state().unwrap()["armed"], false, "zero torque with the answer");
        let info = over(&stack, &id);
        assert_eq!((&info["state"], &info["cause"]), (&json!("aborted"), &json!("local aborted it")));
        assert_eq!(info["report"]["steps"][0]["name"], "zeros", "what was found is told: {info}");
        assert_eq!(kind(stack.http("GET", &format!("/calibrations/{id}/rig"), None)).0, 409);
        assert!(info["report"]["recording"].as_str().is_some_and(|file| file.ends_with("recording.mcap")));
        Some(id)
    });
    let aborted = aborted.expect("a session that was not held up");

    // Who takes command is named.
    let begun = begin(&stack, None);
    let wanted = json!({"holder": "bridge", "ttl_ms": 60_000, "takeover": true});
    let lease = stack.expect("POST", "/lease", Some(wanted));
    let info = over(&stack, begun["id"].as_str().unwrap());
    assert_eq!((&info["state"], &info["cause"]), (&json!("aborted"), &json!("bridge took command")));
    stack.leases.insert("t1", lease["lease_id"].as_str().unwrap().to_owned());

    // It lives under its lease.
    let begun = begin(&stack, None);
    let id = begun["id"].as_str().unwrap();
    stack.expect("DELETE", "/lease", None);
    stack.leases.clear();
    let info = over(&stack, id);
    assert_eq!((&info["state"], &info["cause"]), (&json!("aborted"), &json!("its lease ended")));

    // The controller has its place again.
    stack.thrust(30.0, 60_000);
    assert!(stack.state().unwrap()["calibration"].is_null());
    let (status, _) = stack.http("DELETE", &format!("/calibrations/{aborted}"), None).unwrap();
    assert_eq!(status, 204);
    let events = stack.get("/v1/events").unwrap().to_string();
    assert!(
        events.contains("calibration_started") && events.contains("is aborted: its lease ended"),
        "{events}"
    );
}
