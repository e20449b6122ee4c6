//! Recordings that others measured, through the built program.

use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;

fn kort(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_kort")).args(arguments).output().unwrap()
}

const ROTOR: &str = "config/thrusters/rosa-rotor.toml";
const EASED_ONCE: &str = "tests/recordings/rosa-rotor-air-d445.csv";
const MOVED: &str = "tests/recordings/rosa-rotor-air-d439.csv";

/// What is said of a brake that was moved three times.
fn moved() -> &'static Value {
    static REPORT: OnceLock<Value> = OnceLock::new();
    REPORT.get_or_init(|| diagnose(MOVED, ROTOR, "rosa-rotor-air"))
}

fn diagnose(recording: &str, rig: &str, columns: &str) -> Value {
    let output = kort(&["diagnose", recording, "--rig", rig, "--columns", columns, "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// The answer that the column map hides: when the person changed the brake, s.
fn brake_changes(recording: &str) -> Vec<f64> {
    let text = std::fs::read_to_string(recording).unwrap();
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let level = header.iter().position(|c| *c == "damping_level").unwrap();
    let rows: Vec<(f64, &str)> = lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            (cells[0].parse::<f64>().unwrap() / 1000.0, cells[level])
        })
        .collect();
    rows.windows(2).filter(|w| w[0].1 != w[1].1).map(|w| w[1].0).collect()
}

/// Sizes and instants of the changes of the load that a report tells, in order of time.
fn changes_told(report: &Value) -> Vec<(f64, f64)> {
    let list = report["empirical_term"]["parameters"].as_array().unwrap();
    let value =
        |name: String| list.iter().find(|p| p["name"] == name.as_str()).map(|p| p["value"].as_f64().unwrap());
    let change = |k: usize| Some((value(format!("torque_{k}_n_m"))?, value(format!("from_{k}_s"))?));
    let mut changes: Vec<(f64, f64)> = (1..=4).filter_map(change).collect();
    changes.sort_by(|a, b| a.1.total_cmp(&b.1));
    changes
}

#[test]
fn a_brake_moved_in_mid_run_is_found_when_and_where_it_was() {
    // Eased once; tightened, then eased twice.
    let once = diagnose(EASED_ONCE, ROTOR, "rosa-rotor-air");
    for (recording, signs, report) in [(EASED_ONCE, &[1.0][..], &once), (MOVED, &[-1.0, 1.0, 1.0], moved())] {
        let notes = report["notes"].to_string();
        assert!(notes.contains("leaves out: damping_level"), "the answer is hidden: {notes}");

        assert_eq!(report["verdict"], "unexplained", "{}", report["summary"]);
        assert_eq!(report["mismatch"][0]["path"], "shaft");
        assert_eq!(report["empirical_term"]["path"], "shaft");
        let (truth, told) = (brake_changes(recording), changes_told(report));
        assert_eq!(told.len(), truth.len(), "{told:?}, moved at {truth:?}");
        for (((torque, onset), moved), sign) in told.iter().zip(&truth).zip(signs) {
            assert!((onset - moved).abs() < 0.3, "found at {onset} s, moved at {moved} s");
            assert!(
                torque * sign > 0.0,
                "torque comes free where the brake is eased: {torque} N m at {onset} s"
            );
        }
        let removed = report["empirical_term"]["heldout"]["excess_error_removed"].as_f64().unwrap();
        assert!(removed > 0.7, "{removed}");
    }
}

#[test]
fn a_clock_that_does_not_begin_at_zero_shifts_what_is_placed_in_time_and_nothing_else() {
    const SHIFT_S: f64 = 1000.0;
    let shifted = format!("{}/rosa-rotor-air-shifted.csv", env!("CARGO_TARGET_TMPDIR"));
    let shift = |line: &str| match line.split_once(',') {
        Some((stamp, rest)) if stamp != "t_ms" => {
            format!("{},{rest}\n", stamp.parse::<f64>().unwrap() + 1000.0 * SHIFT_S)
        }
        _ => format!("{line}\n"),
    };
    let text: String = std::fs::read_to_string(MOVED).unwrap().lines().map(shift).collect();
    std::fs::write(&shifted, text).unwrap();

    let here = changes_told(moved());
    let there = changes_told(&diagnose(&shifted, ROTOR, "rosa-rotor-air"));
    assert_eq!(here.len(), there.len(), "{here:?} {there:?}");
    for (here, there) in here.iter().zip(&there) {
        assert!((there.1 - here.1 - SHIFT_S).abs() < 0.05, "{here:?} {there:?}");
        assert!((there.0 - here.0).abs() < 0.05 * here.0.abs(), "{here:?} {there:?}");
    }
}

#[test]
fn a_log_of_commands_alone_says_what_it_lacks_and_that_the_supply_sags() {
    let recording = "tests/recordings/vortex-auv-pool-heave-1.csv";
    let columns = ["--columns", "vortex-auv-pool"];
    for command in ["diagnose", "fit"] {
        let rig = ["--rig", "config/thrusters/t200.toml"];
        let output = kort(&[&[command, recording][..], &rig, &columns].concat());
        let said = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.contains("no measured response beside it") && said.contains("hint:"), "{said}");
        assert!(said.contains("supply_v sags as the 8 commands together rise"), "{said}");
    }
}

/// Licensed sets with their keys, on a clean clone; of the four the one whose search takes a minute is left out.
#[test]
fn measured_sets_are_held_against_their_keys() {
    const SETS: [&str; 3] = ["bam-xl330", "laas-cogging", "tud-prop-windtunnel"];
    let folder = tempfile::tempdir().unwrap();
    for set in SETS {
        let there = format!("{}/tests/recordings/measured/{set}", env!("CARGO_MANIFEST_DIR"));
        std::os::unix::fs::symlink(there, folder.path().join(set)).unwrap();
    }
    let output = kort(&["prove", "--measured", folder.path().to_str().unwrap(), "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let proof: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(proof["schema"], "kort.prove/1");
    let sets = proof["sets"].as_array().unwrap();
    let names: Vec<&str> = sets.iter().map(|set| set["set"].as_str().unwrap()).collect();
    assert_eq!(names, SETS);
    for set in sets {
        for list in ["present", "found", "missed", "sure_and_wrong", "not_in_catalogue"] {
            assert!(set[list].is_array(), "{}: {list}", set["set"]);
        }
        // Found, listed and missed are all that is present, once.
        let count = |list: &str| set[list].as_array().unwrap().len();
        assert_eq!(count("present"), count("found") + count("listed") + count("missed"), "{set}");
    }
    for measure in ["named", "sure_and_wrong", "sizes_within_20_pct", "median_excess_error_removed"] {
        assert!(proof["measures"][measure]["denominator"].is_number(), "{measure}");
    }
    // Dry friction of a free motor, of the size that its origin's data give.
    let motor = &sets[1];
    assert!(motor["found"].as_array().unwrap().contains(&"coulomb_friction".into()), "{motor}");
}

#[test]
fn a_set_that_is_not_there_is_named_with_those_that_are() {
    let output = kort(&["prove", "--measured", "tests/recordings/measured", "--set", "servo"]);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(2), "{said}");
    let names = "bam-xl330, laas-cogging, sar-prop-step, tud-prop-windtunnel";
    assert!(said.contains(&format!("hint: one of {names}")), "{said}");
}
