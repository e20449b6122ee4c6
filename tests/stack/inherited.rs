//! What a service finds latched that an earlier one left: two checkouts of one user share their shared memory, and
//! with it what stands latched, but not the event log.

use std::time::Duration;

use serde_json::Value;

use crate::LEASE_MS;
use crate::common::{self, Stack, kill, wait};

fn found(state: &Value) -> Option<Value> {
    let faults = state["faults"].as_array()?;
    faults.iter().find(|f| f["name"] == "servo_restarted" && !f["since"].is_null()).cloned()
}

/// Ends the service and starts it again.
fn again(stack: &mut Stack) {
    kill(stack.supervisor.id(), "INT");
    stack.supervisor.wait().unwrap();
    stack.supervisor = stack.site.spawn("up");
    stack.wait_until_up();
}

fn told(stack: &Stack, kind: &str) -> Vec<Value> {
    let events = stack.get("/v1/events").unwrap();
    let of_fault = |e: &&Value| e["kind"] == kind && e["fault"] == 14;
    events.as_array().unwrap().iter().filter(of_fault).cloned().collect()
}

#[test]
fn a_fault_that_an_earlier_service_left_is_told_as_old_as_it_is() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        kill(stack.process_of("servo"), "KILL");
        let first = wait("the fault", || found(&stack.state()?));
        assert!(first["before"]["thrust_n"].as_f64().is_some_and(|n| n > 50.0), "{first}");
        std::thread::sleep(Duration::from_millis(1500));

        // Its log at hand, the second service says nothing new, and the same of it.
        again(&mut stack);
        assert_eq!(wait("the fault", || found(&stack.state()?))["since"], first["since"]);
        assert_eq!((told(&stack, "tripped").len(), told(&stack, "fault_inherited").len()), (1, 0));
        assert!(stack.site.log().contains("is latched since"), "{}", stack.site.log());

        // In another folder it is not taken for a stop of now.
        std::fs::remove_dir_all(stack.site.folder.path().join("events")).unwrap();
        again(&mut stack);
        let fault = wait("the fault", || found(&stack.state()?));
        let when = |fault: &Value| humantime::parse_rfc3339(fault["since"].as_str().unwrap()).unwrap();
        let apart = when(&fault).duration_since(when(&first)).unwrap_or_else(|e| e.duration());
        assert!(apart < Duration::from_secs(1), "{fault} beside {first}");
        assert!(fault["before"]["thrust_n"].as_f64().is_some_and(|n| n > 50.0), "{fault}");
        assert_eq!((told(&stack, "tripped").len(), told(&stack, "fault_inherited").len()), (0, 1));
        again(&mut stack);
        assert_eq!(told(&stack, "fault_inherited").len(), 1, "told once");
        stack.thrust(60.0, LEASE_MS);
        again(&mut stack);
        assert_eq!(stack.state().unwrap()["faults"], serde_json::json!([]), "cleared is cleared");
    });
}
