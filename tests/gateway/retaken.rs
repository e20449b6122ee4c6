//! A lease that is taken again while the ramp of the one before still runs, and what a controller's successor runs.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::asking::{ARM, assert_problem, send};
use crate::common::{self, Stack, kill, wait};

/// Kinds and words of the events since this one.
fn told(stack: &Stack, since: u64) -> Vec<(String, String)> {
    let events = stack.get(&format!("/v1/events?since={since}")).unwrap();
    let word = |event: &Value, key: &str| event[key].as_str().unwrap_or_default().to_owned();
    events.as_array().unwrap().iter().map(|event| (word(event, "kind"), word(event, "detail"))).collect()
}

fn newest(stack: &Stack) -> u64 {
    let events = stack.get("/v1/events?limit=1").unwrap();
    events[0]["id"].as_u64().unwrap()
}

fn take_again(stack: &mut Stack) {
    let grant = stack.expect("POST", "/lease", Some(json!({"holder": "next", "ttl_ms": 60_000})));
    stack.leases.insert("t1", grant["lease_id"].as_str().unwrap().to_owned());
}

/// At whatever instant of the ramp, and just after it: what is accepted is done, and nothing is disarmed that is not told so.
#[test]
fn what_the_next_lease_commands_within_the_ramp_is_not_lost() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        for after_ms in [0, 20, 150, 300, 390, 397, 405, 450] {
            stack.thrust(80.0, 60_000);
            let since = newest(&stack);
            stack.expect("DELETE", "/lease", None);
            stack.leases.clear();
            std::thread::sleep(Duration::from_millis(after_ms));
            take_again(&mut stack);
            stack.expect("POST", "/arm", None);
            stack.expect("PUT", "/setpoint", Some(json!({"thrust_n": 20.0})));
            let until = Instant::now() + Duration::from_millis(800);
            while Instant::now() < until {
                let state = stack.state().unwrap();
                let there = (&state["armed"], &state["setpoint"]["thrust_n"]);
                assert_eq!(there, (&json!(true), &json!(20.0)), "{after_ms} ms: {:?}", told(&stack, since));
                std::thread::sleep(Duration::from_millis(10));
            }
            let told = told(&stack, since);
            assert!(!told.iter().any(|(_, words)| words.contains("by none of")), "{after_ms} ms: {told:?}");
        }
    });
}

/// Armed at zero there is no ramp to be found: the controller disarms in the tick in which it hears that nobody commands.
#[test]
fn at_zero_the_end_of_a_lease_is_told_as_such_however_soon_the_next_is_taken() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        for (round, after_ms) in [0, 2, 4, 6, 8, 10, 20].into_iter().enumerate() {
            take_again(&mut stack);
            stack.expect("POST", "/clear-faults", None);
            stack.expect("POST", "/arm", None);
            if round % 2 == 1 {
                stack.expect("PUT", "/setpoint", Some(json!({"thrust_n": 0.0})));
            }
            let since = newest(&stack);
            stack.expect("DELETE", "/lease", None);
            stack.leases.clear();
            std::thread::sleep(Duration::from_millis(after_ms));
            take_again(&mut stack);
            std::thread::sleep(Duration::from_millis(200));
            let told = told(&stack, since);
            assert!(!told.iter().any(|(_, words)| words.contains("by none of")), "{after_ms} ms: {told:?}");
            stack.expect("DELETE", "/lease", None);
            stack.leases.clear();
            wait("it to be disarmed", || (stack.state()?["armed"] == false).then_some(()));
        }
    });
}

/// However short its life: who takes a lease during the ramp of the one before is given it.
#[test]
fn a_lease_of_a_millisecond_is_granted_during_a_ramp_too() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, 60_000);
        stack.expect("DELETE", "/lease", None);
        stack.leases.clear();
        let grant = stack.expect("POST", "/lease", Some(json!({"holder": "next", "ttl_ms": 1})));
        assert_eq!(grant["lease_id"].as_str().map(str::len), Some(32), "{grant}");
    });
}

/// A lease alone moves nothing: the ramp ends at zero, and the old setpoint does not come back.
#[test]
fn the_next_lease_finds_the_drive_armed_at_zero_where_it_asks_for_nothing() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, 60_000);
        stack.expect("DELETE", "/lease", None);
        stack.leases.clear();
        std::thread::sleep(Duration::from_millis(100));
        take_again(&mut stack);
        stack.expect("POST", "/arm", None);
        stack.watch().until("zero", |t| t.signals.current_cmd_a == 0.0);
        std::thread::sleep(Duration::from_millis(500));
        let state = stack.state().unwrap();
        assert_eq!((&state["armed"], &state["setpoint"]["thrust_n"]), (&json!(true), &json!(0.0)));
    });
}

#[test]
fn nobody_arms_without_a_lease() {
    let stack = Stack::start();
    let answer = send(stack.site.port, "POST", ARM, &[], b"");
    assert_problem(&answer, 403, "lease-required", "arming under nobody's lease");
    assert_eq!(stack.state().unwrap()["armed"], false);
}

#[test]
fn a_controller_that_begins_anew_runs_what_was_set() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let set =
            json!({"controller": "torque_control", "observer": "luenberger", "parameters": {"fade_s": 0.3}});
        stack.expect("PUT", "/controller", Some(set));
        // Once it was looked at.
        std::thread::sleep(Duration::from_millis(600));
        kill(stack.process_of("controller"), "KILL");
        let again = "set controller = torque_control, observer = luenberger, fade_s = 0.3 again";
        wait("the event", || told(&stack, 0).iter().any(|(_, words)| words.contains(again)).then_some(()));
        let runs = stack.expect("GET", "/controller", None);
        assert_eq!(
            (&runs["controller"], &runs["observer"]),
            (&json!("torque_control"), &json!("luenberger"))
        );
    });
}

/// Whatever changes nothing is a command all the same.
#[test]
fn an_accepted_command_without_effect_renews_the_lease() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let grant = stack.expect("POST", "/lease", Some(json!({"holder": "test", "ttl_ms": 3000})));
        stack.leases.insert("t1", grant["lease_id"].as_str().unwrap().to_owned());
        let begun = Instant::now();
        let rig = stack.expect("GET", "/rig", None)["toml"].clone();
        while begun.elapsed() < Duration::from_secs(7) {
            std::thread::sleep(Duration::from_millis(1500));
            match begun.elapsed().as_millis() / 1500 % 3 {
                0 => stack.expect("POST", "/clear-faults", None),
                1 => stack.expect("PUT", "/controller", Some(json!({}))),
                _ => stack.expect("POST", "/rig", Some(json!({"toml": rig}))),
            };
            assert_eq!(stack.state().unwrap()["lease"]["holder"], "test");
        }
    });
}
