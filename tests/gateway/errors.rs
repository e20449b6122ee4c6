//! Bad requests: each is a problem document with its type, and reaches no drive.

use serde_json::{Value, json};

use crate::asking::{ARM, JSON, assert_problem, put_json, send};
use crate::common::{self, Stack};

/// Method, path, headers and body of a request; status and type of its answer.
type Case<'a> = (&'a str, &'a str, &'a [(&'a str, &'a str)], &'a str, u16, &'a str);

#[test]
fn every_error_is_a_problem_document_with_its_type() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let t1 = "/v1/thrusters/t1";
        let lease = format!("{t1}/lease");
        let big = format!("{{\"holder\": \"{}\"}}", "x".repeat(100_000));
        let cases: &[Case] = &[
            ("GET", "/nowhere", &[], "", 404, "unknown-route"),
            ("GET", "/v1", &[], "", 404, "unknown-route"),
            ("GET", "/docs/nothing.js", &[], "", 404, "unknown-route"),
            ("POST", "/v1/thrusters", &[], "", 405, "method-not-allowed"),
            ("DELETE", t1, &[], "", 405, "method-not-allowed"),
            ("PATCH", "/metrics", &[], "", 405, "method-not-allowed"),
            ("GET", "/v1/thrusters/t9", &[], "", 404, "unknown-thruster"),
            ("GET", "/v1/thrusters/%ff", &[], "", 400, "malformed-path"),
            ("POST", "/v1/thrusters/t9/lease", &[JSON], r#"{"holder": "a"}"#, 404, "unknown-thruster"),
            ("POST", &lease, &[JSON], r#"{"holder": "#, 400, "malformed-json"),
            ("POST", &lease, &[JSON], "", 400, "malformed-json"),
            ("POST", &lease, &[], r#"{"holder": "a"}"#, 415, "unsupported-media-type"),
            (
                "POST",
                &lease,
                &[("Content-Type", "text/plain")],
                r#"{"holder": "a"}"#,
                415,
                "unsupported-media-type",
            ),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl": 5}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"ttl_ms": 500}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"holder": 7}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": 0.5}"#, 422, "invalid-field"),
            ("POST", &lease, &[JSON], r#"{"holder": ""}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "supervisor"}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "  "}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "bench "}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "\u202egnp"}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": 60001}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": 0}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], r#"{"holder": "a", "ttl_ms": -5}"#, 422, "out-of-range"),
            ("POST", &lease, &[JSON], &big, 413, "body-too-large"),
            ("PUT", &lease, &[], "", 403, "lease-required"),
            ("DELETE", &lease, &[("Lease-Id", "made-up")], "", 409, "lease-lost"),
            ("DELETE", &lease, &[("Lease-Id", "")], "", 400, "malformed-header"),
            ("GET", "/v1/thrusters/t1/stream?hz=fast", &[], "", 400, "malformed-query"),
            ("GET", "/v1/thrusters/t1/stream?rate=5", &[], "", 400, "malformed-query"),
            ("GET", "/v1/thrusters/t1/stream?hz=100000", &[], "", 422, "out-of-range"),
            ("GET", "/v1/thrusters/t1/stream?hz=NaN", &[], "", 422, "out-of-range"),
            (
                "PUT",
                "/v1/thrusters/t1/controller",
                &[JSON],
                r#"{"controller": "magic"}"#,
                422,
                "unknown-controller",
            ),
            ("PUT", "/v1/thrusters/t1/controller", &[JSON], r#"{"law": "magic"}"#, 422, "invalid-field"),
            ("GET", "/v1/recordings/none", &[], "", 404, "unknown-recording"),
            ("GET", "/v1/recordings/..%2f..%2fkort.toml", &[], "", 404, "unknown-recording"),
            ("GET", "/v1/recordings/none?format=xml", &[], "", 400, "malformed-query"),
            ("DELETE", "/v1/recordings", &[], "", 409, "no-recording"),
            ("POST", "/v1/recordings", &[JSON], r#"{"name": "../x"}"#, 422, "out-of-range"),
            ("POST", "/v1/recordings", &[JSON], r#"{"rate_hz": 0}"#, 422, "out-of-range"),
            ("POST", "/v1/recordings", &[JSON], r#"{"thruster": "t9"}"#, 404, "unknown-thruster"),
            (
                "POST",
                "/v1/thrusters/t1/arm",
                &[("Origin", "http://elsewhere.example")],
                "",
                403,
                "foreign-origin",
            ),
            ("GET", "/v1/thrusters/t1/stream", &[("Origin", "null")], "", 403, "foreign-origin"),
            ("GET", "/v1/events?since=yesterday", &[], "", 422, "out-of-range"),
            ("GET", "/v1/events?limit=0", &[], "", 422, "out-of-range"),
            ("GET", "/v1/thrusters", &[("Authorization", "Basic eHg6eHg=")], "", 400, "malformed-header"),
            ("GET", "/v1/thrusters", &[("Authorization", "Bearer nobody.00")], "", 401, "token-required"),
            ("GET", "/v1/faults/9999", &[], "", 404, "unknown-fault"),
            ("GET", "/v1/faults/x", &[], "", 400, "malformed-path"),
        ];
        for (method, path, headers, body, status, slug) in cases {
            let answer = send(port, method, path, headers, body.as_bytes());
            assert_problem(&answer, *status, slug, &format!("{method} {path} {body:.60}"));
            if *status == 405 {
                assert!(answer.head.contains("\nallow: "), "405 names what is allowed: {}", answer.head);
            }
        }
        assert_eq!(stack.state().unwrap()["lease"], Value::Null);
    });
}

#[test]
fn a_setpoint_that_is_not_allowed_never_reaches_the_drive() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let path = "/v1/thrusters/t1/setpoint";
        let range = stack.state().unwrap()["range"]["thrust_n"].as_f64().unwrap();
        assert!(range > 100.0, "the stand gives more than 100 N: {range}");
        let lease = stack.expect("POST", "/lease", Some(json!({"holder": "bench", "ttl_ms": 60000})));
        let id = lease["lease_id"].as_str().unwrap().to_owned();

        let disarmed = put_json(port, "PUT", path, &id, r#"{"thrust_n": 25.0}"#);
        assert_problem(&disarmed, 409, "not-armed", "disarmed");
        assert_eq!(put_json(port, "POST", ARM, &id, "").status, 200);
        let beyond = format!(r#"{{"thrust_n": {}}}"#, range + 0.1);
        let cases = [
            (r#"{"thrust_n": NaN}"#, 400, "malformed-json"),
            (r#"{"thrust_n": Infinity}"#, 400, "malformed-json"),
            (r#"{"thrust_n": 1e999}"#, 400, "malformed-json"),
            (r#"{"thrust_n": "25"}"#, 422, "invalid-field"),
            (r#"{"thrust_n": null}"#, 422, "invalid-field"),
            (r#"{"thrust": 25}"#, 422, "invalid-field"),
            (r#"{"thrust_n": 25, "speed_rad_s": 5}"#, 422, "invalid-field"),
            (r#"{}"#, 422, "invalid-field"),
            (r#"[25]"#, 422, "invalid-field"),
            (r#"{"speed_rad_s": -1e9}"#, 422, "out-of-range"),
            (beyond.as_str(), 422, "out-of-range"),
        ];
        for (body, status, slug) in cases {
            let answer = put_json(port, "PUT", path, &id, body);
            assert_problem(&answer, status, slug, body);
        }
        let refused = put_json(port, "PUT", path, &id, &beyond).json();
        let detail = refused["detail"].as_str().unwrap();
        assert!(
            detail.contains(&format!("-{range:?} to {range:?} N")) && refused["hint"].is_string(),
            "{refused}"
        );
        let mut watch = stack.watch();
        for _ in 0..200 {
            assert_eq!(watch.next().signals.current_cmd_a, 0.0, "nothing that was refused moves the drive");
        }

        let accepted = put_json(port, "PUT", path, &id, r#"{"thrust_n": 60}"#);
        assert_eq!(accepted.status, 200, "{}", accepted.text());
        stack.watch().until("thrust", |t| (t.signals.thrust_n - 60.0).abs() < 12.0);
    });
}

/// A wish that a route does not know is no wish to change something all the same; a stop is a stop with whatever behind it.
#[test]
fn a_change_with_a_query_that_its_route_does_not_know_is_not_made() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let paths = stack.get("/openapi.json").expect("the document")["paths"].as_object().unwrap().clone();
        let mut asked = 0;
        for (path, operations) in &paths {
            let at = path.replace("{id}", "t1").replace(['{', '}'], "");
            for method in ["POST", "PUT", "DELETE"] {
                if operations.get(method.to_lowercase()).is_none() {
                    continue;
                }
                let query = format!("{at}?no_such_wish=true");
                if at.ends_with("/stop") || at.ends_with("/disarm") {
                    assert_eq!(send(stack.site.port, method, &query, &[], &[]).status, 200, "{query}");
                    continue;
                }
                let answer = send(stack.site.port, method, &query, &[], &[]);
                assert_problem(&answer, 400, "malformed-query", &format!("{method} {query}"));
                asked += 1;
            }
        }
        assert!(asked > 20, "{asked} changes");
    });
}
