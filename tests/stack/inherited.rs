//! What a service finds latched that an earlier one left: two checkouts of one user share their shared memory, and
//! with it what stands latched, but not the event log.

use std::time::{Duration, Instant, SystemTime};

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

/// A servo that hangs or dies while the service ends has not switched its drive off: nobody says it has, and the next
/// service finds the stop latched.
#[test]
fn a_servo_that_does_not_end_in_order_is_no_ordered_stop() {
    common::in_real_time(|| {
        for signal in ["STOP", "KILL"] {
            let mut stack = Stack::start();
            stack.thrust(80.0, LEASE_MS);
            let servo = stack.process_of("servo");
            if signal == "STOP" {
                kill(servo, signal);
            }
            kill(stack.supervisor.id(), "INT");
            if signal == "KILL" {
                std::thread::sleep(Duration::from_millis(50));
                kill(servo, signal);
            }
            let status = stack.supervisor.wait().unwrap();
            let log = stack.site.log();
            assert_eq!(status.code(), Some(1), "{log}");
            assert!(log.contains("without switching the drive off"), "{log}");
            stack.supervisor = stack.site.spawn("up");
            stack.wait_until_up();
            let fault = wait("the fault", || found(&stack.state()?));
            assert!(fault["before"]["thrust_n"].as_f64().is_some_and(|n| n > 20.0), "{fault}");
            let events = stack.get("/v1/events").unwrap().to_string();
            assert!(events.contains("the servo ended while armed"), "{events}");
        }
    });
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

fn named(state: &Value, name: &str) -> Option<Value> {
    state["faults"].as_array()?.iter().find(|fault| fault["name"] == name).cloned()
}

#[test]
fn a_fault_is_never_shown_with_the_time_of_an_earlier_one() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        for _ in 0..4 {
            stack.thrust(80.0, LEASE_MS);
            let servo = stack.process_of("servo");
            let killed = SystemTime::now();
            kill(servo, "STOP");
            // Every state from the first on that shows the fault, without a pause, until it says when it came.
            let patience = Instant::now() + Duration::from_secs(10);
            let since = loop {
                assert!(Instant::now() < patience, "no time is told: {:?}", stack.state());
                let fault = stack.state().and_then(|state| named(&state, "servo_lost"));
                if let Some(since) = fault.as_ref().and_then(|fault| fault["since"].as_str()) {
                    break humantime::parse_rfc3339(since).unwrap();
                }
            };
            // Its last word may be a period old.
            assert!(since + Duration::from_millis(20) >= killed, "came {since:?}, killed {killed:?}");
            wait("a successor", || named(&stack.state()?, "servo_restarted"));
        }
    });
}

#[test]
fn a_fault_that_came_while_no_gateway_looked_is_told_as_old_as_it_is() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let gateway = stack.process_of("gateway");
        let mut watch = stack.watch();
        kill(gateway, "STOP");
        watch.until("zero", |telemetry| telemetry.armed == 0);
        let latched = SystemTime::now();
        let fault = wait("the fault by the successor", || {
            stack.process("gateway").filter(|pid| *pid != gateway)?;
            named(&stack.state()?, "gateway_lost").filter(|fault| !fault["since"].is_null())
        });
        let since = humantime::parse_rfc3339(fault["since"].as_str().unwrap()).unwrap();
        // The gateway's successor comes more than a second later.
        assert!(since < latched + Duration::from_millis(500), "{fault}, latched {latched:?}");
        assert!(fault["before"]["shaft_speed_rad_s"].is_number(), "{fault}");
    });
}
