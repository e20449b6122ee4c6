//! The whole service as real processes: it starts and thrusts, and whatever is killed, frozen or
//! lost ends at zero thrust, is replaced, and never resumes what it was told before.

mod checked;
#[path = "../common/mod.rs"]
mod common;
mod inherited;
mod lone;
mod refusals;
mod rivals;
mod shown;
mod stated;
mod strangers;
mod system;

use std::time::{Duration, Instant, SystemTime};

use common::{PERIOD_NS, Site, Stack, alive, at_zero, children, kill, wait};
use kort_proto::faults::Fault;
use kort_proto::messages::Telemetry;

const LEASE_MS: u64 = 60_000;

/// Thrust is at zero within a number of controller periods after an instant, by the servo's own
/// clock; two more are allowed for a busy machine.
fn within(periods: u64, since_ns: u64, zero: &Telemetry) {
    let took = zero.time_ns.saturating_sub(since_ns);
    assert!(took <= (periods + 2) * PERIOD_NS, "zero after {} ms", took / 1_000_000);
}

/// Loss of the gateway ramps to zero: within half a second of its last word, which came at most a period before.
fn ramped(since_ns: u64, zero: &Telemetry) {
    let took_ms = zero.time_ns.saturating_sub(since_ns) / 1_000_000;
    assert!((300..=500 + 3 * PERIOD_NS / 1_000_000).contains(&took_ms), "zero after {took_ms} ms");
}

fn now_ns() -> u64 {
    kort_proto::transport::monotonic_ns()
}

#[test]
fn starts_thrusts_and_goes_to_zero_before_it_ends() {
    // A terminal sends another signal for Ctrl-\\ than for its end; the service ends alike, and leaves no shared memory.
    for signal in ["TERM", "QUIT"] {
        ends_at_zero(signal);
    }
}

fn ends_at_zero(signal: &str) {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let state = stack.state().unwrap();
        assert_eq!((&state["armed"], &state["faults"]), (&false.into(), &serde_json::json!([])));
        stack.thrust(80.0, LEASE_MS);
        let servo = stack.process_of("servo");
        let mut watch = stack.watch();
        kill(stack.supervisor.id(), signal);
        let zero = watch.until("zero", at_zero);
        assert_eq!(zero.faults, 0, "an ordered stop is no fault");
        assert!(zero.signals.thrust_n.abs() < 10.0, "the drive went off at {} N", zero.signals.thrust_n);
        assert!(alive(servo), "the servo still ran when thrust was at zero");
        let status = stack.supervisor.wait().unwrap();
        assert_eq!(status.code(), Some(0), "{}", stack.site.log());
        assert!(!alive(servo));
        let log = stack.site.log();
        assert!(log.contains("thrust at zero ("), "{log}");
        assert!(log.contains(&format!("http://127.0.0.1:{}/", stack.site.port)), "{log}");
    });
}

#[test]
fn a_killed_controller_ends_at_zero_and_its_successor_starts_there() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let mut watch = stack.watch();
        let first = stack.process_of("controller");
        kill(first, "KILL");
        let zero = watch.until("zero", at_zero);
        within(5, zero.command_stamp_ns, &zero);
        assert_ne!(zero.faults & (Fault::CommandTimeout.bit() | Fault::ControllerRestarted.bit()), 0);
        wait("a successor", || stack.process("controller").filter(|pid| *pid != first));
        watch.stays_at_zero(Duration::from_millis(700));
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn a_killed_gateway_ends_at_zero_and_its_successor_starts_there() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let mut watch = stack.watch();
        let first = stack.process_of("gateway");
        let killed_ns = now_ns();
        kill(first, "KILL");
        let zero = watch.until("zero", at_zero);
        ramped(killed_ns, &zero);
        wait("a successor", || stack.process("gateway").filter(|pid| *pid != first));
        stack.wait_until_up();
        wait("the fault to be shown", || {
            let faults = stack.state()?["faults"].to_string();
            (faults.contains("gateway_lost") || faults.contains("gateway_restarted")).then_some(())
        });
        watch.stays_at_zero(Duration::from_millis(700));
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn a_killed_servo_is_replaced_by_one_at_zero() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let first = stack.process_of("servo");
        let mut watch = stack.watch();
        let session = watch.next().header.session;
        kill(first, "KILL");
        let fresh = watch.until("a successor", |t| t.header.session != session);
        assert!(at_zero(&fresh), "{fresh:?}");
        assert_ne!(fresh.faults & Fault::ServoRestarted.bit(), 0, "{fresh:?}");
        watch.stays_at_zero(Duration::from_millis(700));
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn a_stop_that_nobody_asked_for_is_latched_through_every_restart_and_tells_what_was_before() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        kill(stack.process_of("servo"), "KILL");
        let told = |state: &serde_json::Value| {
            let fault = state["faults"].as_array()?.iter().find(|f| f["name"] == "servo_restarted")?.clone();
            (!fault["since"].is_null()).then_some(fault)
        };
        let fault = wait("the fault", || told(&stack.state()?));
        let before = fault["before"]["thrust_n"].as_f64().expect("thrust before");
        assert!((before - 80.0).abs() < 25.0, "{fault}");
        for role in ["controller", "servo", "gateway"] {
            let first = stack.process_of(role);
            kill(first, "KILL");
            wait("a successor", || stack.process(role).filter(|pid| *pid != first));
            stack.wait_until_up();
            assert_eq!(
                told(&stack.state().unwrap()).map(|f| f["since"].clone()),
                Some(fault["since"].clone()),
                "{role}"
            );
        }
        let events = stack.get("/v1/events").unwrap();
        for kind in ["lease_taken", "armed", "commanded", "process_ended", "process_started", "tripped"] {
            let there = events.as_array().unwrap().iter().any(|event| event["kind"] == kind);
            assert!(there, "{kind} is not in {events}");
        }
        let (status, _) = stack.http("POST", "/arm", None).unwrap();
        assert_eq!(status, 409, "latched");
        stack.thrust(60.0, LEASE_MS);
        assert_eq!(stack.state().unwrap()["faults"], serde_json::json!([]));
    });
}

#[test]
fn a_service_that_died_while_armed_says_so_when_it_comes_back() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        // What is told is how it was then, not how it was a second before.
        std::thread::sleep(Duration::from_millis(1200));
        stack.expect("PUT", "/setpoint", Some(serde_json::json!({ "thrust_n": 30.0 })));
        stack.watch().until("the lower thrust", |t| t.signals.thrust_n < 40.0);
        std::thread::sleep(Duration::from_millis(200));
        let killed = SystemTime::now();
        kill(stack.supervisor.id(), "KILL");
        stack.supervisor.wait().unwrap();
        std::thread::sleep(Duration::from_secs(1));
        stack.supervisor = stack.site.spawn("up");
        let fault = wait("the fault", || {
            // When it was, the gateway reads after the fault itself.
            let faults = stack.state()?["faults"].as_array()?.clone();
            faults.into_iter().find(|f| f["name"] == "servo_restarted" && !f["since"].is_null())
        });
        let since = humantime::parse_rfc3339(fault["since"].as_str().unwrap()).unwrap();
        let apart = since.duration_since(killed).unwrap_or_else(|earlier| earlier.duration());
        assert!(apart < Duration::from_millis(500), "{fault}, killed {killed:?}");
        assert!(fault["before"]["thrust_n"].as_f64().is_some_and(|n| n < 50.0), "{fault}");
        let events = stack.get("/v1/events").unwrap();
        let died = |event: &&serde_json::Value| {
            event["detail"].as_str().is_some_and(|d| d.contains("the service ended"))
        };
        let died = events.as_array().unwrap().iter().find(died).expect("the end of the service");
        assert_eq!(died["since"], fault["since"], "{died}");
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn a_dead_servo_is_not_shown_as_armed() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        kill(stack.process_of("servo"), "STOP");
        std::thread::sleep(Duration::from_nanos(3 * PERIOD_NS));
        let state = stack.state().unwrap();
        assert_eq!(state["armed"], false, "{state}");
        assert!(state["faults"].to_string().contains("servo_lost"), "{state}");
    });
}

#[test]
fn of_two_thrusters_the_one_goes_on_when_the_others_servo_dies() {
    common::in_real_time(|| {
        let mut stack = Stack::start_at(Site::new().with_t2());
        stack.at("t2").wait_until_up();
        // A machine that stands still may stop t1 by itself; were it the death of t2, it did so every time.
        let went_on = (0..5).any(|_| {
            stack.at("t1").thrust(80.0, LEASE_MS);
            stack.at("t2").thrust(15.0, LEASE_MS);
            let mut other = stack.watch();
            let session = other.next().header.session;
            let mut going_on = stack.at("t1").watch();
            let armed_at = going_on.next().armed_at_ns;

            kill(stack.at("t2").process_of("servo"), "KILL");
            let fresh = other.until("a successor", |t| t.header.session != session);
            assert!(at_zero(&fresh), "{fresh:?}");
            other.stays_at_zero(Duration::from_millis(700));
            let now = now_ns();
            let t1 = going_on.until("t1 after all that", |t| t.time_ns > now);
            let thrusts = (t1.signals.thrust_n - 80.0).abs() < 16.0;
            (t1.armed, t1.faults, t1.armed_at_ns) == (1, 0, armed_at) && thrusts
        });
        assert!(went_on, "t1 stopped with t2");
        stack.at("t2").thrust(10.0, LEASE_MS);
    });
}

#[test]
fn a_setpoint_right_after_the_arming_is_kept() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(40.0, LEASE_MS);
        for newton in 41..=50 {
            stack.expect("POST", "/disarm", None);
            stack.expect("POST", "/arm", None);
            let thrust_n = f64::from(newton);
            stack.expect("PUT", "/setpoint", Some(serde_json::json!({"thrust_n": thrust_n})));
            let mut watch = stack.watch();
            watch.until("the drive to follow", |t| t.armed != 0 && t.signals.thrust_cmd_n == thrust_n);
            assert_eq!(stack.state().unwrap()["setpoint"]["thrust_n"], thrust_n);
        }
    });
}

#[test]
fn a_frozen_controller_ends_at_zero_and_resumes_nothing_when_it_thaws() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let mut watch = stack.watch();
        let controller = stack.process_of("controller");
        kill(controller, "STOP");
        let zero = watch.until("zero", at_zero);
        within(5, zero.command_stamp_ns, &zero);
        assert_eq!(zero.faults, Fault::CommandTimeout.bit());
        kill(controller, "CONT");
        watch.stays_at_zero(Duration::from_millis(700));
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn a_process_that_hangs_is_ended_and_replaced() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        std::thread::sleep(Duration::from_secs(6)); // a start is given that long to be heard
        stack.thrust(40.0, LEASE_MS);
        for role in ["servo", "controller", "gateway"] {
            let frozen = stack.process_of(role);
            kill(frozen, "STOP");
            let stopped = Instant::now();
            wait("a successor", || stack.process(role).filter(|pid| *pid != frozen));
            assert!(stopped.elapsed() < Duration::from_secs(5), "{role}: {:?}", stopped.elapsed());
            std::thread::sleep(Duration::from_secs(6));
        }
        stack.wait_until_up();
        let events = stack.get("/v1/events").unwrap().to_string();
        assert_eq!(events.matches("process_hung").count(), 3, "{events}");
        let metrics = stack.text("/metrics").unwrap();
        for (thruster, role) in [("t1", "servo"), ("t1", "controller"), ("", "gateway")] {
            let line = format!("kort_process_restarts_total{{thruster=\"{thruster}\",process=\"{role}\"}} 1");
            assert!(metrics.contains(&line), "{line} is not in {metrics}");
        }
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn the_end_of_the_terminal_leaves_nothing_in_shared_memory() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let prefix = strangers::in_shared_memory(&stack.site);
        let ours = || {
            let names = std::fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.file_name());
            names.filter(|name| name.to_string_lossy().starts_with(&prefix)).count()
        };
        let before = ours();
        kill(stack.supervisor.id(), "HUP");
        wait("the end", || (!alive(stack.supervisor.id())).then_some(()));
        assert!(before > 20 && ours() == 0, "{before} files before, {} after", ours());
        assert!(stack.site.log().contains("stopped"), "{}", stack.site.log());
    });
}

#[test]
fn a_frozen_gateway_ends_at_zero_and_resumes_nothing_when_it_thaws() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let mut watch = stack.watch();
        let gateway = stack.process_of("gateway");
        let frozen_ns = now_ns();
        kill(gateway, "STOP");
        let zero = watch.until("zero", at_zero);
        ramped(frozen_ns, &zero);
        kill(gateway, "CONT");
        watch.stays_at_zero(Duration::from_millis(700));
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn the_end_of_a_lease_ramps_to_zero_within_half_a_second() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let taken = Instant::now();
        stack.thrust(80.0, 3000);
        let mut watch = stack.watch();
        // The lease was renewed by the setpoint at the latest; from then on nobody renews it.
        watch.until("the whole setpoint", |t| t.signals.thrust_cmd_n == 80.0);
        let falling = watch.until("the ramp", |t| t.armed != 0 && t.signals.thrust_cmd_n < 70.0);
        let zero = watch.until("zero", at_zero);
        let took_ms = (zero.time_ns - falling.time_ns) / 1_000_000;
        assert!(took_ms <= 500 + 2 * PERIOD_NS / 1_000_000, "{took_ms} ms");
        assert!(took_ms >= 150, "a ramp, no step: {took_ms} ms");
        assert!(taken.elapsed() >= Duration::from_millis(2900), "the lease ended early");
        wait("the end of the arming to be told", || {
            let events = stack.get("/v1/events")?;
            let last = events.as_array()?.iter().rev().find(|event| event["kind"] == "disarmed")?;
            last["detail"].as_str()?.contains("nobody commands").then_some(())
        });
        watch.stays_at_zero(Duration::from_millis(500));
        stack.thrust(60.0, LEASE_MS);
    });
}

#[test]
fn kills_at_any_instant_start_up_included_need_no_person() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        // Delays sweep what a start goes through: exec, configuration, ports, first ticks.
        let roles = ["servo", "controller", "gateway"];
        for i in 0u64..30 {
            let role = roles[(i % 3) as usize];
            std::thread::sleep(Duration::from_micros((i * 7919) % 60_000));
            if let Some(pid) = stack.process(role) {
                let _ = std::process::Command::new("kill").args(["-KILL", &pid.to_string()]).status();
            }
        }
        stack.wait_until_up();
        stack.thrust(60.0, LEASE_MS);
        assert!(alive(stack.supervisor.id()));
    });
}

#[test]
fn a_killed_supervisor_takes_its_children_along_and_the_next_one_starts() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(80.0, LEASE_MS);
        let orphans = children(stack.supervisor.id());
        assert_eq!(orphans.len(), 3);
        kill(stack.supervisor.id(), "KILL");
        stack.supervisor.wait().unwrap();
        wait("the children to end", || orphans.iter().all(|(pid, _)| !alive(*pid)).then_some(()));
        stack.supervisor = stack.site.spawn("up");
        stack.wait_until_up();
        stack.watch().stays_at_zero(Duration::from_millis(300));
        stack.thrust(60.0, LEASE_MS);
    });
}
