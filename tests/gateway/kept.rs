//! What an engineer keeps: tags on recordings, and the tuned controller as a file.

use serde_json::json;

use crate::asking::{JSON, assert_problem, send};
use crate::common::{self, Stack, wait};

#[test]
fn recordings_are_tagged_while_they_run_and_after_and_found_by_it() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        for (name, body) in
            [("one", json!({"name": "one", "tags": ["bollard", "bollard"]})), ("two", json!({"name": "two"}))]
        {
            let begun = send(port, "POST", "/v1/recordings", &[JSON], body.to_string().as_bytes());
            assert_eq!(begun.status, 201, "{name}: {}", begun.text());
        }
        let tag = |name: &str, tags: &[&str]| {
            let body = json!({ "tags": tags }).to_string();
            send(port, "PATCH", &format!("/v1/recordings/{name}"), &[JSON], body.as_bytes())
        };
        let names = |tag: &str| {
            let list = send(port, "GET", &format!("/v1/recordings?tag={tag}"), &[], b"").json();
            list.as_array()
                .unwrap()
                .iter()
                .map(|one| one["name"].as_str().unwrap().into())
                .collect::<Vec<String>>()
        };
        assert_eq!(names("bollard"), ["one"]);
        assert_eq!(tag("two", &["tow", "new-propeller"]).json()["tags"], json!(["tow", "new-propeller"]));
        wait("rows in both", || {
            let list = stack.get("/v1/recordings")?;
            list.as_array()?.iter().all(|one| one["rows"].as_u64() > Some(2)).then_some(())
        });
        for name in ["one", "two"] {
            let done = send(port, "DELETE", &format!("/v1/recordings/{name}"), &[], b"");
            assert_eq!(done.status, 200, "{}", done.text());
        }
        assert_eq!(names("tow"), ["two"], "what was given while it ran stays");
        assert_eq!(tag("one", &["tow"]).json()["state"], "complete");
        assert_eq!((names("tow"), names("bollard")), (vec!["one".into(), "two".into()], vec![]));
        for (name, tags) in [("one", "bollard"), ("two", "tow new-propeller")] {
            let file = stack.site.folder.path().join(format!("recordings/{name}.mcap"));
            let read = kort_recording::Recording::read(&file, None).unwrap();
            assert_eq!(read.about["tags"], tags, "the file itself has the tags of its end");
        }
        let kept = std::fs::read_to_string(stack.site.folder.path().join("recordings/one.json")).unwrap();
        assert!(kept.contains("\"tow\""), "on the disk: {kept}");
        assert_problem(&tag("one", &["no blank"]), 422, "out-of-range", "a blank");
        assert_problem(&tag("one", &["x"; 17]), 422, "out-of-range", "too many");
        assert_problem(&tag("three", &["tow"]), 404, "unknown-recording", "nothing of this name");
        assert_eq!(tag("one", &[]).json()["tags"], json!([]));
    });
}

/// What somebody moved away by hand is listed as gone, and the route says the same; moved back it is there again.
#[test]
fn a_recording_without_its_file_is_gone_in_list_and_route_alike() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        assert_eq!(send(port, "POST", "/v1/recordings", &[JSON], br#"{"name": "moved"}"#).status, 201);
        wait("rows", || stack.get("/v1/recordings")?[0]["rows"].as_u64().filter(|rows| *rows > 2));
        assert_eq!(send(port, "DELETE", "/v1/recordings/moved", &[], b"").status, 200);
        let listed = || send(port, "GET", "/v1/recordings", &[], b"").json()[0].clone();
        let file = stack.site.folder.path().join("recordings/moved.mcap");
        let away = stack.site.folder.path().join("away.mcap");
        std::fs::rename(&file, &away).unwrap();
        let gone = listed();
        assert_eq!((&gone["state"], &gone["bytes"]), (&json!("gone"), &json!({})), "{gone}");
        let why = gone["cause"].as_str().unwrap();
        assert!(why.contains("moved.mcap is not there"), "{gone}");
        for path in ["moved", "moved.csv", "moved/estimates"] {
            let refused = send(port, "GET", &format!("/v1/recordings/{path}"), &[], b"");
            assert_problem(&refused, 404, "unknown-recording", path);
            assert!(refused.text().contains(why), "{path}: {}", refused.text());
        }
        let tagged = send(port, "PATCH", "/v1/recordings/moved", &[JSON], br#"{"tags": ["tow"]}"#);
        assert_problem(&tagged, 404, "unknown-recording", "tags");
        std::fs::rename(&away, &file).unwrap();
        assert_eq!((&listed()["state"], &listed()["cause"]), (&json!("complete"), &json!(null)));
        assert_eq!(send(port, "GET", "/v1/recordings/moved", &[], b"").status, 200);
        std::fs::remove_file(&file).unwrap();
        assert_eq!(send(port, "DELETE", "/v1/recordings/moved", &[], b"").status, 204);
        assert_eq!(send(port, "GET", "/v1/recordings", &[], b"").json(), json!([]));
    });
}

/// Tuned, saved, put in force again, started with and soaked: one file.
#[test]
fn a_tuned_controller_is_saved_as_a_file_that_everything_takes() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let path = "/v1/thrusters/t1/controller";
        let shown = |name: &str| {
            let view = stack.get(path)?;
            let all = view["parameters"].as_array()?;
            all.iter().find(|parameter| parameter["name"] == name)?["value"].as_f64()
        };
        let tuned = json!({"controller": "trimmed_model2_inversion", "observer": "luenberger",
            "parameters": {"phase_margin_deg": 61.5, "trim_authority": 0.25}});
        stack.expect("PUT", "/controller", Some(tuned));
        wait("the parameters to be shown", || (shown("trim_authority") == Some(0.25)).then_some(()));
        let saved = send(port, "GET", &format!("{path}/file"), &[], b"");
        assert_eq!(saved.status, 200);
        assert!(saved.head.contains("t1-trimmed_model2_inversion.toml"));
        let text = saved.text();
        for line in ["observer = \"luenberger\"", "phase_margin_deg = 61.5", "authority = 0.25"] {
            assert!(text.lines().any(|l| l == line), "{line}: {text}");
        }
        stack.expect(
            "PUT",
            "/controller",
            Some(json!({"controller": "velocity_servo", "observer": "ekf",
            "parameters": {"phase_margin_deg": 50, "trim_authority": 0.1}})),
        );
        wait("other parameters", || (shown("trim_authority") == Some(0.1)).then_some(()));
        stack.expect("PUT", "/controller/file", Some(json!({ "toml": text })));
        wait("the file's parameters", || {
            let view = stack.get(path)?;
            (view["observer"] == "luenberger" && shown("phase_margin_deg") == Some(61.5)).then_some(())
        });
        let again = send(port, "GET", &format!("{path}/file"), &[], b"").text();
        let body = |text: &str| text.split_once('\n').unwrap().1.to_owned();
        assert_eq!(body(&again), body(&text), "nothing is lost on the way");
        // More parameters at once than a message holds.
        let keys = ["_s", "load_std", "thrust_std", "drag", "inertia", "horizon", "weight_k", "weight_r"];
        let grown = |line: &str| {
            let (key, value) = line.split_once(" = ")?;
            let value: f64 = keys.iter().any(|end| key.ends_with(end)).then(|| value.parse().ok())??;
            Some(format!("{key} = {:?}\n", 1.01 * value))
        };
        let many: Vec<String> =
            text.lines().map(|line| grown(line).unwrap_or_else(|| format!("{line}\n"))).collect();
        assert!(text.lines().filter_map(grown).count() > 16, "{text}");
        stack.expect("PUT", "/controller/file", Some(json!({ "toml": many.concat() })));
        wait("all of them", || {
            let now = send(port, "GET", &format!("{path}/file"), &[], b"").text();
            (body(&now) == body(&many.concat())).then_some(())
        });
        let put = |text: &str| {
            let body = json!({ "toml": text }).to_string();
            send(port, "PUT", &format!("{path}/file"), &[JSON], body.as_bytes())
        };
        for (text, words) in [
            ("law = \"velocity_servo\"\n[laws.servo]\nphase_margin_deg = 5\n", "30 to 85"),
            ("law = \"velocity_srevo\"", "velocity_servo"),
            ("[observers]\nuse_flow = false\n", "observers.use_flow"),
        ] {
            let refused = put(text);
            assert_problem(&refused, 422, "invalid-field", words);
            assert!(refused.text().contains(words), "{words}: {}", refused.text());
        }
        let file = stack.site.folder.path().join("tuned.toml");
        std::fs::write(&file, &text).unwrap();
        let soak = common::run(
            std::process::Command::new(common::KORT)
                .args(["soak", "soak-paper-experiments", "--seeds", "1", "--json"])
                .arg("--controllers")
                .arg(&file)
                .current_dir(env!("CARGO_MANIFEST_DIR")),
        );
        assert!(soak.status.success(), "{}", String::from_utf8_lossy(&soak.stderr));
        let config = std::fs::read_to_string(stack.site.config()).unwrap();
        let config = config.replace("law = \"velocity_servo\" }", "file = \"tuned.toml\" }");
        std::fs::write(stack.site.config(), config).unwrap();
        let checked =
            common::run(std::process::Command::new(common::KORT).arg("check").arg(stack.site.config()));
        assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
    });
}
