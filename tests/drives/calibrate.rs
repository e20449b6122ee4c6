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

#[test]
fn a_reversed_encoder_is_named_and_no_rig_is_written() {
    let site = Site::new();
    site.add("[thrusters.t1]", "simulation = { sensor_fault = \"reversed\" }");
    let output = calibrate(&site, &["--yes"]).output().unwrap();
    let talk = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{talk}");
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
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
    let mut child = calibrate(&site, &["--yes"]).spawn().unwrap();
    let mut talk = BufReader::new(child.stderr.take().unwrap()).lines().map_while(Result::ok);
    assert!(talk.any(|line| line.starts_with("first_movement: ")));
    let pid = i32::try_from(child.id()).ok().and_then(Pid::from_raw).unwrap();
    kill_process(pid, Signal::INT).unwrap();
    let rest: Vec<String> = talk.collect();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{rest:?}");
    assert!(rest.iter().any(|line| line.contains("drive off")), "the servo ends in order: {rest:?}");
    assert!(rest.iter().any(|line| line.contains("aborted")), "{rest:?}");
    // Without --yes and without a terminal nothing is driven.
    let output = calibrate(&site, &[]).output().unwrap();
    let talk = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{talk}");
    assert!(talk.contains("nobody agreed to zeros") && talk.contains("--yes"), "{talk}");
}
