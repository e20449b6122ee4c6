//! A second process in a part that is played already: refused by the name of who plays it, while that one goes on.

use std::process::Command;

use crate::LEASE_MS;
use crate::common::{self, Site, Stack, kill, run, wait};

/// The part of a running service, by a deployment with a port of its own.
fn rival(stack: &Stack, other: &Site, part: &[&str]) -> (Option<i32>, String) {
    // One that is let in would never end.
    let mut command = Command::new("timeout");
    command
        .args(["20", common::KORT])
        .args(part)
        .arg("--config")
        .arg(other.config())
        .arg("--root")
        .arg(stack.site.root());
    let out = run(command.current_dir(other.folder.path()));
    (out.status.code(), String::from_utf8_lossy(&out.stderr).into_owned())
}

#[test]
fn a_second_one_of_any_part_is_refused_by_the_name_of_the_first() {
    common::in_real_time(|| {
        let (mut stack, other) = (Stack::start(), Site::new());
        stack.thrust(80.0, LEASE_MS);
        let session = stack.watch().next().header.session;
        for (part, whose) in [
            (&["gateway"][..], "the gateway already runs here"),
            (&["controller"], "the controller of t1 already runs here"),
            (&["servo", "--join"], "the servo of t1 already runs here"),
        ] {
            let (code, words) = rival(&stack, &other, part);
            let holder = format!("{whose} (process {})", stack.process_of(part[0]));
            assert_eq!(code, Some(1), "{part:?}: {words}");
            assert!(words.contains(&holder) && words.contains("hint:"), "{part:?}: {holder} in {words}");
        }
        let t = stack.watch().next();
        assert!(t.armed == 1 && t.faults == 0 && t.header.session == session, "{t:?}");
        // It obeys the first one still, and one that dies leaves its part to its successor.
        stack.expect("PUT", "/setpoint", Some(serde_json::json!({"thrust_n": 40.0})));
        stack.watch().until("the new setpoint", |t| (t.signals.thrust_n - 40.0).abs() < 8.0);
        for role in ["gateway", "controller", "servo"] {
            let first = stack.process_of(role);
            kill(first, "KILL");
            wait("a successor", || stack.process(role).filter(|pid| *pid != first));
        }
        stack.wait_until_up();
    });
}

/// One that nobody supervises keeps the service from starting, and is named: its children would be refused one after another.
#[test]
fn a_service_does_not_start_beside_a_lone_process() {
    let site = Site::new();
    let mut gateway = site.spawn("gateway");
    wait("its part", || std::fs::read_to_string(site.root().with_extension("gateway.lock")).ok());
    let out = run(&mut site.command("up"));
    let words = String::from_utf8_lossy(&out.stderr);
    let holder = format!("the gateway already runs here (process {})", gateway.id());
    assert_eq!(out.status.code(), Some(1), "{words}");
    assert!(words.contains(&holder), "{words}");
    kill(gateway.id(), "TERM");
    gateway.wait().unwrap();
}
