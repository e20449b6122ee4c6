//! What a deployment states: all that is wrong with it is said at once, and the law that runs where none is stated.

use serde_json::Value;

use crate::common::{self, Site, Stack, run, wait};

/// What `kort check` says of a deployment in which these were replaced.
fn check(changes: &[(&str, &str)]) -> (Vec<Value>, String) {
    let site = Site::new();
    let mut text = std::fs::read_to_string(site.config()).unwrap();
    for (from, to) in changes {
        assert!(text.contains(from), "{from} is not in {text}");
        text = text.replacen(from, to, 1);
    }
    std::fs::write(site.config(), text).unwrap();
    let of = |more: &[&str]| {
        let out = run(std::process::Command::new(common::KORT).arg("check").args(more).arg(site.config()));
        assert_eq!(out.status.code(), Some(2), "{}", String::from_utf8_lossy(&out.stdout));
        String::from_utf8(out.stdout).unwrap()
    };
    let report: Value = serde_json::from_str(&of(&["--json"])).unwrap();
    (report["problems"].as_array().unwrap().clone(), of(&[]))
}

/// Unknown keys, wrong types and wrong values hide none of each other, in whatever section, and none is told twice.
#[test]
fn no_mistake_hides_another() {
    let (problems, words) = check(&[
        (
            "[gateway]",
            "[gateway]\nhosst = []\nrequire_tokens = 3\nrecording = { files_max = 0, file_max = 1 }",
        ),
        ("rate_hz = 500", "rate_hz = 500, rat = 3, priority = \"high\""),
        ("law = \"velocity_servo\"", "law = \"\", sped = 1"),
        ("full_drive_s = 0.005", "current_a = 1e6, temperature_c = -300, full_drive = 1"),
        (
            "amplifier = \"simulated\"",
            "amplifier = \"simulated\"\nsimulation = { sead = 3, ambient_m_s = 99 }",
        ),
        ("[thrusters.t1]", "[transport]\nrot = \"\"\n[thrusters.t1]"),
    ]);
    let mut keys: Vec<&str> = problems.iter().map(|problem| problem["key"].as_str().unwrap()).collect();
    keys.sort_unstable();
    let wrong = [
        "gateway.hosst",
        "gateway.recording.file_max",
        "gateway.recording.files_max",
        "gateway.require_tokens",
        "thrusters.t1.controller.law",
        "thrusters.t1.controller.sped",
        "thrusters.t1.limits.current_a",
        "thrusters.t1.limits.full_drive",
        "thrusters.t1.limits.temperature_c",
        "thrusters.t1.servo.priority",
        "thrusters.t1.servo.rat",
        "thrusters.t1.simulation.ambient_m_s",
        "thrusters.t1.simulation.sead",
        "transport.rot",
    ];
    assert_eq!(keys, wrong, "{words}");
    assert!(problems.iter().all(|problem| problem["hint"].is_string()), "{problems:?}");
    for near in ["`hosts`", "`full_drive_s`", "`seed`", "`root`"] {
        assert!(words.contains(&format!("did you mean {near}?")), "{near}: {words}");
    }
    let law = problems.iter().find(|problem| problem["key"] == "thrusters.t1.controller.law").unwrap();
    assert!(law["allowed"].as_str().is_some_and(|laws| laws.contains("velocity_servo")), "{law}");
}

/// Without rig and drive the rest is told too, and each of them once.
#[test]
fn what_is_missing_hides_nothing_and_is_told_once() {
    let (problems, words) = check(&[
        ("rig = ", "rigg = "),
        ("amplifier = \"simulated\"\n", ""),
        ("rate_hz = 500", "rate_hz = 500, rat = 3"),
        ("[gateway]", "[gateway]\nhosst = []"),
    ]);
    let mut keys: Vec<&str> = problems.iter().map(|problem| problem["key"].as_str().unwrap()).collect();
    keys.sort_unstable();
    let wrong = ["gateway.hosst", "thrusters.t1.amplifier", "thrusters.t1.rigg", "thrusters.t1.servo.rat"];
    assert_eq!(keys, wrong, "{words}");
}

/// The parameters that an effect lacks are told together, without a unit where there is none; a name that is like no
/// other is answered by those there are.
#[test]
fn what_an_effect_lacks_is_told_together() {
    let with = |effect: &str| {
        let simulation = format!("amplifier = \"simulated\"\nsimulation = {{ effects = [{effect}] }}");
        check(&[("amplifier = \"simulated\"", &simulation)]).1
    };
    let words = with("{ id = \"command_dead_band\" }");
    for name in ["half_width", "centre", "kept_outside"] {
        assert_eq!(words.matches(&format!("effects[0].{name}`")).count(), 1, "{words}");
    }
    assert!(words.contains("0 to 1, for example"), "{words}");
    let words = with("{ id = \"command_dead_band\", dead_band = 0.1 }");
    assert!(!words.contains("did you mean") && words.contains("known are "), "{words}");
}

/// Where no law is stated, and where the default is asked for, the law of `kort explain --for` runs and is shown.
#[test]
fn the_default_law_is_the_one_that_the_explanation_names() {
    let rig = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/whitcomb-yoerger-1999.toml");
    let out = run(std::process::Command::new(common::KORT).args(["explain", "--json", "--for", rig]));
    let advised: Value = serde_json::from_slice(&out.stdout).unwrap();
    common::in_real_time(|| {
        for law in ["", ", law = \"default\""] {
            let site = Site::new();
            let text = std::fs::read_to_string(site.config()).unwrap();
            std::fs::write(site.config(), text.replace(", law = \"velocity_servo\"", law)).unwrap();
            let out = run(std::process::Command::new(common::KORT).arg("check").arg(site.config()));
            assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stdout));
            let stack = Stack::start_at(site);
            let runs = wait("the controller", || stack.state()?["controller"].as_str().map(str::to_owned));
            assert_eq!(runs, advised["controller"]["law"].as_str().unwrap(), "{law:?}");
        }
    });
}
