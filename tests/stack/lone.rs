//! Processes that are started one by one, as containers are: no supervisor tells a successor what stood latched.

use std::process::{Child, Stdio};

use kort_proto::faults::Fault;
use serde_json::Value;

use crate::LEASE_MS;
use crate::common::{self, Site, Stack, kill, wait};

fn start(site: &Site, role: &str) -> Child {
    let log =
        std::fs::OpenOptions::new().create(true).append(true).open(site.folder.path().join("log")).unwrap();
    let mut command = site.command(role);
    if role != "gateway" {
        command.args(["--thruster", "t1"]);
    }
    command.stdin(Stdio::null()).stdout(log.try_clone().unwrap()).stderr(log).spawn().unwrap()
}

/// How often a process was heard to latch a fault. What the gateway says on its own account, of a servo that is away, is none of it.
fn told(stack: &Stack, who: &str, fault: Fault) -> usize {
    let events = stack.get("/v1/events").unwrap();
    let of_it = |e: &&Value| e["kind"] == "tripped" && e["who"] == who && e["fault"] == fault.code();
    events.as_array().unwrap().iter().filter(of_it).count()
}

/// Replaces a process, and waits until the other one says what that one took along.
fn replace(stack: &Stack, process: &mut Child, role: &str, how: &str, who: &str, fault: Fault) {
    let before = told(stack, who, fault);
    kill(process.id(), how);
    process.wait().unwrap();
    *process = start(&stack.site, role);
    wait(fault.name(), || (told(stack, who, fault) > before).then_some(()));
    wait("the state to show it", || {
        let state = stack.state()?;
        state["faults"].as_array()?.iter().any(|shown| shown["name"] == fault.name()).then_some(())
    });
}

#[test]
fn what_is_latched_outlives_the_restart_of_any_one_of_them() {
    common::in_real_time(|| {
        let site = Site::new();
        let (mut servo, mut controller) = (start(&site, "servo"), start(&site, "controller"));
        let mut stack = Stack::of(start(&site, "gateway"), site);
        for how in ["KILL", "TERM"] {
            stack.wait_until_up();
            stack.thrust(80.0, LEASE_MS);
            // The servo owns the shared memory: its successor makes a new one, and knows nothing.
            replace(&stack, &mut servo, "servo", how, "controller", Fault::ServoLost);
            // The controller had it latched, and goes.
            replace(&stack, &mut controller, "controller", how, "servo", Fault::ControllerRestarted);
            let (status, _) = stack.http("POST", "/arm", None).unwrap();
            assert_eq!(status, 409, "{how}: latched");
            // And the servo that has that latched now.
            replace(&stack, &mut servo, "servo", how, "controller", Fault::ServoLost);
        }
        for mut process in [servo, controller] {
            kill(process.id(), "TERM");
            process.wait().unwrap();
        }
    });
}
