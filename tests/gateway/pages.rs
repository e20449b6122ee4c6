//! Every route, and what a gateway alone can show.

use serde_json::{Value, json};

use crate::asking::{ARM, JSON, assert_problem, put_json, send};
use crate::common::{self, Site, Stack, kill, wait};

#[test]
fn a_gateway_alone_says_what_is_away_and_still_shows_its_console() {
    let site = Site::new();
    let mut gateway = site.spawn("gateway");
    let ready = send(site.port, "GET", "/readyz", &[], b"");
    assert_problem(&ready, 503, "not-ready", "without servo and controller");
    assert_eq!(send(site.port, "GET", "/healthz", &[], b"").status, 200);
    let state = send(site.port, "GET", "/v1/thrusters", &[], b"").json();
    assert_eq!((&state[0]["armed"], &state[0]["measured"]["thrust_n"]), (&json!(false), &Value::Null));
    let lease = json!({"holder": "bench"}).to_string();
    let lease = send(site.port, "POST", "/v1/thrusters/t1/lease", &[JSON], lease.as_bytes()).json();
    assert_problem(
        &put_json(site.port, "POST", ARM, lease["lease_id"].as_str().unwrap(), ""),
        503,
        "not-ready",
        "arming nothing",
    );
    assert!(send(site.port, "GET", "/", &[], b"").text().contains("<title>kort console</title>"));
    kill(gateway.id(), "TERM");
    let status = wait("the gateway to end", || gateway.try_wait().unwrap());
    assert_eq!(status.code(), Some(0), "{}", site.log());
}

#[test]
fn the_openapi_document_names_every_route_and_each_answers() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let document = send(port, "GET", "/openapi.json", &[], b"").json();
        for route in [
            "/",
            "/metrics",
            "/healthz",
            "/readyz",
            "/openapi.json",
            "/v1/thrusters",
            "/v1/thrusters/{id}",
            "/v1/recordings",
            "/v1/thrusters/{id}/lease",
            "/v1/thrusters/{id}/arm",
            "/v1/thrusters/{id}/disarm",
            "/v1/recordings/{name}",
            "/v1/thrusters/{id}/clear-faults",
            "/v1/thrusters/{id}/setpoint",
            "/v1/thrusters/{id}/controller",
            "/v1/thrusters/{id}/excitation",
            "/v1/thrusters/{id}/history",
            "/v1/recordings/{name}/estimates",
            "/v1/thrusters/{id}/stream",
            "/v1/thrusters/{id}/rig",
            "/v1/thrusters/{id}/rig/rollback",
            "/v1/thrusters/{id}/rig/revisions",
            "/v1/thrusters/{id}/rig/revisions/{number}",
            "/v1/thrusters/{id}/diagnoses",
            "/v1/thrusters/{id}/diagnoses/{diagnosis}",
            "/v1/thrusters/{id}/diagnoses/{diagnosis}/report",
            "/v1/thrusters/{id}/fits",
            "/v1/thrusters/{id}/fits/{fit}",
            "/v1/thrusters/{id}/fits/{fit}/rig",
        ] {
            assert!(document["paths"][route].is_object(), "{route} is not documented");
        }
        let schemas = &document["components"]["schemas"];
        let thrust = &schemas["Setpoint"]["oneOf"][0]["properties"]["thrust_n"];
        let range = &stack.state().unwrap()["range"]["thrust_n"];
        assert_eq!(&thrust["maximum"], range);
        assert!(thrust["description"].as_str().unwrap().contains("range.thrust_n"), "{thrust}");
        for side in ["before", "after"] {
            assert!(
                schemas["Change"]["properties"][side]["type"].is_null(),
                "any value: {}",
                schemas["Change"]
            );
        }
        let texts = &document["paths"]["/v1/thrusters/{id}/rig"]["post"]["requestBody"]["content"];
        assert!(texts["application/toml"].is_object() && texts["text/plain"].is_object(), "{texts}");
        for (path, methods) in document["paths"].as_object().unwrap() {
            for (method, operation) in
                methods.as_object().unwrap().iter().filter(|(_, o)| o["responses"].is_object())
            {
                for status in ["403", "408", "421"] {
                    assert!(operation["responses"][status].is_object(), "{method} {path}: {status}");
                }
                let asks = operation["parameters"].is_array();
                assert!(!asks || operation["responses"]["400"].is_object(), "{method} {path}: 400");
            }
            let real = path
                .replace("{id}", "t1")
                .replace("{name}", "none")
                .replace("{code}", "4")
                .replace("{number}", "1");
            let real = real.replace("{diagnosis}", "none").replace("{fit}", "none");
            for method in methods.as_object().unwrap().keys() {
                let answer = send(port, &method.to_uppercase(), &real, &[], b"");
                let documented = &document["paths"][path][method]["responses"][answer.status.to_string()];
                assert!(
                    documented.is_object(),
                    "{method} {path} answered {}, which is not documented",
                    answer.status
                );
            }
        }
        let docs = send(port, "GET", "/docs/", &[], b"");
        assert_eq!(docs.status, 200);
        for page in [docs, send(port, "GET", "/", &[], b"")] {
            assert!(
                page.head.contains("frame-ancestors 'none'"),
                "no other page may frame it: {}",
                page.head
            );
        }
        assert_eq!(send(port, "GET", "/docs/swagger-ui-bundle.js", &[], b"").status, 200);
    });
}

#[test]
fn the_page_of_a_fault_is_a_page_for_a_browser_and_text_for_a_program() {
    let site = Site::new();
    let mut gateway = site.spawn("gateway");
    let read = |accept: &str| send(site.port, "GET", "/v1/faults/4", &[("Accept", accept)], b"").text();
    let text = read("*/*");
    assert!(text.contains("## Cause") && !text.contains("<h2>"), "{text}");
    let page = read("text/html,application/xhtml+xml,*/*;q=0.8");
    assert!(page.starts_with("<!DOCTYPE html>") && page.contains("<h2>Cause</h2>"), "{page}");
    kill(gateway.id(), "TERM");
    wait("the gateway to end", || gateway.try_wait().unwrap());
}
