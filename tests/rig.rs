//! The rig description under way, from outside: another revision is taken over without a stop, named everywhere, kept
//! over restarts, and gone back from.

mod common;

use std::time::Duration;

use common::{KORT, Site, Stack, kill, run, wait};
use serde_json::{Value, json};

const RIG: &str = include_str!("../config/thrusters/whitcomb-yoerger-1999.toml");

/// The stand with dry friction.
fn rubbing() -> String {
    format!(
        "{RIG}\n[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = {{ value = 0.3, tol = 0.1 }}\n"
    )
}

/// One request with these headers; status and body as text.
fn ask(stack: &Stack, method: &str, path: &str, headers: &[(&str, &str)], body: &str) -> (u16, String) {
    let agent: ureq::Agent = ureq::Agent::config_builder()
        .http_status_as_error(false)
        .timeout_global(Some(Duration::from_secs(15)))
        .build()
        .into();
    let url = format!("http://127.0.0.1:{}/v1/thrusters/t1{path}", stack.site.port);
    let mut request = ureq::http::Request::builder().method(method).uri(url);
    for (name, value) in headers {
        request = request.header(*name, *value);
    }
    let mut answer = agent.run(request.body(body.to_owned()).unwrap()).expect("an answer");
    (answer.status().as_u16(), answer.body_mut().read_to_string().unwrap())
}

const TEXT: (&str, &str) = ("Content-Type", "text/plain");
const JSON: (&str, &str) = ("Content-Type", "application/json");

fn parsed(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

/// Waits until the controller runs on a revision.
fn runs_on(stack: &Stack, revision: &Value) {
    wait("the controller to run on the revision", || {
        (stack.state()?["rig_revision"] == *revision).then_some(())
    });
}

#[test]
fn a_revision_is_taken_under_way_and_gone_back_from() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let first = stack.expect("GET", "/rig", None);
        assert_eq!(
            (&first["number"], &first["source"], &first["toml"]),
            (&json!(1), &json!("deployment"), &json!(RIG))
        );
        runs_on(&stack, &first["revision"]);
        assert_eq!(stack.expect("GET", "", None)["revision_trial"], Value::Null, "there was no other");

        // A dry run shows the difference and changes nothing.
        let text = rubbing();
        let (status, dry) = ask(&stack, "POST", "/rig?dry_run=true", &[TEXT], &text);
        assert_eq!(status, 200, "{dry}");
        let dry = parsed(&dry);
        assert_eq!((&dry["applied"], &dry["in_force"]["number"]), (&json!(false), &json!(1)));
        let keys: Vec<&str> =
            dry["difference"].as_array().unwrap().iter().map(|c| c["key"].as_str().unwrap()).collect();
        assert_eq!(keys, ["effects.coulomb_friction", "effects.coulomb_friction.coulomb_torque_n_m"]);
        assert_eq!(dry["difference"][1]["after"], json!({"value": 0.3, "tol": 0.1}));

        stack.thrust(60.0, 60_000);
        let mut watch = stack.watch();
        let before = watch.next();
        let taken = stack.expect("POST", "/rig", Some(json!({"toml": text, "note": "cable seal"})));
        assert_eq!((&taken["applied"], &taken["difference"]), (&json!(true), &dry["difference"]));
        let in_force = &taken["in_force"];
        assert_eq!(
            (&in_force["number"], &in_force["before"], &in_force["note"], &in_force["who"]),
            (&json!(2), &json!(1), &json!("cable seal"), &json!("local"))
        );
        runs_on(&stack, &in_force["revision"]);
        // Whether it is worse is not known so soon, and not said.
        let trial = |stack: &Stack| stack.expect("GET", "", None)["revision_trial"].clone();
        let not_judged = |shown: Value, revision: u32, before: Value| {
            let why = shown["not_judged"].as_str().unwrap_or_else(|| panic!("no reason: {shown}"));
            let of = json!({"revision": revision, "before": before, "before_rms_n": null, "since_rms_n": null,
                "compared_s": 0, "larger": null, "not_judged": why});
            assert_eq!(shown, of);
        };
        not_judged(trial(&stack), 2, json!(1));
        let metrics = stack.text("/metrics").expect("metrics");
        assert!(!metrics.contains("kort_rig_revision_worse{"), "{metrics}");
        // Not stopped, not tripped, and no step: the thrust of each sample stays near.
        for _ in 0..500 {
            let t = watch.next();
            assert!(t.armed != 0 && t.faults == 0, "{t:?}");
            assert_eq!(t.armed_at_ns, before.armed_at_ns, "it was armed all the time");
            assert!((t.signals.thrust_n - 60.0).abs() < 15.0, "{}", t.signals.thrust_n);
        }

        // Named in a recording that begins now.
        let site = &stack.site;
        let post = |path: &str, body: Value| {
            let url = format!("http://127.0.0.1:{}{path}", site.port);
            ureq::post(url).send_json(body).expect("an answer").status().as_u16()
        };
        assert_eq!(post("/v1/recordings", json!({"name": "revised"})), 201);
        std::thread::sleep(Duration::from_millis(700));
        assert!(ureq::delete(format!("http://127.0.0.1:{}/v1/recordings", site.port)).call().is_ok());
        let file = site.folder.path().join("recordings/revised.mcap");
        let bytes = std::fs::read(file).unwrap();
        let holds = |words: &str| bytes.windows(words.len()).any(|part| part == words.as_bytes());
        assert!(
            holds(in_force["revision"].as_str().unwrap()) && holds("coulomb_torque_n_m"),
            "the file names it"
        );

        // The same again changes nothing, and is a command all the same; the way back is one step, and no more.
        let (status, foreign) = ask(&stack, "POST", "/rig", &[TEXT, ("Lease-Id", "made-up")], &text);
        assert_eq!(status, 409, "{foreign}");
        let lease = stack.leases["t1"].clone();
        let (status, same) = ask(&stack, "POST", "/rig", &[TEXT, ("Lease-Id", &lease)], &text);
        assert_eq!((status, &parsed(&same)["applied"]), (200, &json!(false)), "{same}");
        let dry = stack.expect("POST", "/rig/rollback?dry_run=true", None);
        assert_eq!((&dry["applied"], &dry["in_force"]["number"]), (&json!(false), &json!(2)), "{dry}");
        let back = stack.expect("POST", "/rig/rollback", None);
        assert_eq!((&back["in_force"]["number"], &back["difference"][0]["after"]), (&json!(1), &Value::Null));
        assert_eq!(dry["difference"], back["difference"], "as it was announced");
        runs_on(&stack, &first["revision"]);
        not_judged(trial(&stack), 1, Value::Null);
        let (status, none) = stack.http("POST", "/rig/rollback", None).unwrap();
        assert_eq!((status, &none["type"]), (409, &json!("urn:kort:problem:refused")), "{none}");
        assert!(watch.next().armed != 0);

        let list = stack.expect("GET", "/rig/revisions", None);
        let shown: Vec<(&Value, &Value)> =
            list.as_array().unwrap().iter().map(|r| (&r["number"], &r["in_force"])).collect();
        assert_eq!(shown, [(&json!(1), &json!(true)), (&json!(2), &json!(false))]);
        assert_eq!(ask(&stack, "GET", "/rig/revisions/2?format=toml", &[], ""), (200, text));
        wait("the events", || {
            let events = stack.get("/v1/events")?;
            let kinds: Vec<&str> = events.as_array()?.iter().filter_map(|e| e["kind"].as_str()).collect();
            (kinds.contains(&"rig_changed") && kinds.contains(&"rig_rolled_back")).then_some(())
        });

        // The metrics count with the motor of the rig in force: 3 A through 10 ohm of winding show.
        let power_w = || {
            let metrics = stack.text("/metrics")?;
            let line = metrics.lines().find(|line| line.starts_with("kort_motor_power_watts{"))?;
            line.rsplit(' ').next()?.parse::<f64>().ok()
        };
        let before_w = wait("the power", power_w);
        let wound = RIG.replacen("[amplifier]", "winding_resistance_ohm = 10.0\n\n[amplifier]", 1);
        stack.expect("POST", "/rig", Some(json!({"toml": wound})));
        wait("the winding's loss in the power", || power_w().filter(|power_w| *power_w > 1.3 * before_w));
    });
}

#[test]
fn a_revision_outlives_controller_and_gateway() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let (status, taken) = ask(&stack, "POST", "/rig", &[TEXT], &rubbing());
        assert_eq!(status, 200, "{taken}");
        let revision = parsed(&taken)["in_force"]["revision"].clone();
        runs_on(&stack, &revision);
        for role in ["controller", "gateway"] {
            let old = stack.process_of(role);
            kill(old, "KILL");
            wait("a successor", || stack.process(role).filter(|new| *new != old));
            runs_on(&stack, &revision);
        }
        assert_eq!(stack.expect("GET", "/rig", None)["number"], 2);
    });
}

#[test]
fn a_revision_that_was_answered_is_in_the_log_however_the_service_ends() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let log = stack.site.folder.path().join("events/events.jsonl");
        let told = |kind: &str| std::fs::read_to_string(&log).unwrap_or_default().matches(kind).count();
        let (status, taken) = ask(&stack, "POST", "/rig", &[TEXT], &rubbing());
        assert_eq!((status, told("\"rig_changed\"")), (200, 1), "{taken}");
        let (status, back) = ask(&stack, "POST", "/rig/rollback", &[], "");
        kill(stack.process_of("gateway"), "KILL");
        assert_eq!((status, told("\"rig_rolled_back\"")), (200, 1), "{back}");
    });
}

/// Headers and body of a request; status, type of its answer, and a word of it.
type Case<'a> = (&'a [(&'a str, &'a str)], &'a str, u16, &'a str, &'a str);

#[test]
fn what_cannot_be_used_is_refused_with_the_reason() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let wrong = RIG.replace("torque_constant_nm_a", "torque_konstant_nm_a");
        let far = RIG.replacen("radius_m = ", "radius_m = 130 # ", 1);
        let other_drive = RIG.replace("kind = \"current\"", "kind = \"speed\"");
        let dry = "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n";
        let large = format!("# {}\n{RIG}", "x".repeat(300_000));
        let cases: &[Case] = &[
            (&[TEXT], &wrong, 422, "invalid-rig", "torque_konstant_nm_a"),
            (&[TEXT], &far, 422, "invalid-rig", "propeller.radius_m"),
            (&[TEXT], dry, 422, "invalid-rig", "propeller"),
            (&[TEXT], "", 422, "invalid-rig", "missing"),
            (&[TEXT], &other_drive, 409, "refused", "amplifier.kind"),
            (&[TEXT], &large, 413, "body-too-large", "262144"),
            (&[JSON], "{}", 422, "invalid-field", "toml"),
            (&[JSON], r#"{"toml": "x", "revision": 1}"#, 422, "invalid-field", "toml"),
            (&[JSON], r#"{"revision": 9}"#, 404, "unknown-revision", "9"),
            (&[JSON], r#"{"rig": "x"}"#, 422, "invalid-field", "rig"),
            (&[JSON], "{", 400, "malformed-json", "JSON"),
            (&[], "x", 415, "unsupported-media-type", "Content-Type"),
        ];
        for (headers, body, status, slug, word) in cases {
            let (answered, problem) = ask(&stack, "POST", "/rig", headers, body);
            let problem = parsed(&problem);
            assert_eq!(
                (answered, &problem["type"]),
                (*status, &json!(format!("urn:kort:problem:{slug}"))),
                "{problem}"
            );
            let words = format!("{}{}", problem["detail"], problem["title"]);
            assert!(words.contains(word), "{word}: {problem}");
        }
        assert_eq!(ask(&stack, "GET", "/rig/revisions/7", &[], "").0, 404);

        // All that is wrong is told at once, as `kort check` tells it.
        let many = wrong.replacen("radius_m = ", "radius_m = 130 # ", 1).replace("[run]", "[rnu]");
        let (status, problem) = ask(&stack, "POST", "/rig?dry_run=true", &[TEXT], &many);
        let problem = parsed(&problem);
        let site = tempfile::tempdir().unwrap();
        let file = site.path().join("many.toml");
        std::fs::write(&file, &many).unwrap();
        let checked = run(std::process::Command::new(KORT).args(["check", "--json"]).arg(&file));
        let mut checked = parsed(&String::from_utf8_lossy(&checked.stdout))["problems"].clone();
        for told in checked.as_array_mut().unwrap() {
            told.as_object_mut().unwrap().remove("file");
        }
        assert_eq!((status, &problem["problems"]), (422, &checked), "{problem}");
        assert_eq!(checked.as_array().map(Vec::len), Some(3), "{checked}");
        for told in checked.as_array().unwrap() {
            assert!(
                problem["detail"].as_str().unwrap().contains(told["message"].as_str().unwrap()),
                "{problem}"
            );
        }

        // Under another's lease nothing changes.
        let lease = json!({"holder": "bench", "ttl_ms": 60000}).to_string();
        let (_, granted) = ask(&stack, "POST", "/lease", &[JSON], &lease);
        let (status, problem) = ask(&stack, "POST", "/rig", &[TEXT], &rubbing());
        assert_eq!((status, &parsed(&problem)["holder"]), (409, &json!("bench")), "{problem}");
        assert_eq!(ask(&stack, "POST", "/rig/rollback", &[], "").0, 409);
        let id = parsed(&granted)["lease_id"].as_str().unwrap().to_owned();
        let (status, taken) = ask(&stack, "POST", "/rig", &[TEXT, ("Lease-Id", &id)], &rubbing());
        assert_eq!((status, &parsed(&taken)["applied"]), (200, &json!(true)), "{taken}");
    });
}

/// A rig description is configuration: reading it is a viewer's, changing it an admin's.
#[test]
fn only_an_admin_changes_the_rig() {
    common::in_real_time(|| {
        let site = Site::new();
        site.add("[gateway]", "require_tokens = true");
        let token = |name: &str, role: &str| {
            let mut command = std::process::Command::new(KORT);
            command.args(["token", "new", name, "--role", role, "--config"]).arg(site.config());
            let out = run(command.current_dir(site.folder.path()));
            format!("Bearer {}", String::from_utf8_lossy(&out.stdout).trim())
        };
        let [viewer, pilot, admin] = ["viewer", "pilot", "admin"].map(|role| token(role, role));
        let mut supervisor = site.spawn("up");
        let stop = |supervisor: &mut std::process::Child| {
            kill(supervisor.id(), "TERM");
            let _ = supervisor.wait();
        };
        let status = |method: &str, path: &str, token: &str, body: &str| {
            let url = format!("http://127.0.0.1:{}/v1/thrusters/t1{path}", site.port);
            let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
            let request = ureq::http::Request::builder().method(method).uri(url);
            let request = request.header("Content-Type", "text/plain").header("Authorization", token);
            Some(agent.run(request.body(body.to_owned()).ok()?).ok()?.status().as_u16())
        };
        let asked = std::panic::catch_unwind(|| {
            wait("the service", || status("GET", "/rig", &viewer, "").filter(|s| *s == 200));
            for low in [&viewer, &pilot] {
                assert_eq!(status("POST", "/rig", low, &rubbing()), Some(403));
                assert_eq!(status("POST", "/rig/rollback", low, ""), Some(403));
            }
            // 503 until servo and controller are heard.
            wait("the admin's", || status("POST", "/rig", &admin, &rubbing()).filter(|s| *s == 200));
        });
        stop(&mut supervisor);
        asked.unwrap();
    });
}

/// An effect of a rig that no law and no observer reckons with is named, with why, in the answer that puts the rig in
/// force: the law then goes on as if it were not there.
#[test]
fn what_no_law_uses_is_named_when_a_revision_is_put_in_force() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let text = format!("{}{}", rubbing(), common::VENTILATION);
        let (status, dry) = ask(&stack, "POST", "/rig?dry_run=true", &[TEXT], &text);
        assert_eq!(status, 200, "{dry}");
        let taken = stack.expect("POST", "/rig", Some(json!({ "toml": text })));
        for answer in [parsed(&dry), taken] {
            let unused = answer["unused_effects"].as_array().expect("a list");
            assert_eq!(unused.len(), 1, "friction is used: {answer}");
            assert_eq!(unused[0]["effect"], "ventilation", "{answer}");
            assert!(unused[0]["why"].as_str().is_some_and(|why| why.contains("observer")), "{answer}");
        }
        let back = stack.expect("POST", "/rig/rollback", None);
        assert_eq!(back["unused_effects"], json!([]), "{back}");
    });
}
