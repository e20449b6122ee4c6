//! Fits of a running thruster, from outside: of a recording and of the last minutes, followed, read, used, cancelled, refused.

use kort_thruster::rig::Rig;
use serde_json::{Value, json};

use crate::common::jobs::{held, stand_with_tolerances};
use crate::common::{self, Site, Stack, wait};
use crate::{drive, name_of, over};

/// Starts and stops recordings.
fn record(stack: &Stack, method: &str, path: &str, body: Option<Value>) {
    let url = format!("http://127.0.0.1:{}/v1/recordings{path}", stack.site.port);
    let request =
        ureq::http::Request::builder().method(method).uri(url).header("Content-Type", "application/json");
    ureq::run(request.body(body.map(|b| b.to_string()).unwrap_or_default()).unwrap()).unwrap();
}

#[test]
fn a_recording_is_fitted_and_the_fit_used_and_gone_back_from() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(40.0, 60_000);
        record(&stack, "POST", "", Some(json!({"name": "levels", "thruster": "t1"})));
        drive(&mut stack, &[60.0, -60.0, 120.0, 20.0, -100.0, 80.0, -20.0, 100.0]);
        record(&stack, "DELETE", "/levels", None);
        let rig = stand_with_tolerances(&[("lift_max", 0.15), ("drag_max", 0.3), ("flux_coefficient", 0.2)]);
        let stated = stack.expect("POST", "/rig", Some(json!({"toml": rig})))["in_force"]["revision"].clone();
        let mut begun = Value::Null;
        let pid = held(&stack, "fit", || {
            let (status, answer) = stack.http("POST", "/fits", Some(json!({"recording": "levels"}))).unwrap();
            assert_eq!(status, 202, "{answer}");
            begun = answer;
        });
        assert_eq!(
            (&begun["state"], &begun["of"], &begun["rig_revision"], &begun["parameters"]),
            (&json!("running"), &json!("recording levels"), &stated, &json!([]))
        );
        let id = name_of(&begun);
        // One at a time, whichever of the two is asked for.
        for path in ["/diagnoses", "/fits"] {
            let (status, busy) = stack.http("POST", path, None).unwrap();
            assert_eq!(
                (status, &busy["type"]),
                (409, &json!("urn:kort:problem:fit-active")),
                "{path}: {busy}"
            );
            assert!(busy["hint"].as_str().unwrap().contains(&format!("DELETE …/fits/{id}")), "{busy}");
        }
        let state = stack.state().unwrap();
        assert_eq!((&state["fit"]["id"], &state["diagnosis"]), (&json!(id), &Value::Null));
        assert!(state["fit"]["step"].as_str().unwrap().len() > 3, "{state}");
        assert_eq!(stack.expect("GET", &format!("/fits/{id}"), None)["report"], Value::Null);
        common::kill(pid, "CONT");

        let done = over(&stack, &format!("/fits/{id}"));
        assert_eq!(
            (&done["state"], &done["cause"], &done["usable"]),
            (&json!("done"), &Value::Null, &json!(true)),
            "{done}"
        );
        assert_eq!((&done["report"]["schema"], &done["model"]), (&json!("kort.fit/1"), &json!("model2")));
        assert!(stack.state().unwrap()["fit"].is_null());
        // What is shown of it is the report's, beside what the rig states with its tolerance.
        let fitted = done["parameters"].as_array().unwrap();
        assert_eq!((fitted.len(), done["report"]["parameters"].as_array().unwrap().len()), (3, 3), "{done}");
        let lift = fitted.iter().find(|p| p["name"] == "lift_max").unwrap_or_else(|| panic!("{done}"));
        assert_eq!(
            (&lift["stated"], &lift["stated_tol"], &lift["unit"]),
            (&json!(0.542), &json!(0.15), &json!("1"))
        );
        let (value, doubt) = (lift["value"].as_f64().unwrap(), lift["std_error"].as_f64().unwrap());
        assert!((value - 0.542).abs() < 0.1 && doubt > 0.0 && doubt < 0.05, "{lift}");
        let left = done["heldout"].as_array().unwrap();
        let speed =
            left.iter().find(|l| l["channel"] == "shaft_speed_rad_s").unwrap_or_else(|| panic!("{done}"));
        assert_eq!(speed["nrmse"], done["report"]["channels"]["shaft_speed_rad_s"]["nrmse_heldout"]);
        for open in done["not_identifiable"].as_array().unwrap() {
            assert!(
                open["parameters"][0].is_string() && open["excitation"].as_str().unwrap().len() > 10,
                "{open}"
            );
        }
        let listed = stack.expect("GET", "/fits", None);
        assert_eq!((&listed[0]["id"], &listed[0]["parameters"]), (&json!(id), &done["parameters"]));
        assert_eq!(stack.expect("GET", "/diagnoses", None), json!([]), "a fit is no diagnosis");

        let text = stack.text(&format!("/v1/thrusters/t1/fits/{id}/rig")).unwrap();
        assert!(text.contains("fitted by kort fit"), "{text}");
        let rig = Rig::from_toml(&text).unwrap().propeller.unwrap();
        assert!(
            (rig.lift_max.value - value).abs() < 1e-5 && rig.lift_max.tol.is_some(),
            "{:?}",
            rig.lift_max
        );
        let would = stack.expect("POST", "/rig?dry_run=true", Some(json!({"fit": id})));
        assert_eq!((&would["applied"], &would["in_force"]["revision"]), (&json!(false), &stated));
        let used = stack.expect("POST", "/rig", Some(json!({"fit": id})));
        assert_eq!(
            (&used["applied"], &used["in_force"]["source"]),
            (&json!(true), &json!(format!("fit {id}")))
        );
        let changed = used["difference"].as_array().unwrap();
        assert!(changed.iter().any(|change| change["key"] == "propeller.lift_max"), "{used}");
        // It was fitted on a revision that is not in force any more.
        let (status, again) = stack.http("POST", "/rig", Some(json!({"fit": id}))).unwrap();
        assert_eq!((status, &again["type"]), (409, &json!("urn:kort:problem:refused")), "{again}");
        assert_eq!(stack.expect("POST", "/rig/rollback", None)["in_force"]["revision"], stated);

        assert_eq!(stack.http("DELETE", &format!("/fits/{id}"), None).unwrap().0, 204);
        let (status, gone) = stack.http("GET", &format!("/fits/{id}"), None).unwrap();
        assert_eq!((status, &gone["type"]), (404, &json!("urn:kort:problem:unknown-fit")), "{gone}");
        wait("the events", || {
            let events = stack.get("/v1/events")?;
            let kinds: Vec<&str> = events.as_array()?.iter().filter_map(|e| e["kind"].as_str()).collect();
            ["fit_started", "fit_done", "rig_changed", "rig_rolled_back", "fit_deleted"]
                .iter()
                .all(|kind| kinds.contains(kind))
                .then_some(())
        });
    });
}

#[test]
fn a_fit_is_refused_with_the_reason_and_cancelled() {
    common::in_real_time(|| {
        let mut stack = Stack::start_at(Site::new().with_t2());
        stack.thrust(40.0, 60_000);
        record(&stack, "POST", "", Some(json!({"name": "other", "thruster": "t2"})));
        let refused = |stack: &Stack, body: Value, status: u16, slug: &str| {
            let (answered, problem) = stack.http("POST", "/fits", Some(body.clone())).unwrap();
            let slug = format!("urn:kort:problem:{slug}");
            assert_eq!((answered, &problem["type"]), (status, &json!(slug)), "{body}: {problem}");
            assert!(problem["hint"].is_string(), "{problem}");
            problem
        };
        let unknown = refused(&stack, json!({"recording": "nowhere"}), 404, "unknown-recording");
        assert!(unknown["detail"].as_str().unwrap().contains("\"nowhere\""), "{unknown}");
        let others = refused(&stack, json!({"recording": "other"}), 409, "refused");
        assert!(others["hint"].as_str().unwrap().contains("/t2/fits"), "{others}");
        refused(&stack, json!({"last_s": 60, "model": "model9"}), 422, "out-of-range");
        record(&stack, "DELETE", "/other", None);

        drive(&mut stack, &[60.0, -60.0]);
        refused(&stack, json!({"last_s": 60, "after": "t1-none"}), 404, "unknown-fit");
        let diagnosis = name_of(&stack.expect("POST", "/diagnoses", Some(json!({"last_s": 60}))));
        let busy = refused(&stack, json!({"last_s": 60}), 409, "diagnosis-active");
        assert!(busy["detail"].as_str().unwrap().contains(&diagnosis), "{busy}");
        stack.expect("DELETE", &format!("/diagnoses/{diagnosis}"), None);
        assert_eq!(over(&stack, &format!("/diagnoses/{diagnosis}"))["state"], "cancelled");

        let mut begun = Value::Null;
        let pid = held(&stack, "fit", || begun = stack.expect("POST", "/fits", Some(json!({"last_s": 60}))));
        let id = name_of(&begun);
        let told = std::fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap();
        assert!(told.contains("recording.mcap") && told.contains("--job"), "{told:?}");
        assert_eq!(stack.expect("DELETE", &format!("/fits/{id}"), None)["state"], "cancelled");
        assert_eq!(over(&stack, &format!("/fits/{id}"))["state"], "cancelled");
        assert!(!common::alive(pid));
        for (method, path, body) in
            [("GET", format!("/fits/{id}/rig"), None), ("POST", "/rig".into(), Some(json!({"fit": id})))]
        {
            let (status, problem) = stack.http(method, &path, body).unwrap();
            assert_eq!(
                (status, &problem["type"]),
                (409, &json!("urn:kort:problem:refused")),
                "{path}: {problem}"
            );
        }
    });
}
