//! `kort calibrate` on a living servo: what it says before it drives, a wiring fault, and Ctrl-C.

use std::io::{BufRead, BufReader};
use std::process::Stdio;

use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::common::Site;

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
}

#[test]
fn ctrl_c_ends_it_at_zero_and_nobody_who_is_not_there_agrees() {
    let site = Site::new();
    let rest = (0..ATTEMPTS).find_map(|_| interrupted(&site)).expect("a session that was not held up");
    assert!(rest.contains("drive off"), "the servo ends in order: {rest}");
    assert!(rest.contains("aborted"), "{rest}");
    // Without --yes and without a terminal nothing is driven.
    let (code, talk, _) = undisturbed(&site, &[]);
    assert_eq!(code, Some(1), "{talk}");
    assert!(talk.contains("nobody agreed to zeros") && talk.contains("--yes"), "{talk}");
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
