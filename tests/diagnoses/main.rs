//! Diagnoses and fits of a running thruster and the test signals for them, from outside: played, begun, followed, read, used, gone back from, cancelled.

#[path = "../common/mod.rs"]
mod common;
mod fits;

use std::time::Duration;

use common::jobs::job;
use common::{Site, Stack, kill, pages, wait};
use serde_json::{Value, json};

/// How long a diagnosis or a fit may take that runs behind everything else on a machine full of tests.
const LONG: Duration = Duration::from_secs(300);

/// A stand with dry friction that its rig description does not know of.
fn rubbing() -> Stack {
    let site = Site::new();
    let effect = "id = \"coulomb_friction\", coulomb_torque_n_m = 1.2, stribeck_rise = 0.3, stribeck_speed_rad_s = 2.0";
    site.add("limits = { full_drive_s = 0.005 }", &format!("simulation = {{ effects = [{{ {effect} }}] }}"));
    Stack::start_at(site)
}

/// Setpoints that tell the paths apart: up, down and through zero.
fn drive(stack: &mut Stack, levels: &[f64]) {
    for newton in levels {
        stack.thrust(*newton, 60_000);
        std::thread::sleep(Duration::from_millis(1200));
    }
}

/// Waits until a diagnosis or a fit is over; what became of it.
fn over(stack: &Stack, path: &str) -> Value {
    let end = std::time::Instant::now() + LONG;
    loop {
        let found = stack.expect("GET", path, None);
        if found["state"] != "running" {
            return found;
        }
        assert!(std::time::Instant::now() < end, "it takes too long: {found}");
        std::thread::sleep(Duration::from_millis(200));
    }
}

fn name_of(info: &Value) -> String {
    info["id"].as_str().unwrap_or_else(|| panic!("no name: {info}")).to_owned()
}

#[test]
fn what_the_rig_does_not_know_is_found_used_and_gone_back_from() {
    common::in_real_time(|| {
        let mut stack = rubbing();
        drive(&mut stack, &[60.0, -60.0, 120.0, 20.0, -100.0, 80.0, -20.0, 100.0]);
        let stated = stack.expect("GET", "/rig", None)["revision"].clone();
        let (status, begun) = stack.http("POST", "/diagnoses", Some(json!({"last_s": 60}))).unwrap();
        assert_eq!(status, 202, "{begun}");
        let id = name_of(&begun);
        assert_eq!((&begun["state"], &begun["rig_revision"]), (&json!("running"), &stated));
        let (status, busy) = stack.http("POST", "/diagnoses", None).unwrap();
        assert_eq!((status, &busy["type"]), (409, &json!("urn:kort:problem:diagnosis-active")), "{busy}");
        wait("the state to tell a step", || {
            let diagnosis = stack.state()?["diagnosis"].clone();
            (diagnosis["id"] == id.as_str() && diagnosis["step"].as_str()?.len() > 3).then_some(())
        });

        let done = over(&stack, &format!("/diagnoses/{id}"));
        assert_eq!((&done["state"], &done["cause"]), (&json!("done"), &Value::Null), "{done}");
        assert_eq!(done["report"]["schema"], "kort.diagnosis/2");
        assert_eq!(done["report"]["verdict"], done["verdict"]);
        let named: Vec<&str> =
            done["findings"].as_array().unwrap().iter().filter_map(|f| f["effect"].as_str()).collect();
        assert!(named.contains(&"coulomb_friction") && done["usable"] == true, "{done}");
        assert!(stack.state().unwrap()["diagnosis"].is_null());
        let page = stack.text(&format!("/v1/thrusters/t1/diagnoses/{id}/report")).unwrap();
        assert!(page.starts_with("<!DOCTYPE html>") && page.contains("coulomb"), "{page:.300}");

        // Used under way, and named; a recording that goes on holds both descriptions.
        drive(&mut stack, &[50.0]);
        let recordings = format!("http://127.0.0.1:{}/v1/recordings", stack.site.port);
        let named = json!({"name": "across"}).to_string();
        ureq::post(&recordings).header("Content-Type", "application/json").send(named).unwrap();
        std::thread::sleep(Duration::from_millis(300));
        let used = stack.expect("POST", "/rig", Some(json!({"diagnosis": id})));
        assert_eq!(
            (&used["applied"], &used["in_force"]["source"]),
            (&json!(true), &json!(format!("diagnosis {id}")))
        );
        let keys: Vec<&str> =
            used["difference"].as_array().unwrap().iter().map(|c| c["key"].as_str().unwrap()).collect();
        assert!(keys.contains(&"effects.coulomb_friction.coulomb_torque_n_m"), "{keys:?}");
        let state = stack.state().unwrap();
        assert_eq!((&state["rig_revision"], &state["armed"]), (&used["in_force"]["revision"], &json!(true)));
        std::thread::sleep(Duration::from_millis(1200));
        // It was compared with a revision that is not in force any more.
        let (status, again) = stack.http("POST", "/rig", Some(json!({"diagnosis": id}))).unwrap();
        assert_eq!((status, &again["type"]), (409, &json!("urn:kort:problem:refused")), "{again}");
        let back = stack.expect("POST", "/rig/rollback", None);
        assert_eq!(back["in_force"]["revision"], stated);
        std::thread::sleep(Duration::from_millis(1200));
        ureq::delete(format!("{recordings}/across")).call().unwrap();
        let file = std::fs::read(stack.site.folder.path().join("recordings/across.mcap")).unwrap();
        let about = kort_recording::Recording::decode("across", file.as_slice(), None).unwrap().about;
        let told = ["rig_revision", "rig_revision.2", "rig_revision.3"].map(|key| json!(about.get(key)));
        assert_eq!(told, [stated.clone(), used["in_force"]["revision"].clone(), stated.clone()]);
        assert!(about["rig.2"].contains("coulomb_friction") && !about["rig"].contains("coulomb_friction"));
        wait("the events", || {
            let events = stack.get("/v1/events")?;
            let kinds: Vec<&str> = events.as_array()?.iter().filter_map(|e| e["kind"].as_str()).collect();
            ["diagnosis_started", "diagnosis_done", "rig_changed", "rig_rolled_back"]
                .iter()
                .all(|kind| kinds.contains(kind))
                .then_some(())
        });
    });
}

#[test]
fn a_diagnosis_gives_way_is_cancelled_and_ends_with_its_gateway() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        drive(&mut stack, &[60.0, -60.0]);
        let begin = |stack: &Stack| {
            wait("a diagnosis to begin", || {
                let (status, info) = stack.http("POST", "/diagnoses", Some(json!({"last_s": 60})))?;
                (status == 202).then(|| name_of(&info))
            })
        };
        let id = begin(&stack);
        let pid = wait("its process", || job(&stack, "diagnose"));
        // proc(5): nice and policy are fields 19 and 41; SCHED_IDLE is 5.
        wait("it to give way", || {
            let stat = std::fs::read_to_string(format!("/proc/{pid}/stat")).ok()?;
            let fields: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
            (fields[16] == "19" && fields[38] == "5").then_some(())
        });
        let cancelled = stack.expect("DELETE", &format!("/diagnoses/{id}"), None);
        assert_eq!(cancelled["state"], "cancelled");
        assert_eq!(over(&stack, &format!("/diagnoses/{id}"))["state"], "cancelled");
        assert!(!common::alive(pid));
        let (status, page) = stack.http("GET", &format!("/diagnoses/{id}/report"), None).unwrap();
        assert_eq!((status, &page["type"]), (409, &json!("urn:kort:problem:refused")), "{page}");
        assert_eq!(stack.http("POST", "/rig", Some(json!({"diagnosis": id}))).unwrap().0, 409);

        // Its gateway dies: so does it, and its successor says what became of it.
        let second = begin(&stack);
        let pid = wait("its process", || job(&stack, "diagnose"));
        let old = stack.process_of("gateway");
        kill(old, "KILL");
        wait("its end", || (!common::alive(pid)).then_some(()));
        wait("a successor", || stack.process("gateway").filter(|new| *new != old));
        stack.wait_until_up();
        let list = stack.expect("GET", "/diagnoses", None);
        let states: Vec<(&Value, &Value)> =
            list.as_array().unwrap().iter().map(|d| (&d["id"], &d["state"])).collect();
        assert_eq!(states, [(&json!(id), &json!("cancelled")), (&json!(second), &json!("failed"))]);
        assert_eq!(stack.http("DELETE", &format!("/diagnoses/{id}"), None).unwrap().0, 204);
        assert_eq!(stack.http("GET", &format!("/diagnoses/{id}"), None).unwrap().0, 404);
    });
}

#[test]
fn a_test_signal_plays_under_the_lease_and_ends_at_zero() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        let ramp = |to: f64, duration_s: f64| json!({"segments": [{"kind": "ramp", "from": 0, "to": to, "duration_s": duration_s}]});
        // What it would do is told without a lease; what it may not do is refused before anything moves.
        let preview = stack.expect("POST", "/excitation?dry_run=true", Some(ramp(60.0, 4.0)));
        assert_eq!((&preview["state"], preview["preview"][500][1].as_f64()), (&json!("preview"), Some(30.0)));
        for (body, slug) in [
            (ramp(60.0, 4.0), "lease-required"),
            (ramp(1e4, 4.0), "out-of-range"),
            (json!({"segments": [{"kind": "noise"}]}), "invalid-field"),
            (json!({"toml": "segments = 1"}), "invalid-field"),
            (json!({}), "invalid-field"),
            (json!({"diagnosis": "t1-none"}), "unknown-diagnosis"),
        ] {
            let (_, problem) = stack.http("POST", "/excitation", Some(body.clone())).unwrap();
            assert_eq!(problem["type"], format!("urn:kort:problem:{slug}"), "{body}: {problem}");
        }
        let (status, none) = stack.http("DELETE", "/excitation", None).unwrap();
        assert_eq!((status, &none["type"]), (409, &json!("urn:kort:problem:no-excitation")));

        stack.thrust(5.0, 60_000);
        let mut body = ramp(60.0, 3.0);
        body["record"] = json!("ramp");
        let begun = stack.expect("POST", "/excitation", Some(body.clone()));
        assert_eq!((&begun["state"], &begun["recording"]), (&json!("playing"), &json!("ramp")));
        assert_eq!(stack.http("POST", "/excitation", Some(ramp(1.0, 1.0))).unwrap().0, 409);
        wait("the setpoint to follow", || {
            let state = stack.state()?;
            (state["setpoint"]["thrust_n"].as_f64()? > 40.0
                && state["excitation"]["elapsed_s"].as_f64()? > 2.0)
                .then_some(())
        });
        wait("its end at zero", || {
            let state = stack.state()?;
            (state["excitation"].is_null() && state["setpoint"] == json!({"thrust_n": 0.0})).then_some(())
        });
        assert_eq!(stack.expect("GET", "/excitation", None)["state"], "complete");
        wait("its recording", || {
            let list = stack.get("/v1/recordings")?;
            let done = list.as_array()?.iter().find(|r| r["name"] == "ramp")?.clone();
            (done["state"] == "complete" && done["duration_s"].as_f64()? > 3.0).then_some(())
        });

        // A scenario file in shares, ended by hand, by a setpoint, and by a disarming.
        let chirp = include_str!("../../config/scenarios/chirp.toml");
        let shares = json!({"toml": chirp, "limit": 40.0});
        for (method, path, body, left) in [
            ("DELETE", "/excitation", None, json!({"thrust_n": 0.0})),
            ("PUT", "/setpoint", Some(json!({"thrust_n": 7.0})), json!({"thrust_n": 7.0})),
            ("POST", "/disarm", None, json!({"thrust_n": 0.0})),
        ] {
            let begun = stack.expect("POST", "/excitation", Some(shares.clone()));
            assert_eq!(
                (begun["peak"].as_f64().map(f64::round), &begun["name"]),
                (Some(32.0), &json!("chirp"))
            );
            wait("it to play", || (stack.state()?["setpoint"]["thrust_n"] == 20.0).then_some(()));
            stack.expect(method, path, body);
            let last = stack.expect("GET", "/excitation", None);
            assert!(last["state"] == "ended" && last["ended_by"].is_string(), "{last}");
            wait("what comes after", || (stack.state()?["setpoint"] == left).then_some(()));
        }
        // Armed anew it stands still.
        stack.expect("POST", "/arm", None);
        std::thread::sleep(Duration::from_millis(300));
        assert_eq!(stack.state().unwrap()["setpoint"], json!({"thrust_n": 0.0}));
        let events = stack.get("/v1/events").unwrap();
        let kinds = |kind: &str| events.as_array().unwrap().iter().filter(|e| e["kind"] == kind).count();
        assert_eq!((kinds("excitation_started"), kinds("excitation_ended")), (4, 4), "{events}");
    });
}

/// A diagnosis that is kept from before, with its recording and a short experiment that it proposes.
fn kept(site: &Site, id: &str) {
    let folder = site.folder.path().join("kort-state/diagnoses").join(id);
    std::fs::create_dir_all(&folder).unwrap();
    let info = json!({"id": id, "thruster": "t1", "owner": "local", "state": "done", "of": "the last 60 s", "rig_number": 1,
        "rig_revision": "", "started": "2026-01-01T12:00:00.000Z", "elapsed_s": 1.0});
    std::fs::write(folder.join("info.json"), info.to_string()).unwrap();
    let scenario = json!({"name": "separate-a-b", "command": "share", "effects": [{"effect": "coulomb_friction"}],
        "segments": [{"kind": "steps", "values": [0.3, -0.3], "each_s": 0.8}]});
    let report = json!({"next_experiment": {"separates": ["a", "b"], "scenario": scenario}});
    std::fs::write(folder.join("report.json"), report.to_string()).unwrap();
    let made = std::process::Command::new(common::KORT)
        .args(["simulate", "--rig", "whitcomb-yoerger-1999", "--scenario", "torque-step-9.2", "-o"])
        .arg(folder.join("recording.mcap"))
        .output()
        .unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
}

/// The experiment that a diagnosis proposes is played by one call, recorded, and diagnosed together with the first.
#[test]
fn a_proposed_experiment_is_played_and_diagnosed_with_the_first() {
    common::in_real_time(|| {
        let site = Site::new();
        kept(&site, "t1-first");
        let mut stack = Stack::start_at(site);
        stack.thrust(5.0, 60_000);
        let body = json!({"diagnosis": "t1-first", "limit": 60.0});
        let begun = stack.expect("POST", "/excitation", Some(body));
        assert_eq!((&begun["peak"], &begun["left_out"]), (&json!(18.0), &json!(["effects"])), "{begun}");
        let recording = begun["recording"].as_str().unwrap().to_owned();
        let id = wait("its diagnosis", || {
            let last = stack.expect("GET", "/excitation", None);
            assert_ne!(last["state"], "ended", "{last}");
            last["diagnosis"].as_str().map(str::to_owned)
        });
        let info = stack.expect("GET", &format!("/diagnoses/{id}"), None);
        assert_eq!((&info["recording"], &info["after"]), (&json!(recording), &json!("t1-first")));
        let pid = wait("its process", || job(&stack, "diagnose"));
        let asked = std::fs::read_to_string(format!("/proc/{pid}/cmdline")).unwrap();
        let files: Vec<&str> = asked.split('\0').filter(|word| word.ends_with(".mcap")).collect();
        assert!(
            files.len() == 2
                && files[0].ends_with("t1-first/recording.mcap")
                && files[1].ends_with(&format!("{recording}.mcap")),
            "{files:?}"
        );
        assert_eq!(stack.expect("DELETE", &format!("/diagnoses/{id}"), None)["state"], "cancelled");
    });
}

#[test]
fn what_cannot_be_diagnosed_is_refused_with_the_reason() {
    common::in_real_time(|| {
        let stack = Stack::start_at(Site::new().with_t2());
        let record = |method: &str, body: Option<Value>| {
            let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
            let request = ureq::http::Request::builder()
                .method(method)
                .uri(format!("http://127.0.0.1:{}/v1/recordings", stack.site.port))
                .header("Content-Type", "application/json");
            let body = body.map(|b| b.to_string()).unwrap_or_default();
            agent.run(request.body(body).unwrap()).unwrap().status().as_u16()
        };
        assert_eq!(record("POST", Some(json!({"name": "other", "thruster": "t2"}))), 201);
        let refused = |body: Value, status: u16, slug: &str| {
            let (answered, problem) = stack.http("POST", "/diagnoses", Some(body.clone())).unwrap();
            let slug = format!("urn:kort:problem:{slug}");
            assert_eq!((answered, &problem["type"]), (status, &json!(slug)), "{body}: {problem}");
            assert!(problem["hint"].is_string(), "{problem}");
        };
        refused(json!({"recording": "nowhere"}), 404, "unknown-recording");
        refused(json!({"recording": "../kort.toml"}), 404, "unknown-recording");
        refused(json!({"recording": "other"}), 409, "refused");
        refused(json!({"recording": "other", "last_s": 5}), 422, "invalid-field");
        refused(json!({"last_s": 0}), 422, "out-of-range");
        refused(json!({"last_s": "long"}), 422, "invalid-field");
        refused(json!({"last_s": 60, "model": "model9"}), 422, "out-of-range");
        refused(json!({"last_s": 60, "with": ["magic"]}), 422, "out-of-range");
        refused(json!({"minutes": 5}), 422, "invalid-field");
        assert_eq!(record("DELETE", None), 200);
        assert_eq!(record("POST", Some(json!({"name": "mine", "thruster": "t1"}))), 201);
        refused(json!({"recording": "mine"}), 409, "recording-active");
        assert_eq!(stack.http("GET", "/diagnoses/t1-none", None).unwrap().0, 404);
        assert_eq!(stack.http("DELETE", "/diagnoses/t1-none", None).unwrap().0, 404);
        assert_eq!(stack.expect("GET", "/diagnoses", None), json!([]));
    });
    // Nothing was ever heard of the thruster: there is nothing to diagnose.
    let site = Site::new();
    let mut gateway = site.spawn("gateway");
    let answer = wait("an answer", || {
        let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
        let url = format!("http://127.0.0.1:{}/v1/thrusters/t1/diagnoses", site.port);
        let mut answer = agent.post(url).send_empty().ok()?;
        serde_json::from_str::<Value>(&answer.body_mut().read_to_string().ok()?).ok()
    });
    kill(gateway.id(), "TERM");
    let _ = gateway.wait();
    assert_eq!(answer["type"], "urn:kort:problem:no-recording", "{answer}");
}

/// The first hour as a stranger has it: a secret in the stand, found, used, and thrust that comes nearer to what is asked.
#[test]
fn the_tutorial_goes_as_it_says() {
    common::in_real_time(|| {
        let said = pages::follow("docs/tutorial.md", Site::new().port);
        let error = |when: &str| pages::number_after(&said, &format!("thrust error {when}:"));
        let (before, after) = (error("before"), error("after"));
        // Most of it are the steps of the signal, which no thrust follows at once.
        assert!(after < 0.95 * before, "{after} N after, {before} N before");
    });
}

#[test]
fn the_readmes_commands_work() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let said = pages::follow("README.md", stack.site.port);
        for shown in [
            "\"expires_in_ms\"",
            "kort_armed{thruster=\"t1\"} 1",
            "NO MISMATCH",
            "lift_max",
            "coulomb_friction",
        ] {
            assert!(said.contains(shown), "nothing shows {shown}:\n{said}");
        }
    });
}
