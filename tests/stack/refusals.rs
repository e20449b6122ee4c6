//! What stands in the way of a start is said once, with a way out, and nothing is left running.

use crate::common::{self, Site, Stack, run, wait};

#[test]
fn too_few_open_files_are_called_that() {
    let site = Site::new();
    let out = run(std::process::Command::new("sh").arg("-c").arg(format!(
        "ulimit -n 32; exec {} up --config {} --root {}",
        common::KORT,
        site.config().display(),
        site.root().display()
    )));
    let words = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(1), "{words}");
    assert!(words.contains("open files: at most 32") && words.contains("ulimit -n"), "{words}");
    assert!(!words.contains("/dev/shm"), "{words}");
}

/// One that runs short under way is told so too, not sent to look at the shared memory.
#[test]
fn a_gateway_that_runs_out_of_open_files_says_so() {
    let site = Site::new();
    let mut servo = site.spawn("servo");
    let other = Site::new();
    let mut gateway = std::process::Command::new("sh");
    gateway.arg("-c").arg(format!(
        "ulimit -n 48; exec {} gateway --config {} --root {} 2>&1",
        common::KORT,
        other.config().display(),
        site.root().display()
    ));
    let log = std::fs::File::create(other.folder.path().join("log")).unwrap();
    let mut gateway = gateway.stdout(log).spawn().unwrap();
    let words = wait("its word", || Some(other.log()).filter(|log| log.contains("hint:")));
    for process in [&mut gateway, &mut servo] {
        process.kill().unwrap();
        process.wait().unwrap();
    }
    assert!(words.contains("open files: at most 48") && words.contains("ulimit -n"), "{words}");
    assert!(!words.contains("/dev/shm") && !words.contains("nothing runs here"), "{words}");
}

#[test]
fn what_others_could_write_is_not_trusted() {
    use std::os::unix::fs::PermissionsExt;
    let site = Site::new();
    std::fs::create_dir(site.root()).unwrap();
    std::fs::set_permissions(site.root(), std::fs::Permissions::from_mode(0o777)).unwrap();
    let out = run(&mut site.command("up"));
    let words = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(1) && words.contains("may be written by others"), "{words}");
    std::fs::remove_dir(site.root()).unwrap();
    let elsewhere = site.folder.path().join("victim");
    std::fs::write(&elsewhere, "whole").unwrap();
    std::os::unix::fs::symlink(&elsewhere, site.folder.path().join("shm.lock")).unwrap();
    let out = run(&mut site.command("up"));
    let words = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(1) && words.contains("is a link"), "{words}");
    assert_eq!(std::fs::read_to_string(&elsewhere).unwrap(), "whole");
    std::fs::remove_file(site.folder.path().join("shm.lock")).unwrap();
}

#[test]
fn a_second_supervisor_is_told_who_runs_here() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let second = run(&mut stack.site.command("up"));
        assert_eq!(second.status.code(), Some(1));
        let words = String::from_utf8_lossy(&second.stderr);
        assert!(words.contains(&stack.supervisor.id().to_string()) && words.contains("hint:"), "{words}");
        assert!(stack.state().is_some(), "the first one still runs");
    });
}

#[test]
fn what_stands_in_the_way_of_a_start_is_said_once() {
    let site = Site::new();
    let taken = std::net::TcpListener::bind(("127.0.0.1", site.port)).unwrap();
    let up = run(&mut site.command("up"));
    let words = String::from_utf8_lossy(&up.stderr);
    assert_eq!(up.status.code(), Some(1), "{words}");
    assert_eq!(words.matches("error: gateway.bind").count(), 1, "{words}");
    assert!(words.contains(&site.port.to_string()) && words.contains("hint:"), "{words}");
    assert!(up.stdout.is_empty(), "no console is promised");
    drop(taken);
    let root = site.folder.path().join("x".repeat(150));
    let up = run(std::process::Command::new(common::KORT)
        .args(["up", "--config"])
        .arg(site.config())
        .arg("--root")
        .arg(&root));
    let words = String::from_utf8_lossy(&up.stderr);
    assert_eq!(up.status.code(), Some(1), "{words}");
    assert!(words.contains("at most 35 bytes") && !words.contains("panicked"), "{words}");
}

/// Each folder that is written to is tried before anything is started: one message, and nothing is promised.
#[test]
fn a_folder_that_cannot_be_written_to_is_said_once() {
    let site = Site::new();
    let blocked = site.folder.path().join("blocked");
    std::fs::write(&blocked, "").unwrap();
    let text = std::fs::read_to_string(site.config()).unwrap();
    // A file in its way; and a folder in which nobody, root neither, makes a file.
    for folder in [blocked.join("x"), "/proc/self/fd".into()] {
        for key in ["recordings", "diagnoses", "calibrations"] {
            let kept: Vec<_> = text.lines().filter(|line| !line.starts_with(key)).collect();
            std::fs::write(site.config(), kept.join("\n")).unwrap();
            site.add("[gateway]", &format!("{key} = {folder:?}"));
            let up = run(&mut site.command("up"));
            let words = String::from_utf8_lossy(&up.stderr);
            assert!(!up.status.success() && up.stdout.is_empty(), "no console is promised: {words}");
            assert_eq!(words.matches(&format!("kort.toml: gateway.{key} = ")).count(), 1, "{words}");
            assert!(
                words.starts_with("error: ") && words.contains("hint:") && words.lines().count() < 4,
                "{words}"
            );
        }
    }
}

/// As `kort check` says it, and before a folder is made: nobody mends one mistake to be told of the next.
#[test]
fn a_start_is_refused_with_everything_that_is_wrong_and_makes_nothing() {
    let site = Site::new();
    let text = std::fs::read_to_string(site.config()).unwrap();
    let text =
        text.replace("velocity_servo", "velocity").replace("full_drive_s = 0.005", "temperature_c = -300");
    std::fs::write(site.config(), text).unwrap();
    site.add("[gateway]", "require_tokens = true\nrecording = { files_max = 0 }");
    let check = run(std::process::Command::new(common::KORT).arg("check").arg(site.config()));
    let up = run(&mut site.command("up"));
    let words = String::from_utf8_lossy(&up.stderr);
    assert_eq!((up.status.code(), up.stdout.len()), (Some(2), 0), "{words}");
    for wrong in ["limits.temperature_c", "known are static_map", "recording.files_max", "holds no token"] {
        assert_eq!(words.matches(wrong).count(), 1, "{wrong} in: {words}");
    }
    assert_eq!(words.replace("error: ", ""), String::from_utf8_lossy(&check.stdout), "as the check says it");
    let made: Vec<_> =
        std::fs::read_dir(site.folder.path()).unwrap().flatten().map(|it| it.file_name()).collect();
    assert_eq!(made, ["kort.toml"], "nothing else is there");
}

#[test]
fn a_wrong_configuration_is_refused_with_the_nearest_key() {
    let site = Site::new();
    let text = std::fs::read_to_string(site.config()).unwrap();
    for (wrong, words) in [
        (
            text.replace("amplifier", "amplifyer"),
            vec!["unknown field `amplifyer`", "did you mean `amplifier`?"],
        ),
        (text.replace("rate_hz = 500", "rate_hz = 9000"), vec!["thrusters.t1.servo.rate_hz", "100 to 5000"]),
        (
            text.replace("full_drive_s", "full_drive"),
            vec!["thrusters.t1.limits", "did you mean `full_drive_s`?"],
        ),
        (text.replace("velocity_servo", "velocity"), vec!["velocity", "known are static_map"]),
        (
            text.replace("full_drive_s = 0.005", "current_a = 1e6"),
            vec!["thrusters.t1.limits.current_a", "1000000", "outside", "hint:"],
        ),
        (
            text.replace("full_drive_s = 0.005", "temperature_c = -300"),
            vec!["thrusters.t1.limits.temperature_c", "-300", "hint:"],
        ),
        (
            text.replace("full_drive_s = 0.005", "speed_rad_s = 5000"),
            vec!["thrusters.t1.limits.speed_rad_s", "5000", "195", "amplifier.supply_v", "hint:"],
        ),
        (
            text.replace("limits = {", "checks = { frozen_s = 1e9 }\nlimits = {"),
            vec!["thrusters.t1.checks.frozen_s", "hint:"],
        ),
        (
            text.replace("whitcomb-yoerger-1999", "rosa-rotor")
                .replace("limits = {", "checks = { inflow_m_s = 2 }\nlimits = {"),
            vec!["thrusters.t1.checks.inflow_m_s", "no propeller", "hint:"],
        ),
        (
            text.replace("full_drive_s = 0.005", "temperature_c = nan"),
            vec!["thrusters.t1.limits.temperature_c", "NaN", "hint:"],
        ),
    ] {
        std::fs::write(site.config(), &wrong).unwrap();
        // Each process refuses what it reads; the first three are read by the servo.
        let role = if words[0] == "velocity" { "controller" } else { "servo" };
        let out = run(&mut site.command(role));
        let error = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{error}");
        assert!(words.iter().all(|w| error.contains(w)) && error.contains("kort.toml"), "{error}");
        // The supervisor does not try again what no second try makes right.
        let out = run(&mut site.command("up"));
        let error = String::from_utf8_lossy(&out.stderr);
        assert_eq!(out.status.code(), Some(2), "{error}");
        assert!(words.iter().all(|w| error.contains(w)), "{error}");
        let told: Vec<&str> = error.lines().filter(|line| line.starts_with("error:")).collect();
        // A rotor has no thrust to control either.
        let mistakes = if wrong.contains("rosa-rotor") { 3 } else { 1 };
        assert_eq!(told.len(), mistakes, "one message a mistake: {error}");
        assert!(out.stdout.is_empty(), "no console is promised");
    }
    std::fs::write(site.config(), text.replace(&format!("127.0.0.1:{}", site.port), "127.0.0.1:0")).unwrap();
    let out = run(&mut site.command("up"));
    let error = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.code() == Some(2) && error.contains("port 0"), "{error}");
}

/// An effect of a rig that no law and no observer reckons with is no mistake, and is named all the same: of the rig
/// itself, and of a deployment that runs on it.
#[test]
fn an_effect_that_no_law_uses_is_named_by_the_check() {
    let site = Site::new();
    let rig = site.folder.path().join("airy.toml");
    let shipped = include_str!("../../config/thrusters/whitcomb-yoerger-1999.toml");
    let friction = "\n[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = 0.3\n";
    std::fs::write(&rig, format!("{shipped}{friction}{}", common::VENTILATION)).unwrap();
    let text = std::fs::read_to_string(site.config()).unwrap();
    let stated = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/whitcomb-yoerger-1999.toml");
    std::fs::write(site.config(), text.replace(stated, rig.to_str().unwrap())).unwrap();
    let check = |more: &[&str], file: &std::path::Path| {
        let out = run(std::process::Command::new(common::KORT).arg("check").args(more).arg(file));
        let words = String::from_utf8_lossy(&out.stdout).into_owned();
        assert_eq!(out.status.code(), Some(0), "{words}");
        words
    };
    for file in [&rig, &site.config()] {
        let words = check(&[], file);
        assert_eq!(words.matches("ventilation").count(), 1, "{words}");
        assert!(words.contains("airy.toml") && words.contains("NOT USED: "), "{words}");
        assert!(words.contains("nothing is wrong") && !words.contains("coulomb_friction"), "{words}");
        let report: serde_json::Value = serde_json::from_str(&check(&["--json"], file)).unwrap();
        assert_eq!(report["problems"], serde_json::json!([]), "{report}");
        let unused = report["unused_effects"].as_array().expect("a list");
        assert_eq!((unused.len(), &unused[0]["effect"]), (1, &"ventilation".into()), "{report}");
        assert!(unused[0]["file"].as_str().is_some_and(|file| file.ends_with("airy.toml")), "{report}");
        assert!(unused[0]["why"].as_str().is_some_and(|why| why.contains("observer")), "{report}");
    }
}

/// A rig description that is wrong in several places is told in full, asked for itself or with the deployment that names
/// it, in the same words; and the rest of the deployment is looked at all the same.
#[test]
fn all_that_is_wrong_with_a_rig_is_said_at_once() {
    let site = Site::new();
    let rig = site.folder.path().join("bent.toml");
    let bent = include_str!("../../config/thrusters/whitcomb-yoerger-1999.toml")
        .replace("radius_m = { value = 0.13,", "radius_m = { value = 130,")
        .replace("log_rate_hz", "log_rate_hertz")
        .replace("inertia_kg_m2 = { value = 0.01, tol = 0.5 }", "efficiency = 0.9")
        .replace("\"not recorded\"", "\"no\"");
    std::fs::write(&rig, format!("{bent}\n[[effects]]\neffect = \"colomb_friction\"\n")).unwrap();
    let text = std::fs::read_to_string(site.config()).unwrap();
    let stated = concat!(env!("CARGO_MANIFEST_DIR"), "/config/thrusters/whitcomb-yoerger-1999.toml");
    let text = text.replace(stated, rig.to_str().unwrap()).replace("velocity_servo", "velocity");
    std::fs::write(site.config(), text).unwrap();
    let problems = |file: &std::path::Path| {
        let out = run(std::process::Command::new(common::KORT).args(["check", "--json"]).arg(file));
        assert_eq!(out.status.code(), Some(2), "{}", String::from_utf8_lossy(&out.stderr));
        let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
        report["problems"].as_array().unwrap().clone()
    };
    let of_rig = problems(&rig);
    let mut keys: Vec<_> = of_rig.iter().filter_map(|problem| problem["key"].as_str()).collect();
    keys.sort_unstable();
    let wanted = [
        "effects[0].effect",
        "motor.efficiency",
        "motor.inertia_kg_m2",
        "propeller.radius_m",
        "sensors.ambient_flow",
        "sensors.log_rate_hertz",
    ];
    assert_eq!(keys, wanted, "{of_rig:?}");
    let mut of_deployment = problems(&site.config());
    let law = of_deployment.iter().position(|problem| problem["key"] == "thrusters.t1.controller.law");
    of_deployment.remove(law.expect("the law is looked at too"));
    assert_eq!(of_deployment, of_rig);
}

/// A deployment may be looked at on another machine than it is for: what this one has not is said, and no mistake.
#[test]
fn cores_that_this_machine_has_not_are_a_warning() {
    let site = Site::new();
    let text = std::fs::read_to_string(site.config()).unwrap();
    let text = text.replace("rate_hz = 500", "rate_hz = 500, cores = [0, 1023]");
    assert!(text.contains("1023"), "{text}");
    std::fs::write(site.config(), text).unwrap();
    let check = |more: &[&str]| {
        let out = run(std::process::Command::new(common::KORT).arg("check").args(more).arg(site.config()));
        assert_eq!(out.status.code(), Some(0), "{}", String::from_utf8_lossy(&out.stdout));
        String::from_utf8_lossy(&out.stdout).into_owned()
    };
    let words = check(&[]);
    assert!(
        words.contains("WARNING: ") && words.contains("`thrusters.t1.servo.cores` holds 1023"),
        "{words}"
    );
    let report: serde_json::Value = serde_json::from_str(&check(&["--json"])).unwrap();
    assert_eq!(report["problems"], serde_json::json!([]), "{report}");
    let warning = &report["warnings"][0];
    assert_eq!((&warning["key"], &warning["found"]), (&"thrusters.t1.servo.cores".into(), &"1023".into()));
    assert!(warning["allowed"].as_str().is_some_and(|here| here.starts_with('0')), "{warning}");
}

/// Scenarios and controllers are told in full too, by what checks them and by what runs them.
#[test]
fn all_that_is_wrong_with_a_scenario_or_a_controller_is_said_at_once() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let said = |arguments: &[&str]| {
        let out = run(std::process::Command::new(common::KORT).args(arguments));
        assert_eq!(out.status.code(), Some(2), "{arguments:?}: {}", String::from_utf8_lossy(&out.stdout));
        String::from_utf8_lossy(&[out.stdout, out.stderr].concat()).into_owned()
    };
    let hold = "[[segments]]\nkind = \"hold\"\nvalue = 0.5\n";
    let steps = "name = \"x\"\nwhat = \"x\"\nrig = \"t200\"\ncontrollers = [\"velocity_servo\"]\n[[reference]]\nkind = \"steps\"\nlevels = [0.5]\n";
    for (name, text, keys, and_run) in [
        ("a.toml", format!("noise = \"no\"\nsede = 1\n{hold}duration = 1\n"), ["`noise`", "`sede`", "`segments[0].duration`"], "simulate"),
        ("b.toml", format!("noise = -1\nduration_s = -5\n{hold}duration_s = 0\n"), ["`noise`", "`duration_s`", "`segments[0].duration_s`"], "simulate"),
        ("c.toml", format!("duration_s = 60\nseed_s = 1\naim_of_plain = true\n{steps}hold = 1\n"), ["`seed_s`", "`aim_of_plain`", "`reference[0].hold`"], "soak"),
        ("d.toml", format!("duration_s = 0\nseeds = 0\n{steps}hold_s = 0\n"), ["`duration_s`", "`seeds`", "`reference[0].hold_s`"], "soak"),
        ("e.toml", "law = \"best\"\nobservr = \"ekf\"\n[laws.servo]\nphase_margin_deg = \"x\"\n".into(), ["`law`", "`observr`", "`laws.servo.phase_margin_deg`"], ""),
        ("f.toml", "law = \"look_ahead\"\n[laws.servo]\nphase_margin_deg = 5\n[limits]\noverspeed = 9\nfade_s = -1\n".into(), ["`phase_margin_deg`", "`overspeed`", "`fade_s`"], ""),
    ] {
        let path = file(name, &text);
        let mut told = vec![said(&["check", &path])];
        match and_run {
            "simulate" => told.push(said(&["simulate", "--rig", "t200", "--scenario", &path, "-o", &file("out.csv", "")])),
            "soak" => told.push(said(&["soak", &path, "--rig", "t200"])),
            _ => told.push(said(&["soak", "soak-towed", "--rig", "t200", "--controllers", &path])),
        }
        for words in told {
            for key in keys {
                assert_eq!(words.matches(&format!("{path}: {key}")).count(), 1, "{name}, {key}: {words}");
            }
        }
    }
}
