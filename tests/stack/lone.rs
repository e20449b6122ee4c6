//! Processes that are started one by one, as containers are: no supervisor tells a successor what stood latched.

use std::process::{Child, Stdio};

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

fn end(mut process: Child, how: &str) {
    kill(process.id(), how);
    process.wait().unwrap();
}

fn faults(stack: &Stack) -> Vec<String> {
    let state = stack.state().unwrap_or_default();
    let names = state["faults"].as_array().into_iter().flatten();
    names.filter_map(|fault| fault["name"].as_str().map(str::to_owned)).collect()
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
            end(servo, how);
            servo = start(&stack.site, "servo");
            wait("the servo that was lost", || faults(&stack).contains(&"servo_lost".into()).then_some(()));
            stack.wait_until_up();
            assert!(faults(&stack).contains(&"servo_lost".into()), "{how}: {:?}", faults(&stack));
            // The controller had it latched, and goes.
            end(controller, how);
            controller = start(&stack.site, "controller");
            wait("a controller that was replaced", || {
                faults(&stack).contains(&"controller_restarted".into()).then_some(())
            });
            let (status, _) = stack.http("POST", "/arm", None).unwrap();
            assert_eq!(status, 409, "{how}: latched");
            // And the servo that has that latched now.
            end(servo, how);
            servo = start(&stack.site, "servo");
            wait("the servo that had it", || faults(&stack).contains(&"servo_lost".into()).then_some(()));
        }
        end(servo, "TERM");
        end(controller, "TERM");
    });
}
