//! Tables as European spreadsheets and DIAdem write them: semicolons, decimal commas, units in a row of their own.

use std::fmt::Write;

use crate::lab::{self, kort, stderr, write};
use crate::{columns, read, topic};

/// A bench's log of 400 rows.
fn bench() -> String {
    let mut text = String::from("Time;Motor Current;Speed;Force\r\n[s];[mA];[U/min];[N]\r\n");
    let comma = |x: f64| format!("{x:.4}").replace('.', ",");
    for k in 0..400 {
        let t = 0.01 * f64::from(k);
        let (current, speed, force) = (1500.0 * t.sin(), 900.0 * t.cos(), 20.5 * t.sin());
        let _ = writeln!(text, "{};{};{};{}\r", comma(t), comma(current), comma(speed), comma(force));
    }
    write("european.csv", text)
}

#[test]
fn a_table_with_decimal_commas_and_units_below_the_names_comes_in_as_proposed() {
    let log = bench();
    let found = columns(&log);
    let rows = topic(&found, "");
    assert_eq!((&rows["messages"], &rows["messages_read"]), (&400.into(), &400.into()), "{found}");
    let unit =
        |place: usize| (rows["fields"][place]["unit"].as_str(), rows["fields"][place]["unit_from"].as_str());
    assert_eq!(unit(1), (Some("mA"), Some("format")));
    assert_eq!(unit(2), (Some("U/min"), Some("format")));
    let map = lab::path("european.toml");
    let said = kort(&["columns", &log, "-o", &map]);
    assert_eq!(said.status.code(), Some(0), "{}", stderr(&said));
    let recording = read(&log, &map);
    assert_eq!(recording.rows(), 400);
    // As many digits as the file has.
    assert!((recording.column("current_a").unwrap()[100] - 1.5 * 1.0_f64.sin()).abs() < 1e-7);
    let turns_s = 900.0 / 60.0 * 2.0_f64.cos();
    assert!(
        (recording.column("shaft_speed_rad_s").unwrap()[200] / std::f64::consts::TAU - turns_s).abs() < 1e-4
    );
    assert!(recording.losses.is_empty(), "{:?}", recording.losses);
}

/// What is asked of a shaft is in the turns of what it does.
#[test]
fn a_speed_in_hertz_is_turns_once_a_person_says_so() {
    let mut text = String::from("Time (s),Motor speed setpoint (Hz),Motor speed (Hz)\n");
    for row in 0..100 {
        let _ = writeln!(text, "{},{},{}", f64::from(row) * 0.01, row / 10, f64::from(row) / 10.0);
    }
    let log = write("hertz.csv", text);
    let map = lab::path("hertz.toml");
    let said = kort(&["columns", &log, "-o", &map]);
    assert_eq!(said.status.code(), Some(0), "{}", stderr(&said));
    let proposed = std::fs::read_to_string(&map).unwrap();
    assert_eq!(proposed.matches("\n# unit = \"rev/s\"").count(), 2, "{proposed}");
    std::fs::write(
        &map,
        proposed.replace("\n# unit", "\nunit").replace("   the log says", " # the log says"),
    )
    .unwrap();
    let recording = read(&log, &map);
    for (column, turns_s) in [("speed_cmd_rad_s", 5.0), ("shaft_speed_rad_s", 5.5)] {
        let there = recording.column(column).unwrap()[55];
        assert!((there / std::f64::consts::TAU - turns_s).abs() < 1e-9, "{column} {there}");
    }
}

#[test]
fn what_was_written_is_said_as_one_document() {
    let log = write("written.csv", "Time (s),RPM,Thrust (N),note\n0,1,N/A,a\n1,2,5,b\n2,4,6,c\n");
    let (map, out) = (lab::path("written.toml"), lab::path("written.out.csv"));
    let said = kort(&["columns", &log, "-o", &map]);
    assert_eq!(said.status.code(), Some(3), "a value is lost: {}", stderr(&said));
    let said = kort(&["convert", &log, "--columns", &map, "-o", &out, "--json"]);
    assert_eq!(said.status.code(), Some(3), "{}", stderr(&said));
    let written: serde_json::Value = serde_json::from_slice(&said.stdout).unwrap();
    assert_eq!(written["schema"], "kort.convert/1");
    assert_eq!(
        (&written["rows"], &written["output"], &written["to_s"]),
        (&3.into(), &out.into(), &2.0.into())
    );
    assert_eq!(written["columns"][1], serde_json::json!({ "name": "thrust_n", "unit": "N", "samples": 2 }));
    assert_eq!(written["unused"], serde_json::json!(["note"]));
    assert!(written["losses"][0].as_str().unwrap().contains("`Thrust (N)`"), "{written}");
}

#[test]
fn what_is_only_an_example_and_what_never_changes_is_said() {
    let vesc = write(
        "vesc-example.csv",
        "ms_today;input_voltage;temp_mos_max;temp_motor;current_motor;current_in;erpm;duty_cycle\n10;24;30;28;1;1;700;0.2\n20;24;31;29;2;2;800;0.3\n",
    );
    let words = |log: &str| String::from_utf8_lossy(&kort(&["columns", log]).stdout).into_owned();
    let said = words(&vesc);
    assert!(said.contains("pole_pairs=7 below is an example: write yours"), "{said}");
    let still = words(&write("still.csv", "Time (s),RPM,Thrust (N)\n0,100,5\n1,100,5\n"));
    assert!(still.contains("RPM, Thrust (N) never change in it"), "{still}");
    let short = words(&write("short.csv", "Time (s),RPM,Thrust (N)\n0,100,5\n"));
    assert!(short.contains("1 row(s) in it, and at least 2 are needed"), "{short}");
}

/// Without the map's word it is refused, by line and cell, and with what to do.
#[test]
fn a_decimal_comma_that_nobody_spoke_of_is_refused() {
    let log = bench();
    let map = lab::path("pointed.toml");
    let text = "delimiter = \";\"\n[time]\nsource = \"Time\"\nunit = \"s\"\n[columns.thrust_n]\nsource = \"Force\"\nunit = \"N\"\n";
    std::fs::write(&map, text).unwrap();
    let refused = kort(&["convert", &log, "--columns", &map, "-o", &lab::path("pointed.csv")]);
    let words = stderr(&refused);
    assert_eq!(refused.status.code(), Some(2), "{words}");
    for part in ["line 3", "`Time`", "\"0,0000\"", "decimal = \",\"", "kort columns"] {
        assert!(words.contains(part), "{part} in {words}");
    }
}
