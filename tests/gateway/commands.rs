//! Who commands, and which law runs.

use std::time::{Duration, Instant};

use serde_json::json;

use crate::asking::{ARM, JSON, assert_problem, put_json, send};
use crate::common::{self, Site, Stack, wait};

#[test]
fn one_commander_at_a_time_and_an_ended_lease_ends_the_thrust() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let lease = "/v1/thrusters/t1/lease";
        let take = |body: &str| send(port, "POST", lease, &[JSON], body.as_bytes());
        let first = take(r#"{"holder": "bench", "ttl_ms": 1500}"#);
        assert_eq!(first.status, 201, "{}", first.text());
        let grant = first.json();
        let id = grant["lease_id"].as_str().unwrap();
        assert!((1..=1500).contains(&grant["expires_in_ms"].as_u64().unwrap()), "{grant}");

        let second = take(r#"{"holder": "bridge", "ttl_ms": 1000}"#);
        assert_problem(&second, 409, "lease-held", "a second holder");
        assert_eq!(second.json()["holder"], "bench");
        let path = "/v1/thrusters/t1/setpoint";
        let foreign = put_json(port, "PUT", path, "0123456789abcdef0123456789abcdef", r#"{"thrust_n": 5}"#);
        assert_problem(&foreign, 409, "lease-held", "a command with a foreign lease");
        assert_eq!(foreign.json()["holder"], "bench");
        assert_problem(
            &send(port, "PUT", path, &[JSON], br#"{"thrust_n": 5}"#),
            409,
            "lease-held",
            "no lease at all while somebody holds one",
        );
        assert_problem(
            &put_json(port, "POST", "/v1/thrusters/t1/arm", "wrong", ""),
            409,
            "lease-held",
            "arming against the lease",
        );

        assert_eq!(put_json(port, "POST", ARM, id, "").status, 200);
        let start = Instant::now();
        while start.elapsed() < Duration::from_millis(2500) {
            let answer = put_json(port, "PUT", path, id, r#"{"thrust_n": 60}"#);
            assert_eq!(answer.status, 200, "every accepted command renews the lease: {}", answer.text());
            std::thread::sleep(Duration::from_millis(50));
        }
        let state = stack.state().unwrap();
        assert_eq!(
            (&state["setpoint"], &state["lease"]["holder"]),
            (&json!({"thrust_n": 60.0}), &json!("bench"))
        );

        // Nobody commands any more: the lease runs out, thrust ends, and the old id is worth nothing.
        let zero = stack.watch().until("zero", |t| t.signals.current_cmd_a == 0.0);
        assert_eq!(zero.faults, 0, "an ended lease is no fault");
        wait("the state to say so", || {
            let state = stack.state()?;
            (state["lease"].is_null() && state["setpoint"] == json!({"thrust_n": 0.0})).then_some(())
        });
        assert_problem(
            &put_json(port, "PUT", path, id, r#"{"thrust_n": 60}"#),
            409,
            "lease-lost",
            "an old lease",
        );
        let given = take(r#"{"holder": "bridge"}"#).json();
        assert!(given["expires_in_ms"].as_u64().unwrap() <= 500, "the default life is 500 ms: {given}");
        let id = given["lease_id"].as_str().unwrap();
        let _ = put_json(port, "PUT", lease, id, "");
        let gave = put_json(port, "DELETE", lease, id, "");
        assert!(
            gave.status == 204 || gave.json()["type"] == "urn:kort:problem:lease-lost",
            "{}",
            gave.text()
        );
    });
}

#[test]
fn a_control_law_is_switched_under_way_and_its_parameters_are_set() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(60.0, 60_000);
        let before = stack.expect("GET", "/controller", None);
        for law in before["available"].as_array().unwrap() {
            let (status, answer) =
                stack.http("PUT", "/controller", Some(json!({"controller": law}))).unwrap();
            if status == 409 {
                continue; // this rig lacks what the law needs, and the answer says so
            }
            assert_eq!((status, &answer["controller"]), (200, law), "{answer}");
            let state = stack.state().unwrap();
            assert_eq!(
                (&state["armed"], &state["faults"]),
                (&json!(true), &json!([])),
                "{law}: a switch is bumpless"
            );
        }
        let set = stack.expect("PUT", "/controller", Some(json!({"parameters": {"phase_margin_deg": 50.0}})));
        let margin =
            set["parameters"].as_array().unwrap().iter().find(|p| p["name"] == "phase_margin_deg").unwrap();
        assert_eq!(margin["value"], 50.0);
        let (status, answer) = stack
            .http("PUT", "/controller", Some(json!({"parameters": {"phase_margin_deg": 500.0}})))
            .unwrap();
        assert_eq!((status, &answer["type"]), (422, &json!("urn:kort:problem:out-of-range")), "{answer}");
        assert!(answer["detail"].as_str().unwrap().contains("30 to 85"), "{answer}");
    });
}

/// Arming asks controller and servo in turn, so the second request comes while the bus is at its tick.
#[test]
fn a_request_that_comes_while_the_bus_is_at_work_is_asked_all_the_same() {
    common::in_real_time(|| {
        let mut stack = Stack::start_at(Site::new().with_a_fast_controller());
        let grant = stack.expect("POST", "/lease", Some(json!({"holder": "test", "ttl_ms": 60_000})));
        stack.leases.insert("t1", grant["lease_id"].as_str().unwrap().to_owned());
        for _ in 0..1000 {
            stack.expect("POST", "/arm", None);
            stack.expect("POST", "/disarm", None);
        }
    });
}

/// However soon after the disarming: the controller's answer comes behind the command that asks for nothing.
#[test]
fn arming_right_after_disarming_is_not_refused() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        for _ in 0..5 {
            stack.thrust(40.0, 60_000);
            stack.expect("POST", "/disarm", None);
            stack.expect("POST", "/arm", None);
            assert_eq!(stack.state().map(|state| state["armed"] == true), Some(true));
        }
    });
}
