//! What the state says in the first moments after a kill is as true as later.

use std::time::{Duration, Instant};

use serde_json::Value;

use crate::LEASE_MS;
use crate::common::{self, Stack, kill, wait};

/// Every fault that is ever shown has its time and what was before it, and a gateway that just began does not speak of a
/// drive that it has not heard. To an armed drive it is all one whether a process is killed or told to end: nobody asked the
/// drive to stop.
#[test]
fn no_state_is_shown_that_is_not_known_yet() {
    common::in_real_time(|| {
        for (role, how) in
            ["servo", "controller", "gateway"].iter().flat_map(|role| [(role, "KILL"), (role, "TERM")])
        {
            let mut stack = Stack::start();
            stack.thrust(80.0, LEASE_MS);
            kill(stack.process_of(role), how);
            let killed = Instant::now();
            let mut faults = 0;
            while killed.elapsed() < Duration::from_millis(2500) {
                let Some(state) = stack.state() else { continue };
                assert!(
                    !state["age_s"].is_null(),
                    "{role}, {how}: a servo that was never heard is not disarmed: {state}"
                );
                for fault in state["faults"].as_array().expect("faults") {
                    faults += 1;
                    let thrust = fault["before"]["thrust_n"].as_f64();
                    assert!(fault["since"].is_string(), "{role}, {how}: {fault}");
                    assert!(thrust.is_some_and(|n| n > 50.0), "{role}, {how}: it drove at 80 N: {fault}");
                }
            }
            assert!(faults > 0, "{role}, {how}: no fault was shown");
            let tripped = |event: &&Value| event["kind"] == "tripped";
            let events = stack.get("/v1/events").expect("events");
            for event in events.as_array().expect("a list").iter().filter(tripped) {
                let thrust = event["before"]["thrust_n"].as_f64();
                assert!(thrust.is_some_and(|n| n > 50.0), "{role}, {how}: it drove at 80 N: {event}");
            }
            // A gateway that is told to end waits for the ramp.
            if (*role, how) != ("gateway", "TERM") {
                let ended = |event: &&Value| event["kind"] == "process_ended";
                let ended =
                    events.as_array().expect("a list").iter().find(ended).expect("the end of the process");
                assert!(
                    ended["detail"].as_str().is_some_and(|words| words.contains("while armed")),
                    "{role}, {how}: {ended}"
                );
            }
        }
    });
}

/// What a ramp began with is told of a stop that ended one, not what was left of it when somebody looked again.
#[test]
fn a_gateway_that_was_away_tells_what_was_before_the_ramp() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let mut watch = stack.watch();
        let settled =
            watch.until("the whole thrust", |t| t.signals.thrust_cmd_n == 80.0).time_ns + 2_000_000_000;
        let drove = watch.until("two seconds of it", |t| t.time_ns > settled);
        let gateway = stack.process_of("gateway");
        kill(gateway, "STOP");
        watch.until("half the ramp", |t| t.armed == 0 || t.signals.thrust_cmd_n < 50.0);
        kill(gateway, "CONT");
        let before = wait("the fault", || {
            let state = stack.state()?;
            let fault = state["faults"].as_array()?.iter().find(|f| f["name"] == "gateway_lost")?.clone();
            fault["before"]["shaft_speed_rad_s"].as_f64()
        });
        let speed = drove.signals.shaft_speed_rad_s;
        assert!((before / speed - 1.0).abs() < 0.05, "{before} rad/s, it ran at {speed}");
    });
}
