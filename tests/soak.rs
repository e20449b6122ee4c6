//! `kort soak`, black box: short scenarios, the same bytes each time, errors that help.

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use serde_json::Value;

fn kort(args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kort"))
        .args(args)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .output()
        .expect("kort runs")
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// A short scenario on the paper's stand, with `more` lines at its end.
fn scenario(folder: &Path, more: &str) -> PathBuf {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("config/thrusters/whitcomb-yoerger-1999.toml");
    let path = folder.join("short.toml");
    let text = format!(
        "name = \"short\"\nwhat = \"a test\"\nrig = {rig:?}\nduration_s = 12\nsettle_s = 1\nseeds = 2\n\
         controllers = [\"velocity_servo\", \"model2_inversion\"]\n\
         [[reference]]\nkind = \"steps\"\nlevels = [0.3, 0.6, -0.3]\nhold_s = 2\n{more}"
    );
    std::fs::write(&path, text).expect("scenario written");
    path
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_the_jobs() {
    let folder = tempfile::tempdir().expect("folder");
    let file = scenario(folder.path(), "[ambient]\nwander_std_m_s = 0.2\nwander_time_s = 5\n");
    let file = file.to_str().expect("utf-8");
    let one = kort(&["soak", file, "--json", "--jobs", "1"]);
    let two = kort(&["soak", file, "--json", "--jobs", "2"]);
    assert!(one.status.success(), "{}", text(&one.stderr));
    assert_eq!(one.stdout, two.stdout);
    let other = kort(&["soak", file, "--json", "--seed", "7"]);
    assert_ne!(one.stdout, other.stdout, "another seed, another sea");

    let report: Value = serde_json::from_slice(&one.stdout).expect("one JSON document");
    assert_eq!(report["schema"], "kort.soak/1");
    assert_eq!(report["virtual_seconds"], 48.0);
    let laws = report["scenarios"][0]["laws"].as_array().expect("laws");
    assert_eq!(laws.len(), 2);
    for law in laws {
        let rms = &law["scores"]["thrust_rms_n"];
        let (low, high) = (rms["ci95"][0].as_f64(), rms["ci95"][1].as_f64());
        assert!(low <= rms["mean"].as_f64() && rms["mean"].as_f64() <= high, "{law}");
        assert_eq!(law["scores"]["limits_broken"]["mean"], 0.0, "{law}");
    }
    assert!(report["scenarios"][0]["verdict"].as_str().is_some_and(|v| v.contains("least thrust error")));
}

#[test]
fn a_dead_controller_is_survived_and_a_page_is_written() {
    let folder = tempfile::tempdir().expect("folder");
    let fault = "[[process_fault]]\nkind = \"controller_restart\"\nat_s = 4\nfor_s = 0.2\n";
    let file = scenario(folder.path(), fault);
    let page = folder.path().join("soak.html");
    let run =
        kort(&["soak", file.to_str().expect("utf-8"), "--json", "--html", page.to_str().expect("utf-8")]);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    for law in report["scenarios"][0]["laws"].as_array().expect("laws") {
        assert_eq!(law["scores"]["faults_injected"]["mean"], 1.0, "{law}");
        assert_eq!(law["scores"]["faults_survived"]["mean"], 1.0, "{law}");
        assert_eq!(law["scores"]["trips"]["mean"], 1.0, "{law}");
    }
    let html = std::fs::read_to_string(page).expect("page");
    assert!(html.contains("<svg") && html.contains("model2_inversion"));
}

/// The paper's rig states no winding resistance: what follows from it is not known, not nothing.
#[test]
fn what_the_rig_does_not_state_is_not_known() {
    let folder = tempfile::tempdir().expect("folder");
    let file = scenario(folder.path(), "");
    let file = file.to_str().expect("utf-8");
    let run = kort(&["soak", file, "--json", "--seeds", "1"]);
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let law = &report["scenarios"][0]["laws"][1];
    assert!(law["scores"]["copper_loss_per_impulse_j_n_s"].is_null(), "{law}");
    assert!(law["against_plain"]["energy_per_impulse_j_n_s"]["mean"].as_f64().is_some(), "{law}");
    let table = text(&kort(&["soak", file, "--seeds", "1"]).stdout);
    assert!(table.contains("not known"), "{table}");
}

/// A log of commands is played in newtons, or stretched; a law told the truth is what adaptation is held to.
#[test]
fn a_log_is_replayed_and_adaptation_is_held_to_the_truth() {
    let folder = tempfile::tempdir().expect("folder");
    let rows: String = (0..20).map(|k| format!("{k},{},{}\n", 40 + 10 * (k % 4), k % 3)).collect();
    std::fs::write(folder.path().join("log.csv"), format!("time_s,thrust_cmd_n,stick\n{rows}")).expect("log");
    let replay = |more: &str| format!("[[reference]]\nkind = \"replay\"\nfile = \"log.csv\"\n{more}");
    let good = scenario(folder.path(), &replay(""));
    let words = std::fs::read_to_string(&good).expect("scenario");
    let head =
        words.split("[[reference]]").next().expect("head").replace("duration_s = 12", "duration_s = 30");
    let head = head
        .replace("settle_s = 1\n", "settle_s = 15\nagainst_true_parameters = true\n")
        .replace("velocity_servo\"", "adaptive_model2_inversion\"")
        .replace(", \"model2_inversion\"]", ", \"velocity_servo\"]");
    let change = "[[truth.change]]\nat_s = 2\nfactors = { lift_max = 0.7 }\n";
    let write = |text: String| std::fs::write(&good, text).expect("scenario");
    let path = good.to_str().expect("utf-8");

    write(format!("{head}{}{change}", replay("")));
    let run = kort(&["soak", path, "--json", "--seeds", "1"]);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let of = |i: usize| {
        report["scenarios"][0]["laws"][i]["scores"]["error_over_true_parameters"]["mean"]
            .as_f64()
            .unwrap_or(0.0)
    };
    assert!(of(0) < 1.2 && of(1) > 1.4, "adapting {} against {}", of(0), of(1));
    assert!(report["scenarios"][0]["verdict"].as_str().is_some_and(|v| v.contains("true parameters told")));

    write(format!("{head}{}{change}", replay("column = \"stick\"\n")));
    let run = kort(&["soak", path, "--seeds", "1"]);
    assert_eq!(run.status.code(), Some(2));
    assert!(text(&run.stderr).contains("peak = 0.8"), "{}", text(&run.stderr));
    write(format!("{head}{}{change}", replay("column = \"throttle\"\npeak = 0.5\n")));
    let said = text(&kort(&["soak", path, "--seeds", "1"]).stderr);
    assert!(said.contains("log.csv") && said.contains("stick"), "{said}");
    write(format!(
        "{head}{}{}",
        replay("column = \"stick\"\npeak = 0.5\n"),
        change.replace("at_s = 2", "at_s = 20")
    ));
    let run = kort(&["soak", path, "--seeds", "1"]);
    assert_eq!(run.status.code(), Some(2));
    assert!(text(&run.stderr).contains("settle_s"), "{}", text(&run.stderr));
}

/// What a scenario may say is checked before anything runs: the file, the key, what is allowed.
#[test]
fn mistakes_in_a_scenario_are_named() {
    let folder = tempfile::tempdir().expect("folder");
    let fault = "[[sensor_fault]]\nchannel = \"thrust_n\"\nat_s = 3\nfor_s = 1\n";
    let effect = "[[effect]]\nid = \"coulomb_friction\"\n";
    for (more, words) in [
        ("[ambeint]\nmean_m_s = 0.1\n".to_owned(), ["ambeint", "ambient"]),
        (
            format!("{effect}values = {{ coulomb_torqe_n_m = 0.1 }}\n"),
            ["coulomb_torqe_n_m", "coulomb_torque_n_m"],
        ),
        (format!("{effect}values = {{ coulomb_torque_n_m = -7 }}\n"), ["-7", "outside"]),
        ("[[supply_sag]]\nat_s = 1\nfor_s = 1\nto = 1.8\n".to_owned(), ["supply_sag[0].to", "0 to 1"]),
        (format!("{fault}lie = \"bias\"\n"), ["sensor_fault[0].size", "missing"]),
        (format!("{fault}lie = \"stuck\"\nsize = 2\n"), ["sensor_fault[0].size", "leave it out"]),
        (format!("{fault}lie = \"fibs\"\n"), ["fibs", "dropout"]),
        (
            "[[process_fault]]\nkind = \"controller_frozen\"\nat_s = 90\nfor_s = 1\n".to_owned(),
            ["process_fault[0].at_s", "0 to 12"],
        ),
        (
            "[[truth.change]]\nat_s = -1\nfactors = { lift_max = 0.7 }\n".to_owned(),
            ["truth.change[0].at_s", "0 to 12"],
        ),
        (
            "[[reference]]\nkind = \"sine\"\namplitude = \"big\"\nperiod_s = 3\nfor_s = 6\n".to_owned(),
            ["`reference[1].amplitude` = \"big\"", "expected a number"],
        ),
        ("[truth]\nfactors = { lift = 0.7 }\n".to_owned(), ["lift", "lift_max"]),
        (
            "[[reference]]\nkind = \"replay\"\nfile = \"none.csv\"\n".to_owned(),
            ["none.csv", "no such recording"],
        ),
    ] {
        let file = scenario(folder.path(), &more);
        let run = kort(&["soak", file.to_str().expect("utf-8")]);
        let said = text(&run.stderr);
        assert_eq!(run.status.code(), Some(2), "{more}{said}");
        assert!(words.iter().all(|w| said.contains(w)) && said.contains("hint:"), "{more}{said}");
    }
    // A page that cannot be written is said before the hours are driven, not after.
    let file = scenario(folder.path(), "");
    let run = kort(&["soak", file.to_str().expect("utf-8"), "--html", "/no/such/folder/soak.html"]);
    assert!(!run.status.success() && run.stdout.is_empty() && text(&run.stderr).contains("/no/such/folder"));
}

/// Someone's own thruster, by a path of their own: every law gives thrust, within its limits.
#[test]
fn a_thruster_of_ones_own_is_driven_by_every_law() {
    let folder = tempfile::tempdir().expect("folder");
    std::fs::write(
        folder.path().join("mine.toml"),
        "[rig]\nname = \"mine\"\n\
         [propeller]\nradius_m = 0.06\nduct_length_m = 0.05\npitch_rad = 0.4\nlift_max = 1.0\ndrag_max = 1.1\n\
         [flow]\ndensity_kg_m3 = 1025\nflux_coefficient = 2.0\nadded_mass_coefficient = 1.5\n\
         [motor]\ninertia_kg_m2 = 4e-4\ntorque_constant_nm_a = 0.12\nwinding_resistance_ohm = 0.3\n\
         [amplifier]\nkind = \"current\"\ntime_constant_s = 0.003\ncurrent_limit_a = 15\nsupply_v = 24\n",
    )
    .expect("rig");
    let file = scenario(folder.path(), "");
    let words = std::fs::read_to_string(&file).expect("scenario");
    let (before, rest) = words.split_once("rig = ").expect("a rig");
    let (_, after) = rest.split_once('\n').expect("a line");
    std::fs::write(&file, format!("{before}rig = \"mine.toml\"\n{after}")).expect("scenario");
    let laws = "static_map,velocity_servo,model1_inversion,model2_inversion,model3_inversion,\
                rotational_flow_inversion,torque_control,power_control,combined_anti_spin,thrust_pi,\
                trimmed_model2_inversion,look_ahead,adaptive_model2_inversion,gradient_model2_inversion,\
                ukf_model2_inversion,luenberger_model2_inversion";
    let run = kort(&["soak", file.to_str().expect("utf-8"), "--json", "--seeds", "1", "--controllers", laws]);
    assert!(run.status.success(), "{}", text(&run.stderr));
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let scenario = &report["scenarios"][0];
    let most = scenario["thrust_max_n"].as_f64().expect("thrust");
    let laws = scenario["laws"].as_array().expect("laws");
    assert_eq!(laws.len(), 16);
    for law in laws {
        let of = |score: &str| law["scores"][score]["mean"].as_f64().unwrap_or(f64::NAN);
        assert!(of("thrust_rms_n") < 0.2 * most, "{law}");
        assert_eq!(of("limits_broken"), 0.0, "{law}");
        // No propeller beats the ideal one, and copper is part of the energy.
        assert!(of("energy_over_ideal") > 1.0, "{law}");
        let copper = of("copper_loss_per_impulse_j_n_s");
        assert!(copper > 0.0 && copper < of("energy_per_impulse_j_n_s"), "{law}");
    }
}

/// What can be compared is listed by a command, and each tells of itself.
#[test]
fn laws_observers_and_estimators_are_explained() {
    let list = text(&kort(&["explain"]).stdout);
    for name in ["look_ahead", "combined_anti_spin", "luenberger", "ukf", "gradient"] {
        assert!(list.lines().any(|l| l.starts_with(name)), "{name}: {list}");
        let run = kort(&["explain", name]);
        assert!(run.status.success(), "{}", text(&run.stderr));
        let words = text(&run.stdout);
        for part in ["Reference:", "Assumes:", "Needs measured:", "Fails:"] {
            assert!(words.contains(part), "{name}: {words}");
        }
    }
    let all: Value = serde_json::from_slice(&kort(&["explain", "--json"]).stdout).expect("JSON");
    assert_eq!(all["controllers"].as_array().map(Vec::len), Some(18));
}

#[test]
fn wrong_input_is_named() {
    let folder = tempfile::tempdir().expect("folder");
    let good = scenario(folder.path(), "");
    let good = good.to_str().expect("utf-8");
    let run = kort(&["soak", good, "--controllers", "velocity_srevo"]);
    assert_eq!(run.status.code(), Some(2));
    let said = text(&run.stderr);
    assert!(
        said.contains("velocity_srevo") && said.contains("velocity_servo") && said.contains("hint:"),
        "{said}"
    );

    let bad = scenario(folder.path(), "[[effect]]\nid = \"couloumb\"\n");
    let run = kort(&["soak", bad.to_str().expect("utf-8")]);
    let said = text(&run.stderr);
    assert_eq!(run.status.code(), Some(2));
    assert!(
        said.contains("short.toml") && said.contains("couloumb") && said.contains("coulomb_friction"),
        "{said}"
    );
    assert_eq!(kort(&["soak"]).status.code(), Some(2));
    assert_eq!(kort(&["soak", "no-such-file.toml"]).status.code(), Some(2));
}

/// The rig's own default beside the plain law and what the drive's limits leave, on a rig of one's choice.
#[test]
fn the_default_law_is_never_worse_than_the_plain_one_on_any_shipped_rig() {
    let folder = tempfile::tempdir().expect("folder");
    let file = scenario(
        folder.path(),
        "ramp_s = 0.3\n[truth]\nspread = 0.03\n[[effect]]\nid = \"coulomb_friction\"\nshares = { coulomb_torque_n_m = 0.01 }\n",
    );
    let page = folder.path().join("page.md");
    std::fs::write(&page, "before\n<!-- kort soak: begin -->\nold\n<!-- kort soak: end -->\nafter\n")
        .expect("page");
    let args = ["soak", file.to_str().expect("utf-8"), "--rig", "all", "--seed", "901", "--json"];
    let run = kort(&[&args[..], &["--markdown", page.to_str().expect("utf-8")]].concat());
    assert!(run.status.success(), "{}", text(&run.stderr));
    let report: Value = serde_json::from_slice(&run.stdout).expect("JSON");
    let scenarios = report["scenarios"].as_array().expect("scenarios");
    assert!(scenarios.len() >= 8, "every rig with a propeller: {}", scenarios.len());
    for s in scenarios {
        let ratio = |name: &str| {
            let law = s["laws"].as_array().expect("laws").iter().find(|l| l["name"] == name).expect("law");
            law["against_plain"]["thrust_rms_n"]["mean"].as_f64().expect("ratio")
        };
        assert!(ratio("default") <= 1.02, "{}: {}", s["rig"], ratio("default"));
        assert!(ratio("drive_limits") < 1.0, "{}: {}", s["rig"], ratio("drive_limits"));
    }
    let page = std::fs::read_to_string(&page).expect("page");
    assert!(page.starts_with("before\n") && page.ends_with("after\n") && !page.contains("old"), "{page}");
    assert_eq!(page.lines().filter(|l| l.starts_with("| `")).count(), scenarios.len(), "{page}");
}

#[test]
fn a_rig_s_default_is_explained() {
    let told = kort(&["explain", "--for", "t200"]);
    assert!(told.status.success(), "{}", text(&told.stderr));
    let said = text(&told.stdout);
    for word in ["model2_inversion", "ekf", "lag and dead time of the drive", "20.00 ms"] {
        assert!(said.contains(word), "{word}: {said}");
    }
    let json = kort(&["explain", "--for", "speed-drive", "--json"]);
    let document: Value = serde_json::from_slice(&json.stdout).expect("JSON");
    assert_eq!(document["controller"]["law"], "model2_inversion");
    assert_eq!(document["time_scales"]["drive_s"], 0.08);
    let dry = kort(&["explain", "--for", "rosa-rotor"]);
    assert_eq!(dry.status.code(), Some(2));
    assert!(text(&dry.stderr).contains("needs a propeller"), "{}", text(&dry.stderr));
}

/// What a rig's page says of an effect that it states, the effect's own page says too, on every kind of drive.
#[test]
fn an_effect_is_explained_as_the_rigs_that_state_it_are() {
    let folder = tempfile::tempdir().expect("folder");
    let ventilation = "[[effects]]\neffect = \"ventilation\"\nthrust_loss = 0.3\nonset_speed_rad_s = 40\nlag_s = 0.3\n\
                       recovery_lag_s = 0.3\nhysteresis = 0.1\ndrag_loss_over_lift_loss = 1\n";
    let mut ripple = String::from("[[effects]]\neffect = \"torque_ripple_cogging\"\n");
    for k in 1..=4 {
        ripple += &format!(
            "order_{k} = {k}\ncogging_sin_{k}_n_m = 0.01\ncogging_cos_{k}_n_m = 0\nripple_sin_{k}_nm_a = 0\nripple_cos_{k}_nm_a = 0\n"
        );
    }
    let document = |run: &Output| serde_json::from_slice::<Value>(&run.stdout).expect("JSON");
    let mut said = 0;
    for rig in ["whitcomb-yoerger-1999", "t200", "speed-drive"] {
        let stated = std::fs::read_to_string(format!("config/thrusters/{rig}.toml")).expect("a rig");
        let file = folder.path().join("rig.toml");
        std::fs::write(&file, format!("{stated}\n{ventilation}{ripple}")).expect("a file");
        let of_rig = document(&kort(&["explain", "--json", "--for", file.to_str().expect("utf-8")]));
        for known in of_rig["known_effects"].as_array().expect("effects") {
            let effect = known["effect"].as_str().expect("an id");
            let page =
                text(&kort(&["explain", effect]).stdout).split_whitespace().collect::<Vec<_>>().join(" ");
            for words in known["how"].as_str().expect("words").split("; ") {
                assert!(page.contains(words), "{rig}, {effect}: {words} not in {page}");
                said += 1;
            }
        }
    }
    assert!(said >= 6);
    let told = document(&kort(&["explain", "ventilation", "--json"]))["effects"][0].clone();
    assert!(told["used_for"].as_array().is_some_and(|uses| !uses.is_empty()), "{told}");
    assert!(told["not_used"].is_null() && told["not_used_elsewhere"].is_string(), "{told}");
}

#[test]
fn what_cannot_be_a_share_is_named() {
    let folder = tempfile::tempdir().expect("folder");
    let effect = "[[effect]]\nid = \"transport_delay\"\nshares = { delay_s = 0.1 }\n";
    let file = scenario(folder.path(), effect);
    let run = kort(&["soak", file.to_str().expect("utf-8")]);
    let said = text(&run.stderr);
    assert_eq!(run.status.code(), Some(2), "{said}");
    assert!(
        said.contains("transport_delay.delay_s") && said.contains("hint: give it under values"),
        "{said}"
    );
    let wrong = kort(&["soak", "soak-towd"]);
    assert!(text(&wrong.stderr).contains("did you mean `soak-towed`?"), "{}", text(&wrong.stderr));
}

/// What of a rig's effects no law reckons with is said once, however many scenarios and laws run on it.
#[test]
fn an_effect_that_no_law_uses_is_named_once() {
    let folder = tempfile::tempdir().expect("folder");
    let shipped = include_str!("../config/thrusters/whitcomb-yoerger-1999.toml");
    let rig = folder.path().join("airy.toml");
    let friction = "\n[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = 0.3\n";
    std::fs::write(&rig, format!("{shipped}{friction}{}", common::VENTILATION)).expect("rig written");
    let file = scenario(folder.path(), "");
    let (file, rig) = (file.to_str().expect("utf-8"), rig.to_str().expect("utf-8"));
    let again = folder.path().join("again.toml");
    std::fs::copy(file, &again).expect("copied");
    let again = again.to_str().expect("utf-8");
    let out = kort(&["soak", file, again, "--rig", rig, "--seeds", "1", "--json"]);
    let words = text(&out.stderr);
    assert!(out.status.success(), "{words}");
    assert_eq!(words.matches("known ventilation: NOT USED: ").count(), 1, "{words}");
    assert!(words.contains("hint:"), "{words}");
    assert!(!words.contains("coulomb_friction"), "what is used needs no word: {words}");
    let plain = kort(&["soak", file, "--seeds", "1"]);
    assert!(!text(&plain.stderr).contains("NOT USED"), "{}", text(&plain.stderr));
}
