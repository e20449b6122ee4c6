//! `kort fit` from outside, and input that neither `fit` nor `diagnose` can use.

#[path = "common/lab.rs"]
mod lab;

use std::io::Write;
use std::path::Path;

use lab::{STAND, Table, clean, dry_rig, json, kort, path, random_levels, simulate, stderr, swirl, write};
use serde_json::Value;

fn fit(recordings: &[&str], rig: &str, more: &[&str]) -> Value {
    let mut args = vec!["fit"];
    args.extend(recordings);
    args.extend(["--rig", rig, "--json"]);
    args.extend(more);
    let report = json(&kort(&args));
    assert_eq!(report["schema"], "kort.fit/1");
    assert!(report["model"].is_string());
    lab::check_parameters("parameters", &report["parameters"]);
    lab::check_channels("channels", &report["channels"]);
    for group in report["not_identifiable"].as_array().expect("not_identifiable") {
        assert!(!group["parameters"].as_array().expect("names").is_empty());
        assert!(group["why"].is_string() && group["excitation"].is_string(), "{group}");
    }
    report
}

fn parameter<'a>(report: &'a Value, name: &str) -> &'a Value {
    let all = report["parameters"].as_array().unwrap();
    all.iter().find(|p| p["name"] == name).unwrap_or_else(|| panic!("{name} is not fitted"))
}

#[test]
fn the_true_parameters_come_back_within_their_standard_errors() {
    let truth = "parameters = { lift_max = 0.60, inertia_kg_m2 = 0.0115, flux_coefficient = 1.7 }";
    let file = simulate("other.csv", STAND, &random_levels(-0.95, 0.95, truth));
    let report = fit(&[&file], STAND, &[]);
    for (name, truth) in [("lift_max", 0.60), ("inertia_kg_m2", 0.0115), ("flux_coefficient", 1.7)] {
        let (value, std) = (&parameter(&report, name)["value"], &parameter(&report, name)["std_error"]);
        let off = value.as_f64().unwrap() - truth;
        assert!(
            off.abs() < 5.0 * std.as_f64().unwrap() && off.abs() < 0.03 * truth,
            "{name}: {value} of {truth}"
        );
    }
}

#[test]
fn a_fitted_rig_is_a_rig_and_states_what_was_found() {
    let out = path("fitted.toml");
    let output = kort(&["fit", clean(), "--rig", STAND, "-o", &out]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(String::from_utf8_lossy(&output.stdout).contains("lift_max"));
    let text = std::fs::read_to_string(&out).unwrap();
    assert!(text.contains("tol"), "{text}");
    let again = fit(&[clean()], &out, &[]);
    let lift = parameter(&again, "lift_max")["stated"].as_f64().unwrap();
    assert!((lift - 0.542).abs() < 0.01, "{lift}");
}

/// Effects that were fitted stand in the fitted rig; what is stated of one as exact was held, and stays with its own words.
#[test]
fn a_fitted_rig_has_the_effects_that_were_fitted() {
    let (first, second) = (path("with-effect.toml"), path("with-effect-again.toml"));
    let output = kort(&["fit", swirl(), "--rig", STAND, "--with", "rotational_flow", "-o", &first]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = std::fs::read_to_string(&first).unwrap();
    assert!(text.contains("effect = \"rotational_flow\"\nswirl_yield = { value = 0."), "{text}");
    let held = "swirl_lag_ratio = 0.08 # by hand";
    let lines: Vec<&str> =
        text.lines().map(|line| if line.starts_with("swirl_lag_ratio") { held } else { line }).collect();
    std::fs::write(&first, lines.join("\n")).unwrap();
    let output = kort(&["fit", swirl(), "--rig", &first, "-o", &second]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = std::fs::read_to_string(&second).unwrap();
    assert!(text.contains(held) && text.contains("# 1, fitted by kort fit"), "{text}");
    assert_eq!(text.matches("[[effects]]").count(), 1, "{text}");
    let swirl = text.lines().find(|line| line.starts_with("swirl_yield")).unwrap();
    assert!(swirl.contains("tol") && swirl.ends_with("fitted by kort fit"), "{swirl}");
}

#[test]
fn bytes_depend_on_input_and_seed_alone() {
    let run = |more: &[&str]| {
        let mut args = vec!["fit", clean(), "--rig", STAND, "--json"];
        args.extend(more);
        let output = kort(&args);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        output.stdout
    };
    let one = run(&["--jobs", "1", "--seed", "3"]);
    assert!(one == run(&["--jobs", "2", "--seed", "3"]) && one == run(&["--seed", "3"]));
}

#[test]
fn every_model_and_a_dry_shaft_are_fitted() {
    for (model, name) in [
        ("model0", "thrust_coefficient_n_s2"),
        ("model1", "efficiency"),
        ("model2", "drag_max"),
        ("model3", "drag_max"),
        ("rotational_flow", "swirl_flux_coefficient"),
    ] {
        let report = fit(&[clean()], STAND, &["--model", model, "--starts", "1"]);
        assert_eq!(report["model"], model);
        parameter(&report, name);
    }
    let dry = simulate("dry.csv", dry_rig(), &random_levels(-0.9, 0.9, ""));
    let report = fit(&[&dry], dry_rig(), &["--starts", "1"]);
    let friction = parameter(&report, "viscous_friction_nm_s")["value"].as_f64().unwrap();
    assert!((friction - 0.05).abs() < 0.002, "{friction}");
    // A value that is fitted without a prior states nothing.
    let free = fit(&[clean()], STAND, &["--free-friction", "--starts", "1"]);
    assert!(parameter(&free, "viscous_friction_nm_s")["stated"].is_null());
}

#[test]
fn what_a_recording_cannot_fix_is_said() {
    // Speed alone: torque, inertia and flow may all be scaled together.
    let file = Table::read(clean()).keep(&["time_s", "current_cmd_a", "shaft_speed_rad_s"]).save("speed.csv");
    let report = fit(&[&file], STAND, &["--starts", "1"]);
    assert!(!report["not_identifiable"].as_array().unwrap().is_empty(), "{report}");
}

/// Runs both commands; the message holds the words, a hint and no panic; nothing is left behind.
fn refused(label: &str, recording: &str, rig: &str, more: &[&str], words: &[&str]) {
    // Each case has its own: tests run side by side, and whether a file can be written is tried by making it.
    let own: String = label.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    let (page, fitted) = (path(&format!("bad_{own}.html")), path(&format!("bad_{own}.toml")));
    for (command, flag, out) in [("diagnose", "--html", &page), ("fit", "-o", &fitted)] {
        let mut args = vec![command, recording, "--rig", rig, "--json", flag, out];
        args.extend(more);
        let output = kort(&args);
        let said = stderr(&output);
        assert_eq!(output.status.code(), Some(2), "{command} {label}: {said}");
        assert!(output.stdout.is_empty(), "{command} {label}: talk on stdout");
        assert!(!said.contains("panicked") && said.contains("hint:"), "{command} {label}: {said}");
        for word in words {
            assert!(said.contains(word), "{command} {label}: `{word}` is missing in: {said}");
        }
        assert!(!Path::new(out).exists(), "{command} {label}: a file is left behind");
    }
}

#[test]
fn recordings_that_no_model_can_be_compared_with() {
    let table = || Table::read(clean());
    let time = |name: &str, change: &dyn Fn(f64) -> f64| {
        table().map("time_s", |_, t| change(t.parse().unwrap()).to_string()).save(name)
    };
    let cells = |name: &str, column: &str, change: &dyn Fn(usize, &str) -> String| {
        table().map(column, change).save(name)
    };
    let keep = |name: &str, columns: &[&str]| table().keep(columns).save(name);
    let mut few = table();
    few.rows.truncate(10);
    let cases: Vec<(String, &[&str])> = vec![
        (write("empty.csv", ""), &["empty.csv", "empty"]),
        (
            write("garbage.csv", (0..4096u32).map(|i| (i * 7919 % 251) as u8).collect::<Vec<_>>()),
            &["garbage.csv"],
        ),
        (write("garbage.mcap", b"\x89MCAP0\r\n\x01\x02\x03\x04"), &["garbage.mcap"]),
        (write("foreign.csv", "t,rpm,I\n0,1,2\n1,2,3\n"), &["foreign.csv", "time_s"]),
        (write("no-unit.csv", "time_s,current_cmd_a,speed\n0,1,2\n1,2,3\n"), &["speed", "column map"]),
        (
            cells("nan.csv", "thrust_n", &|k, v| if k == 7 { "NaN".into() } else { v.into() }),
            &["line 9", "thrust_n"],
        ),
        (time("back.csv", &|t| if t > 6.0 { t - 3.0 } else { t }), &["time_s", "strictly increasing"]),
        (time("far.csv", &|t| 2000.0 * t), &["far.csv", "gap", "20000"]),
        (time("nanoseconds.csv", &|t| t * 1e9), &["nanoseconds.csv", "seconds"]),
        (time("too-fast.csv", &|t| t * 1e-9), &["too-fast.csv", "seconds"]),
        (cells("huge.csv", "thrust_n", &|_, _| "1e300".into()), &["thrust_n", "1e300"]),
        (keep("no-drive.csv", &["time_s", "thrust_n", "flow_m_s"]), &["no driving column", "current_cmd_a"]),
        (keep("no-response.csv", &["time_s", "current_cmd_a"]), &["no measured response", "thrust_n"]),
        (few.save("few.csv"), &["10 rows"]),
        (path("missing.csv"), &["missing.csv"]),
        (empty_folder(), &["folder"]),
    ];
    for (file, words) in &cases {
        refused(file, file, STAND, &[], words);
    }
    let flat = table();
    let rest: Vec<String> = flat.header[1..].to_vec();
    let flat = rest.iter().fold(flat, |t, column| t.map(column, |_, _| "0".into())).save("flat.csv");
    let told = json(&kort(&["diagnose", &flat, "--rig", STAND, "--json"]));
    assert_eq!(told["verdict"], "insufficient_data", "at rest is an answer, and no broken log: {told}");
    assert!(told["summary"].as_str().unwrap().contains("nothing moves"), "{told}");
    refused("unknown map", clean(), STAND, &["--columns", "rosa"], &["rosa-rotor-air"]);
    refused(
        "map without unit",
        clean(),
        STAND,
        &["--columns", &map_without_unit()],
        &["`columns.thrust_n.unit` is missing"],
    );
}

fn empty_folder() -> String {
    let folder = path("empty-folder");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// A logger that begins a file at each reset: what holds too little is named, the rest is read, and the exit code says so.
#[test]
fn a_folder_of_a_logger_that_was_reset() {
    let folder = path("resets");
    std::fs::create_dir_all(&folder).unwrap();
    let whole = std::fs::read_to_string(clean()).unwrap();
    let first = |lines: usize| whole.lines().take(lines).map(|line| format!("{line}\n")).collect::<String>();
    let files = [
        ("1.csv", first(1)),
        ("2.csv", whole.clone()),
        ("3.csv", first(2)),
        ("4.csv", String::new()),
        ("5.csv", "time_".into()),
    ];
    for (name, text) in &files {
        std::fs::write(format!("{folder}/{name}"), text).unwrap();
    }
    std::fs::write(format!("{folder}/notes.txt"), "pool, 3 m").unwrap();
    let one = |name: &str| format!("{folder}/{name}");
    let named = [one("1.csv"), one("2.csv"), one("3.csv"), one("4.csv")];
    let named: Vec<&str> = named.iter().map(String::as_str).collect();
    for (given, skipped) in [
        (&[folder.as_str()][..], &["1.csv", "3.csv", "4.csv", "5.csv"][..]),
        (&named, &["1.csv", "3.csv", "4.csv"]),
    ] {
        let out = kort(&[&["fit"], given, &["--rig", STAND, "--json", "--starts", "1"]].concat());
        let said = stderr(&out);
        assert_eq!(out.status.code(), Some(3), "{said}");
        let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        for name in skipped {
            let words = report["notes"].as_array().unwrap().iter().filter_map(|note| note.as_str());
            let mut told = words.filter(|note| note.contains(&one(name)) && note.contains("passed over"));
            assert!(told.next().is_some() && said.contains(&one(name)), "{name}: {said} {}", report["notes"]);
        }
        assert!(!said.contains("notes.txt"), "{said}");
    }
    std::fs::remove_file(one("2.csv")).unwrap();
    refused("none to be read", &folder, STAND, &[], &["none of 4 files", "1.csv", "tail -qn +2"]);
}

fn map_without_unit() -> String {
    let text = "[time]\nsource = \"time_s\"\nunit = \"s\"\n[columns.thrust_n]\nsource = \"thrust_n\"\n";
    write("no-unit-map.toml", text)
}

#[test]
fn rigs_that_cannot_be_read() {
    let good = std::fs::read_to_string("config/thrusters/whitcomb-yoerger-1999.toml").unwrap();
    for (from, to, words) in [
        ("radius_m", "raduis_m", &["propeller.raduis_m", "did you mean `radius_m`"][..]),
        ("[motor]", "[motro]", &["motro", "motor"]),
        ("= { value = 0.542, tol = 0.15 } ", "= \"x\" ", &["propeller.lift_max", "\"x\""]),
        ("= 0.542, ", "= nan, ", &["propeller.lift_max", "NaN"]),
        ("value = 9.0,", "value = -9.0,", &["amplifier.current_limit_a", "-9"]),
        ("inertia_kg_m2 = { value = 0.01, tol = 0.5 } ", "", &["inertia_kg_m2"]),
        ("[rig]", "[rig", &["bad.rig.toml"]),
    ] {
        assert!(good.contains(from), "{from}");
        let rig = write("bad.rig.toml", good.replacen(from, to, 1));
        refused(to, clean(), &rig, &[], words);
    }
    refused("no such rig", clean(), "whitcomb", &[], &["whitcomb-yoerger-1999"]);
}

#[test]
fn wrong_usage_and_outputs_that_cannot_be_written() {
    for command in ["fit", "diagnose"] {
        let usage: [&[&str]; 4] = [
            &[command],
            &[command, clean()],
            &[command, clean(), "--rig", STAND, "--model", "model9"],
            &[command, clean(), "--rig", STAND, "--jobs", "0"],
        ];
        for args in usage {
            let output = kort(args);
            assert_eq!(output.status.code(), Some(2), "{args:?}: {}", stderr(&output));
            assert!(output.stdout.is_empty());
        }
        let flag = if command == "fit" { "-o" } else { "--html" };
        let output = kort(&[command, clean(), "--rig", STAND, flag, "/nonexistent/out.toml"]);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains("/nonexistent/out") && stderr(&output).contains("hint:"));
        let help = kort(&[command, "--help"]);
        let help = String::from_utf8(help.stdout).unwrap();
        let example = help.split_once("Example:").map(|(_, e)| e.to_string()).unwrap_or_default();
        assert!(example.contains(&format!("kort {command} tests/recordings/example-cases/")), "{help}");
        for word in example.split_whitespace().filter(|w| w.starts_with("tests/")) {
            assert!(Path::new(env!("CARGO_MANIFEST_DIR")).join(word).is_file(), "{word} is not shipped");
        }
    }
}

#[test]
fn a_torn_recording_is_used_as_far_as_it_goes() {
    let mut bytes = std::fs::read(clean()).unwrap();
    bytes.truncate(bytes.len() * 9 / 10);
    while bytes.last() != Some(&b'\n') {
        bytes.pop();
    }
    bytes.extend_from_slice(b"9");
    let torn = write("torn.csv", bytes);
    let output = kort(&["fit", &torn, "--rig", STAND, "--json", "--starts", "1"]);
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(report["notes"].to_string().contains("torn.csv"), "{}", report["notes"]);
}

#[test]
fn fifty_megabytes_too_long_to_compare_are_refused() {
    let file = path("large.csv");
    let mut out = std::io::BufWriter::new(std::fs::File::create(&file).unwrap());
    writeln!(out, "time_s,current_cmd_a,shaft_speed_rad_s").unwrap();
    for i in 0..2_200_000_u32 {
        writeln!(out, "{:.2},{},{}.0001", f64::from(i) * 0.01, i / 100 % 7, i % 60).unwrap();
    }
    out.flush().unwrap();
    drop(out);
    let output = kort(&["fit", &file, "--rig", STAND, "--json"]);
    let said = stderr(&output);
    assert_eq!(output.status.code(), Some(2), "{said}");
    assert!(said.contains("large.csv") && said.contains("20000 s") && said.contains("hint:"), "{said}");
}
