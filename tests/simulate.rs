//! `kort simulate` from outside: formats, seeds, shipped scenarios, errors and exit codes.

use std::path::Path;
use std::process::{Command, Output};

use kort_recording::{ColumnMap, Recording};

const RIG: &str = "whitcomb-yoerger-1999";

fn kort(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kort")).args(args).output().unwrap()
}

fn simulate(rig: &str, scenario: &str, output: &Path, more: &[&str]) -> Output {
    let mut args = vec!["simulate", "--rig", rig, "--scenario", scenario, "-o", output.to_str().unwrap()];
    args.extend(more);
    kort(&args)
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

fn good(output: &Output) {
    assert_eq!(output.status.code(), Some(0), "{}", stderr(output));
}

#[test]
fn every_shipped_scenario_runs() {
    let folder = tempfile::tempdir().unwrap();
    let mut seen = 0;
    for entry in std::fs::read_dir("config/scenarios").unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if name.starts_with("soak-") {
            continue;
        }
        let out = folder.path().join(format!("{name}.csv"));
        good(&simulate(RIG, &name, &out, &[]));
        let recording = Recording::read(&out, None).unwrap();
        assert!(recording.rows() > 400, "{name}: {} rows", recording.rows());
        let thrust = recording.column("thrust_n").unwrap();
        let peak = thrust.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        assert!((5.0..400.0).contains(&peak), "{name}: {peak} N");
        seen += 1;
    }
    assert!(seen >= 10, "{seen} scenarios");
}

/// What dies away is zero in the end, not the smallest number that there is.
#[test]
fn at_rest_a_recording_says_zero() {
    let folder = tempfile::tempdir().unwrap();
    let (scenario, out) = (folder.path().join("rest.toml"), folder.path().join("rest.csv"));
    let rest = "name = \"rest\"\nwhat = \"up, and to rest\"\ncommand = \"share\"\n\n[[segments]]\nkind = \"hold\"\nvalue = 0.5\nduration_s = 3.0\n\n\
        [[segments]]\nkind = \"hold\"\nvalue = 0.0\nduration_s = 200.0\n";
    std::fs::write(&scenario, rest).unwrap();
    for rig in ["speed-drive", "rosa-rotor", "tunnel-10kw"] {
        good(&simulate(rig, scenario.to_str().unwrap(), &out, &[]));
        let recording = Recording::read(&out, None).unwrap();
        for column in &recording.columns {
            let tiny = column.values.iter().find(|value| **value != 0.0 && value.abs() < 1e-30);
            assert_eq!(tiny, None, "{rig}: {}", column.name);
        }
        let speed = recording.column("shaft_speed_rad_s").unwrap();
        assert_eq!(speed.last(), Some(&0.0), "{rig}");
    }
}

#[test]
fn the_program_needs_no_folder_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_kort"))
        .args(["simulate", "--rig", RIG, "--scenario", "joystick-replay", "-o", "a.csv"])
        .current_dir(folder.path())
        .output()
        .unwrap();
    good(&output);
    // What went in is what the AUV was asked for.
    let out = Recording::read(&folder.path().join("a.csv"), None).unwrap();
    let map = ColumnMap::find("vortex-auv-pool").unwrap();
    let log = Recording::read(Path::new("tests/recordings/vortex-auv-pool-heave-1.csv"), Some(&map)).unwrap();
    let (asked, given) = (log.column("thrust_cmd_n").unwrap(), out.column("thrust_cmd_n").unwrap());
    for (i, wanted) in asked.iter().enumerate().take(1000) {
        assert!((given[10 * i] - wanted).abs() < 1e-9, "row {i}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_and_formats_agree() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    for (name, more) in [("a.csv", ["--seed", "7"]), ("b.csv", ["--seed", "7"]), ("c.csv", ["--seed", "8"])] {
        good(&simulate(RIG, "torque-step-9.2", &path(name), &more));
    }
    let bytes = |name: &str| std::fs::read(path(name)).unwrap();
    assert!(bytes("a.csv") == bytes("b.csv"));
    assert!(bytes("a.csv") != bytes("c.csv"));
    for name in ["a.mcap", "a.csv.gz"] {
        good(&simulate(RIG, "torque-step-9.2", &path(name), &["--seed", "7"]));
        let (a, b) =
            (Recording::read(&path("a.csv"), None).unwrap(), Recording::read(&path(name), None).unwrap());
        assert!(a.time_s == b.time_s);
        for column in &a.columns {
            let same = |x: &f64, y: &f64| x.to_bits() == y.to_bits();
            let other = b.column(&column.name).unwrap();
            assert!(column.values.iter().zip(other).all(|(x, y)| same(x, y)), "{name} {}", column.name);
        }
    }
}

/// The layout for Foxglove that is shipped for the service's recordings plots a simulation too.
#[test]
fn a_simulation_has_the_channel_of_a_services_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_string();
    good(&simulate(RIG, "torque-step-9.2", Path::new(&path("run.mcap")), &[]));
    good(&simulate(RIG, "torque-step-9.2", Path::new(&path("run.csv")), &[]));
    good(&kort(&["convert", &path("run.csv"), "-o", &path("converted.mcap")]));
    let layout = std::fs::read_to_string("docs/foxglove/kort.json").unwrap();
    for name in ["run.mcap", "converted.mcap"] {
        let found = kort_recording::survey(name, std::fs::File::open(path(name)).unwrap()).unwrap();
        let topics: Vec<&str> = found.topics.iter().map(|topic| topic.name.as_str()).collect();
        assert_eq!(topics, ["t1"], "{name}");
        let signals = ["current_cmd_a", "current_a", "shaft_speed_rad_s", "thrust_n", "flow_m_s"];
        for signal in signals {
            assert!(layout.contains(&format!("\"/t1.{signal}\"")), "{signal}");
        }
    }
}

#[test]
fn json_is_one_document_on_stdout() {
    let folder = tempfile::tempdir().unwrap();
    let output = simulate(RIG, "torque-step-9.2", &folder.path().join("a.mcap"), &["--json"]);
    good(&output);
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["schema"], "kort.simulate/1");
    assert_eq!(report["rows"], 501);
    assert!(!stderr(&output).contains('\x1b'), "no progress bar off a terminal: {}", stderr(&output));
}

#[test]
fn a_diagnosis_report_s_next_experiment_runs() {
    let folder = tempfile::tempdir().unwrap();
    let report = folder.path().join("report.json");
    let scenario = r#"{"name": "next", "command": "share", "segments": [{"kind": "reversals", "amplitude": 0.5, "each_s": 1, "count": 3}]}"#;
    std::fs::write(
        &report,
        format!(r#"{{"schema": "kort.diagnosis/1", "next_experiment": {{"scenario": {scenario}}}}}"#),
    )
    .unwrap();
    let out = folder.path().join("a.csv");
    good(&simulate(RIG, report.to_str().unwrap(), &out, &[]));
    assert_eq!(Recording::read(&out, None).unwrap().rows(), 401);
    std::fs::write(&report, r#"{"schema": "kort.diagnosis/1", "next_experiment": null}"#).unwrap();
    let output = simulate(RIG, report.to_str().unwrap(), &out, &[]);
    assert_eq!(output.status.code(), Some(2));
    assert!(stderr(&output).contains("next_experiment"));
}

#[test]
fn errors_are_usage_errors_with_a_hint_and_leave_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("a.csv");
    let scenario = folder.path().join("s.toml");
    let step = "[[segments]]\nkind = \"hold\"\nvalue = 0.5\nduration_s = 1\n";
    for (text, words) in [
        ("", "segments"),
        ("segments = []", "`segments` is missing"),
        (&format!("commnad = \"share\"\n{step}"), "commnad"),
        (&format!("command = \"thrust\"\n{step}"), "thrust_cmd_n"),
        (&format!("command = \"voltage_cmd_v\"\n{step}"), "current_cmd_a"),
        (&format!("duration_s = -1\n{step}"), "-1"),
        (&format!("{step}[[effects]]\neffect = \"coulomb\""), "coulomb_friction"),
        ("[[segments]]\nkind = \"hold\"\nvalue = nan\nduration_s = 1", "segments[0].value"),
        ("[[segments]]\nkind = \"replay\"\nrecording = \"none.csv\"\ncolumn = \"thrust_cmd_n\"", "none.csv"),
        ("{\"segments\": 3}", "segments"),
        (&format!("{step}{}", step.replace("0.5", "\"big\"")), "`segments[1].value` = \"big\""),
        (
            "{\"segments\": [{\"kind\": \"hold\", \"value\": \"big\", \"duration_s\": 1}]}",
            "expected a number",
        ),
    ] {
        std::fs::write(&scenario, text).unwrap();
        let output = simulate(RIG, scenario.to_str().unwrap(), &out, &[]);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{text}: {said}");
        assert!(said.contains(words) && said.contains("s.toml") && said.contains("hint:"), "{text}: {said}");
        assert!(output.stdout.is_empty() && !out.exists());
    }
    for (rig, scenario, out, words) in [
        ("whitcomb", "staircase", out.as_path(), "whitcomb-yoerger-1999"),
        (RIG, "stair", out.as_path(), "staircase"),
        (RIG, "staircase", Path::new("a.xlsx"), ".mcap"),
    ] {
        let output = simulate(rig, scenario, out, &[]);
        assert_eq!(output.status.code(), Some(2));
        assert!(stderr(&output).contains(words) && stderr(&output).contains("hint:"), "{}", stderr(&output));
    }
    let output = simulate(RIG, "torque-step-9.2", Path::new("/nonexistent/a.csv"), &[]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    let output = simulate(RIG, "soak-towed", &out, &[]);
    assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
    assert!(stderr(&output).contains("hint: kort soak soak-towed"), "{}", stderr(&output));
    for (option, value, words) in
        [("--noise", "nan", "--noise NaN"), ("--noise", "-1", "--noise -1"), ("--seed", "-1", "0 or above")]
    {
        let output = simulate(RIG, "staircase", &out, &[option, value]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(words) && stderr(&output).contains("hint:"), "{}", stderr(&output));
    }
}

#[test]
fn help_has_an_example() {
    let output = kort(&["simulate", "--help"]);
    good(&output);
    assert!(String::from_utf8_lossy(&output.stdout).contains("Example: kort simulate"));
}
