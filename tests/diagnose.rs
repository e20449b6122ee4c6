//! `kort diagnose` from outside: verdicts on known recordings, the report's contract, what it may
//! be given.

#[path = "common/lab.rs"]
mod lab;

use std::sync::OnceLock;

use lab::{STAND, Table, clean, dry_rig, effect, json, kort, path, random_levels, simulate, stderr, swirl};
use serde_json::Value;

/// Diagnoses; the report keeps its contract.
fn diagnose(recordings: &[&str], rig: &str, more: &[&str]) -> Value {
    let mut args = vec!["diagnose"];
    args.extend(recordings);
    args.extend(["--rig", rig, "--json"]);
    args.extend(more);
    let report = json(&kort(&args));
    lab::check_diagnosis(&report);
    report
}

/// The effects found, best first.
fn found(report: &Value) -> Vec<&str> {
    report["findings"].as_array().unwrap().iter().map(|f| f["effect"].as_str().unwrap()).collect()
}

/// A rig and a recording in which pure delay, lag and clock skew look alike: one slow sine.
fn slow_sine() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| {
        let sine = "command = \"share\"\n[[segments]]\nkind = \"sine\"\namplitude = 0.7\nfrequency_hz = 0.3\nduration_s = 12\n";
        let whole = simulate("sine.csv", STAND, &(sine.to_string() + &effect("transport_delay", "delay_s = 0.012")));
        let columns = ["time_s", "current_cmd_a", "shaft_speed_rad_s", "thrust_n"];
        let few = Table::read(&whole).keep(&columns).save("sine-few.csv");
        diagnose(&[&few], STAND, &[])
    })
}

#[test]
fn the_example_cases_get_their_answers() {
    for (name, verdict, effects) in [
        ("clean", "no_mismatch", vec![]),
        ("coulomb-friction", "explained", vec!["coulomb_friction"]),
        ("rotational-flow", "explained", vec!["rotational_flow"]),
    ] {
        let [recording, rig] = lab::example(name).map(|p| p.to_str().unwrap().to_string());
        let report = diagnose(&[&recording], &rig, &[]);
        assert_eq!(report["verdict"], verdict, "{name}: {}", report["summary"]);
        assert_eq!(found(&report), effects, "{name}");
        if let Some(finding) = report["findings"].as_array().unwrap().first() {
            assert!(finding["heldout"]["excess_error_removed"].as_f64().unwrap() > 0.75, "{finding}");
        }
    }
}

#[test]
fn bytes_depend_on_input_and_seed_alone() {
    let run = |more: &[&str]| {
        let mut args = vec!["diagnose", swirl(), "--rig", STAND, "--json"];
        args.extend(more);
        let output = kort(&args);
        // Off a terminal no bar; a slow machine may see the plain lines of progress.
        let said = stderr(&output);
        assert!(said.lines().all(|line| line.ends_with(" so far")) && !said.contains('\x1b'), "{said}");
        lab::check_diagnosis(&json(&output));
        output.stdout
    };
    let one = run(&["--jobs", "1", "--seed", "7"]);
    assert!(one == run(&["--jobs", "2", "--seed", "7"]), "--jobs changes the bytes");
    assert!(one == run(&["--seed", "7"]), "the same seed changes the bytes");
    assert_eq!(serde_json::from_slice::<Value>(&one).unwrap()["seed"], 7);
}

#[test]
fn text_and_page_say_what_the_json_says() {
    let page = path("swirl.html");
    let output = kort(&["diagnose", swirl(), "--rig", STAND, "--html", &page]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = String::from_utf8(output.stdout).unwrap();
    let page = std::fs::read_to_string(page).unwrap();
    for told in [&text, &page] {
        assert!(told.contains("rotational flow") || told.contains("rotational_flow"), "{told}");
        assert!(told.contains(STAND));
    }
    assert!(
        page.starts_with("<!DOCTYPE html>") && page.trim_end().ends_with("</html>") && page.contains("<svg")
    );
    for loads in ["src=\"http", "href=\"http", "url(http", "@import", "<script src", "<link"] {
        assert!(!page.contains(loads), "the page loads something: {loads}");
    }
}

#[test]
fn several_recordings_are_judged_together() {
    let other = simulate("clean-2.csv", STAND, &random_levels(-0.9, 0.9, "seed = 5"));
    let report = diagnose(&[clean(), &other], STAND, &[]);
    assert_eq!(report["verdict"], "no_mismatch", "{}", report["summary"]);
    assert_eq!(report["recordings"].as_array().unwrap().len(), 2);
    assert_eq!(report["seconds"], 25.0);
    let twice = kort(&["diagnose", clean(), clean(), "--rig", STAND]);
    assert_eq!(twice.status.code(), Some(2));
    assert!(stderr(&twice).contains("twice"), "{}", stderr(&twice));
}

#[test]
fn optional_columns_may_be_missing_and_others_may_drive() {
    let cases: &[(&str, &[&str], &str)] = &[
        ("speed-alone", &["current_cmd_a", "shaft_speed_rad_s"], "current_cmd_a"),
        ("flow-alone", &["current_cmd_a", "flow_m_s"], "current_cmd_a"),
        ("thrust-alone", &["current_cmd_a", "thrust_n"], "current_cmd_a"),
        ("measured-current", &["current_a", "shaft_speed_rad_s", "thrust_n", "flow_m_s"], "current_a"),
        ("measured-speed", &["shaft_speed_rad_s", "thrust_n", "flow_m_s"], "shaft_speed_rad_s"),
    ];
    for (name, columns, driving) in cases {
        let columns: Vec<&str> = std::iter::once("time_s").chain(columns.iter().copied()).collect();
        let file = Table::read(swirl()).keep(&columns).save(&format!("{name}.csv"));
        let report = diagnose(&[&file], STAND, &[]);
        // One response alone may show too little of it: no name is no error, another name is.
        let names = found(&report);
        let silent = columns.len() == 3 && names.is_empty();
        let first = names.first().copied();
        assert!(silent || first == Some("rotational_flow"), "{name}: {}", report["summary"]);
        assert!(report["baseline"]["channels"].get(driving).is_none(), "{name}: {driving} drives");
    }
}

#[test]
fn a_dry_shaft_has_no_blades_to_blame() {
    let scenario = random_levels(-0.95, 0.95, "");
    let report = diagnose(&[&simulate("dry.csv", dry_rig(), &scenario)], dry_rig(), &[]);
    assert_eq!(report["verdict"], "no_mismatch", "{}", report["summary"]);
    let friction = "coulomb_torque_n_m = 0.3, stribeck_rise = 0.3, stribeck_speed_rad_s = 2";
    let rubbing = simulate("dry-rub.csv", dry_rig(), &(scenario + &effect("coulomb_friction", friction)));
    let report = diagnose(&[&rubbing], dry_rig(), &[]);
    assert_eq!(found(&report), ["coulomb_friction"], "{}", report["summary"]);
    let torque = report["findings"][0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((torque - 0.3).abs() < 0.03, "{torque} N m of 0.3");
    // Nobody spoke of a gear.
    assert!(
        report["notes"].to_string().contains("If there is one, say so in rig.class"),
        "{}",
        report["notes"]
    );
    // A reading without its sign is another motion of every effect: friction is looked for beside it anew.
    let amount = |_: usize, cell: &str| cell.trim_start_matches('-').to_string();
    let columns = ["time_s", "current_cmd_a", "shaft_speed_rad_s"];
    let unsigned =
        Table::read(&rubbing).keep(&columns).map("shaft_speed_rad_s", amount).save("dry-unsigned.csv");
    let report = diagnose(&[&unsigned], dry_rig(), &[]);
    // Beside so much that the lost sign explains, friction that differs by direction may stay a rival.
    assert_eq!(found(&report)[..2], ["unsigned_speed_sensor", "coulomb_friction"], "{}", report["summary"]);
    let likely = |finding: &serde_json::Value| finding["probability"].as_f64().unwrap();
    assert!(report["findings"].as_array().unwrap()[2..].iter().all(|rival| likely(rival) < 0.3), "{report}");
}

#[test]
fn what_was_found_belongs_to_the_rig_from_then_on() {
    let second = path("found.rig.toml");
    let output = kort(&["diagnose", swirl(), "--rig", STAND, "-o", &second]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let text = std::fs::read_to_string(&second).unwrap();
    assert!(text.contains("[[effects]]") && text.contains("rotational_flow"), "{text}");
    let report = diagnose(&[swirl()], &second, &[]);
    assert_eq!(report["verdict"], "no_mismatch", "{}", report["summary"]);
    let known = diagnose(&[swirl()], STAND, &["--with", "rotational_flow"]);
    assert_eq!(known["verdict"], "no_mismatch", "{}", known["summary"]);
    let wrong = kort(&["diagnose", swirl(), "--rig", STAND, "--with", "rotational_flo"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(stderr(&wrong).contains("did you mean rotational_flow?"), "{}", stderr(&wrong));
}

#[test]
fn every_model_explains_its_own_recording() {
    for model in ["model0", "model1", "model3", "rotational_flow"] {
        let scenario = random_levels(-0.95, 0.95, &format!("model = \"{model}\""));
        let file = simulate(&format!("{model}.csv"), STAND, &scenario);
        let report = diagnose(&[&file], STAND, &["--model", model]);
        assert_eq!(report["verdict"], "no_mismatch", "{model}: {}", report["summary"]);
        assert_eq!(report["baseline"]["model"], model);
    }
}

#[test]
fn every_kind_of_drive_is_compared() {
    let volts = simulate("volts.csv", "t200", &random_levels(-0.5, 0.5, ""));
    assert!(Table::read(&volts).header.contains(&"voltage_cmd_v".to_string()));
    let report = diagnose(&[&volts], "t200", &[]);
    assert_eq!(report["verdict"], "no_mismatch", "{}", report["summary"]);
    let stated = std::fs::read_to_string("config/thrusters/whitcomb-yoerger-1999.toml").unwrap();
    let rig = lab::write("speed.rig.toml", stated.replace("kind = \"current\"", "kind = \"speed\""));
    let scenario = random_levels(-60.0, 60.0, "").replace("share", "speed_cmd_rad_s");
    let report = diagnose(&[&simulate("speed.csv", &rig, &scenario)], &rig, &[]);
    assert_eq!(report["verdict"], "no_mismatch", "{}", report["summary"]);
}

#[test]
fn what_one_excitation_cannot_part_is_ambiguous_and_the_next_one_runs() {
    let report = slow_sine();
    assert_eq!(report["verdict"], "ambiguous", "{}", report["summary"]);
    let effects = found(report);
    assert!(effects.contains(&"transport_delay") && effects.contains(&"amplifier_lag"), "{effects:?}");
    assert!(report["next_experiment"]["separates"].as_array().unwrap().contains(&"transport_delay".into()));
    let file = lab::write("ambiguous.json", report.to_string());
    let out = path("next.csv");
    let output = kort(&["simulate", "--rig", STAND, "--scenario", &file, "-o", &out]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    assert!(Table::read(&out).rows.len() > 1000);
}

#[test]
fn the_static_models_leave_out_the_axial_flow_and_what_it_hides() {
    for model in &["model0", "model1"] {
        let report = diagnose(&[clean()], STAND, &["--model", model]);
        assert_eq!(found(&report), ["axial_flow_dynamics"], "{model}: {}", report["summary"]);
        let report = diagnose(&[swirl()], STAND, &["--model", model]);
        let effects = found(&report);
        assert!(effects.contains(&"axial_flow_dynamics"), "{model}: {effects:?}");
    }
}

#[test]
fn a_mismatch_without_a_name_is_unexplained() {
    // A third of the thrust readings off, at times that no physics has.
    let odd = |k: usize, cell: &str| match cell.parse::<f64>() {
        Ok(thrust) if k / 40 % 3 == 1 => (1.3 * thrust + 15.0).to_string(),
        _ => cell.to_string(),
    };
    let file = Table::read(clean()).map("thrust_n", odd).save("odd.csv");
    let report = diagnose(&[&file], STAND, &[]);
    assert_eq!(report["verdict"], "unexplained", "{}", report["summary"]);
    assert!(report["next_experiment"]["why"].is_string(), "something is left open: {}", report["summary"]);
    let file = lab::write("unexplained.json", report.to_string());
    let output = kort(&["simulate", "--rig", STAND, "--scenario", &file, "-o", &path("next-2.csv")]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
}

#[test]
fn rows_after_a_long_gap_or_a_pause_are_left_out_and_said() {
    for (missing_s, said) in [(3.0, "1 gaps longer than 3 intervals"), (7200.0, "pauses 1 times")] {
        let later = |k: usize| if k < 400 { 0.0 } else { missing_s };
        let silent = Table::read(clean())
            .map("time_s", |k, t| (t.parse::<f64>().unwrap() + later(k)).to_string())
            .save("silent.csv");
        let output = kort(&["diagnose", &silent, "--rig", STAND, "--json"]);
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        assert!(stderr(&output).contains("gap"), "what the exit code is for: {}", stderr(&output));
        let report: Value = serde_json::from_slice(&output.stdout).unwrap();
        lab::check_diagnosis(&report);
        assert_eq!(report["verdict"], "no_mismatch", "{}", report["summary"]);
        assert!(report["notes"].to_string().contains(said), "{}", report["notes"]);
    }
}

#[test]
fn of_a_long_recording_stretches_are_compared_and_said() {
    let friction =
        effect("coulomb_friction", "coulomb_torque_n_m = 0.3, stribeck_rise = 0.0, stribeck_speed_rad_s = 2");
    let long = random_levels(-0.95, 0.95, "").replace("duration_s = 12", "duration_s = 600");
    let report = diagnose(&[&simulate("long.csv", dry_rig(), &(long + &friction))], dry_rig(), &[]);
    assert_eq!(found(&report).first(), Some(&"coulomb_friction"), "{}", report["summary"]);
    let torque = report["findings"][0]["parameters"][0]["value"].as_f64().unwrap();
    assert!((torque - 0.3).abs() < 0.03, "{torque} N m of 0.3");
    let notes = report["notes"].to_string();
    assert!(notes.contains("of 600 s the 200 s in which most moves are compared, in "), "{notes}");
    assert!(!notes.contains("pauses") && !notes.contains("misses rows"), "{notes}");
}

#[test]
fn constant_and_empty_columns_take_no_part() {
    for (name, column, cell) in [
        ("flat-thrust", "thrust_n", "0"),
        ("flat-speed", "shaft_speed_rad_s", "3"),
        ("no-thrust", "thrust_n", ""),
    ] {
        let file = Table::read(clean()).map(column, |_, _| cell.into()).save(&format!("{name}.csv"));
        let report = diagnose(&[&file], STAND, &[]);
        assert_eq!(report["verdict"], "no_mismatch", "{name}: {}", report["summary"]);
        assert!(report["baseline"]["channels"].get(column).is_none());
        assert!(report["notes"].to_string().contains(column), "{name}: {}", report["notes"]);
    }
}

#[test]
fn too_little_to_judge_is_said() {
    let mut short = Table::read(clean());
    short.rows.truncate(150);
    let report = diagnose(&[&short.save("short.csv")], STAND, &[]);
    assert_eq!(report["verdict"], "insufficient_data", "{}", report["summary"]);
    let steady = simulate("steady.csv", STAND, &random_levels(0.5, 0.501, ""));
    let report = diagnose(&[&steady], STAND, &[]);
    assert_ne!(report["verdict"], "explained", "{}", report["summary"]);
}

/// The noise of a current's sensor drives a model as a current does, and answers nothing.
#[test]
fn a_recording_of_a_thruster_at_rest_tells_nothing() {
    let noise = |size: f64, seed: f64| {
        move |k: usize, _: &str| {
            let drawn = (k as f64 * 12.9898 + seed).sin() * 43_758.545_3;
            (size * (2.0 * (drawn - drawn.floor()) - 1.0)).to_string()
        }
    };
    let columns = ["time_s", "current_a", "shaft_speed_rad_s", "thrust_n"];
    let mut table = Table::read(clean()).keep(&columns);
    for (column, size) in [("current_a", 0.03), ("shaft_speed_rad_s", 0.2), ("thrust_n", 0.8)] {
        table = table.map(column, noise(size, size));
    }
    let report = diagnose(&[&table.save("at-rest.csv")], STAND, &[]);
    assert_eq!(report["verdict"], "insufficient_data", "{}", report["summary"]);
    let summary = report["summary"].as_str().unwrap();
    assert!(summary.contains("nothing moves: current_a and what answers it"), "{summary}");
}
