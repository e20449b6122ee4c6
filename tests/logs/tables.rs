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
