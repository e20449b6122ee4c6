//! What is no log, or not quite the one that was meant: the message says what to do, and that is true.

use crate::lab::{self, kort, stderr, write};

fn refused(arguments: &[&str], words: &[&str]) -> String {
    let said = kort(arguments);
    assert_eq!(said.status.code(), Some(2), "{}", stderr(&said));
    let text = stderr(&said);
    for word in words.iter().chain(&["hint:"]) {
        assert!(text.contains(word), "no `{word}` in {text}");
    }
    text
}

#[test]
fn what_cannot_be_read_says_what_can() {
    let nonsense: Vec<u8> = (0..4000_u32).map(|k| (k * 167 % 251) as u8 | 0x80).collect();
    refused(
        &["columns", &write("nonsense.dat", nonsense)],
        &["begins like no log that kort reads", "PX4 ULog", "DataFlash", "blackbox", "candump"],
    );
    let packed = write("bag.db3.zstd", [&[0x28, 0xb5, 0x2f, 0xfd][..], &[7; 100]].concat());
    refused(&["columns", &packed], &["packed with zstd", "zstd -d"]);
    refused(&["convert", &packed, "-o", &lab::path("bag.csv")], &["packed with zstd", "zstd -d"]);

    let folder = lab::path("bag-folder");
    std::fs::create_dir_all(&folder).unwrap();
    refused(&["columns", &folder], &["is a folder", "no file in this folder"]);
    for part in ["run_1.db3", "run_0.db3", "metadata.yaml"] {
        std::fs::write(format!("{folder}/{part}"), "").unwrap();
    }
    refused(&["columns", &folder], &["is a folder", "bag-folder/run_0.db3"]);

    let vesc = write("vesc-plain.csv", "ms_today;erpm;duty_cycle\n1;2;3\n2;2;3\n");
    refused(&["fit", &vesc, "--rig", "t200"], &["time_s", "ms_today, erpm, duty_cycle", "kort columns"]);
}

/// This firmware logs no speed of the motors: a map without a response is for converting, and no field is what was meant.
#[test]
fn what_is_proposed_can_be_done() {
    let log = "tests/recordings/logs/betaflight-4.2.bfl.gz";
    let said = kort(&["columns", log]);
    let words = String::from_utf8_lossy(&said.stdout);
    assert!(
        words.contains("kort convert") && words.contains("--columns betaflight-vehicle:motor=0"),
        "{words}"
    );
    assert!(!words.contains("kort diagnose"), "{words}");
    let output = lab::path("vehicle.csv");
    let done = kort(&["convert", log, "--columns", "betaflight-vehicle:motor=0", "-o", &output]);
    assert_eq!(done.status.code(), Some(3), "{}", stderr(&done));
    let fit = ["fit", log, "--rig", "t200", "--columns", "betaflight:pole_pairs=7"];
    let words = refused(&fit, &["main.eRPM[0]", "kort columns"]);
    assert!(!words.contains("did you mean"), "{words}");
    let px4 = kort(&["columns", "tests/recordings/logs/px4-uavcan-escs.ulg.gz"]);
    assert!(String::from_utf8_lossy(&px4.stdout).contains("kort diagnose"), "{px4:?}");
}

/// As of a rig, a scenario or a controller: who mends a map does not meet the next mistake after each try.
#[test]
fn all_that_is_wrong_with_a_column_map_is_said_at_once() {
    let map = "decimal = \";\"\n[time]\nsource = \"t\"\nunit = \"h\"\n\
        [columns.thrust_n]\nsource = \"F\"\nunit = \"V\"\nsign = 2\n[columns.torque]\nsource = \"M\"\nunit = \"N m\"\n";
    let map = write("many-mistakes.toml", map);
    let log = write("many-mistakes.csv", "t,F,M\n0,1,2\n1,2,3\n");
    let all = [
        "`decimal` = \";\"",
        "`time.unit` = \"h\"",
        "`columns.thrust_n.unit` = \"V\"",
        "`columns.thrust_n.sign` = 2",
        "did you mean `torque_n_m`?",
    ];
    let words = refused(&["diagnose", &log, "--rig", "t200", "--columns", &map], &all);
    assert_eq!(words.matches("hint:").count(), all.len(), "{words}");
    let said = kort(&["check", &map, "--json"]);
    assert_eq!(said.status.code(), Some(2), "{}", stderr(&said));
    let report: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    let problems = report["problems"].as_array().unwrap();
    assert_eq!(problems.len(), all.len(), "{report}");
    let sign = problems.iter().find(|one| one["key"] == "columns.thrust_n.sign").unwrap();
    assert_eq!((&sign["found"], &sign["allowed"]), (&"2".into(), &"1 or -1".into()), "{sign}");
}
