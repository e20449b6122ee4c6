//! What `kort check` says of a deployment: everything at once.

use crate::common::{self, Site, run};

#[test]
fn a_configuration_that_holds_nothing_is_no_sound_one() {
    let site = Site::new();
    std::fs::write(site.config(), "# nothing yet\n").unwrap();
    let check = |more: &[&str]| {
        run(std::process::Command::new(common::KORT).arg("check").args(more).arg(site.config()))
    };
    let out = check(&[]);
    let words = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(2), "{words}");
    assert!(
        words.contains("no key at all") && words.contains("hint:") && words.contains("[thrusters.ID]"),
        "{words}"
    );
    let report: serde_json::Value = serde_json::from_slice(&check(&["--json"]).stdout).unwrap();
    assert_eq!(report["problems"].as_array().map(Vec::len), Some(1), "{report}");
}

#[test]
fn everything_that_is_wrong_is_said_at_once() {
    let site = Site::new();
    let text = std::fs::read_to_string(site.config()).unwrap();
    let text = text
        .replace(
            "full_drive_s = 0.005",
            "temperature_c = -300, continuous_current_a = 100, supply_low_v = 10, supply_high_v = 5",
        )
        .replace("limits = {", "checks = { frozn_s = 1 }\nlimits = {")
        .replace("amplifier = \"simulated\"", "amplifier = \"simulatd\"")
        .replace("velocity_servo", "velocity");
    std::fs::write(site.config(), text).unwrap();
    site.add(
        "[gateway]",
        "hosts = [\"http://here\", \"\", \"a b\"]\nrecording = { files_max = 0, time_max_s = 0 }",
    );
    let out = run(std::process::Command::new(common::KORT).arg("check").arg(site.config()));
    let words = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(2), "{words}");
    for wrong in [
        "limits.temperature_c",
        "limits.continuous_current_a",
        "did you mean `frozen_s`",
        "\"simulatd\" is no drive",
        "known are static_map",
        "holds \"http://here\"",
        "holds \"\"",
        "holds \"a b\"",
        "limits.supply_low_v",
        "recording.files_max",
        "recording.time_max_s",
    ] {
        assert_eq!(words.matches(wrong).count(), 1, "{wrong} in: {words}");
    }
    let more = std::fs::read_to_string(site.config()).unwrap();
    let more = more.replace("rate_hz = 500", "rate_hz = 9000, priority = 99");
    std::fs::write(site.config(), more).unwrap();
    let out = run(std::process::Command::new(common::KORT).arg("check").arg(site.config()));
    let words = String::from_utf8_lossy(&out.stdout);
    for wrong in
        ["thrusters.t1.servo.rate_hz", "thrusters.t1.servo.priority", "frozen_s", "known are static_map"]
    {
        assert!(words.contains(wrong), "{wrong} in: {words}");
    }
    let out = run(std::process::Command::new(common::KORT).args(["check", "--json"]).arg(site.config()));
    let report: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
    let of = |key: &str| report["problems"].as_array().unwrap().iter().find(|p| p["key"] == key).cloned();
    let found = of("thrusters.t1.servo.priority").expect("the priority");
    assert_eq!((&found["found"], &found["allowed"]), (&"99".into(), &"0 to 90".into()), "{found}");
    let found = of("thrusters.t1.amplifier").expect("the drive");
    assert_eq!(found["found"], "\"simulatd\"", "{found}");
    assert!(
        found["allowed"].as_str().is_some_and(|allowed| allowed.starts_with("\"simulated\", ")),
        "{found}"
    );
    // All that is said of it stands beside the values, never in their place.
    for problem in report["problems"].as_array().unwrap() {
        let (message, allowed) = (problem["message"].as_str().unwrap(), problem["allowed"].as_str());
        assert!(allowed.is_none_or(|allowed| allowed != message && !allowed.contains('`')), "{problem}");
    }
}

/// One number that is wrong hides no other, and none is blamed that nobody wrote.
#[test]
fn what_is_wrong_with_a_stand_and_its_limits_is_said_at_once() {
    let site = Site::new();
    let text = std::fs::read_to_string(site.config()).unwrap().replace("rate_hz = 10,", "rate_hz = 300,");
    let text = text.replace(
        "limits = { full_drive_s = 0.005 }",
        "limits = { trip_speed_rad_s = 10, supply_low_v = 10, supply_high_v = 5, temperature_c = -300 }\n\
         simulation = { model = \"model9\", ambient_m_s = nan, effects = [{ id = \"coulomb_frictio\" }] }",
    );
    std::fs::write(site.config(), text).unwrap();
    let out = run(std::process::Command::new(common::KORT).arg("check").arg(site.config()));
    let words = String::from_utf8_lossy(&out.stdout);
    assert_eq!(out.status.code(), Some(2), "{words}");
    for wrong in [
        "controller.rate_hz` = 300 does not divide",
        "limits.temperature_c` = -300",
        "limits.trip_speed_rad_s` = 10, but speed_rad_s is not stated",
        "limits.supply_low_v` = 10 is not below",
        "simulation.model`: `model9`",
        "simulation.ambient_m_s`: NaN",
        "\"coulomb_frictio\" is not known",
    ] {
        assert_eq!(words.lines().filter(|line| line.contains(wrong)).count(), 1, "{wrong} in: {words}");
    }
    assert!(!words.contains("inf"), "{words}");
}

/// No mistake, and said all the same, with a way out that is none.
#[test]
fn a_loop_too_slow_for_its_law_is_warned_of() {
    let site = Site::new();
    let check = || {
        let out = run(std::process::Command::new(common::KORT).arg("check").arg(site.config()));
        (out.status.code(), String::from_utf8_lossy(&out.stdout).into_owned())
    };
    let said = check();
    assert!(said.0 == Some(0) && !said.1.contains("too slow"), "velocity_servo: {}", said.1);
    let text = std::fs::read_to_string(site.config()).unwrap();
    let default = text.replace(", law = \"velocity_servo\"", "");
    std::fs::write(site.config(), &default).unwrap();
    let said = check();
    let warned =
        said.1.contains("WARNING: ") && said.1.contains("rate_hz` = 10 is too slow for `model2_inversion`");
    assert!(said.0 == Some(0) && warned, "{}", said.1);
    std::fs::write(site.config(), default.replace("rate_hz = 10", "rate_hz = 50")).unwrap();
    assert!(!check().1.contains("too slow"), "{}", check().1);
}
