//! Clocks of logs: those that begin anew, and those that count from 1970.

use std::fmt::Write;

use crate::lab::{self, kort, stderr, write};
use crate::{columns, near, read, topic};

/// VESC Tool counts milliseconds of the day.
fn over_midnight() -> String {
    let mut text =
        String::from("ms_today;input_voltage;temp_motor;current_motor;current_in;erpm;duty_cycle;\n");
    for k in 0..3000_u64 {
        let stamp_ms = (86_400_000 - 250 * 50 + 50 * k) % 86_400_000;
        let _ = writeln!(text, "{stamp_ms};24.5;28;{};1.5;{};0.25;", 0.1 * (k % 30) as f64, 70 * k);
    }
    write("midnight.csv", text)
}

#[test]
fn a_table_over_midnight_is_read_where_it_is_longest() {
    let log = over_midnight();
    let said = kort(&["columns", &log]);
    let words = String::from_utf8_lossy(&said.stdout).into_owned();
    assert!(words.contains("the longest stretch is read") && words.contains("CSV, 137.5 s"), "{words}");
    assert!(words.contains("stale_rows = \"drop\""), "the proposed map parts it as well: {words}");
    let found = columns(&log);
    assert_eq!((&found["resets"], &topic(&found, "")["messages"]), (&1.into(), &3000.into()));
    // What is counted is told apart from what is read.
    assert_eq!(topic(&found, "")["messages_read"], 2750);
    assert!(words.contains("rows: 3000, of which 2750 are read, at 20.0 Hz"), "{words}");
    assert!(near(found["duration_s"].as_f64().unwrap(), 2749.0 * 0.05), "{}", found["duration_s"]);
    assert!(near(topic(&found, "")["from_s"].as_f64().unwrap(), 0.0));

    let output = lab::path("midnight-out.csv");
    let done = kort(&["convert", &log, "--columns", "vesc:pole_pairs=7", "-o", &output]);
    assert_eq!(done.status.code(), Some(3), "{}", stderr(&done));
    assert!(String::from_utf8_lossy(&done.stdout).contains("2750 rows of"), "{done:?}");
    let lost = stderr(&done);
    assert!(lost.contains("begins anew 1 time(s)") && lost.contains("250 row(s) outside it"), "{lost}");
    let recording = read(&log, "vesc:pole_pairs=7");
    assert_eq!((recording.rows(), recording.time_s[0]), (2750, 0.0));
    assert!(near(recording.column("supply_v").unwrap()[2749], 24.5));
}

/// One stamp far off costs itself, as in a log of messages.
#[test]
fn one_damaged_stamp_of_a_table_parts_nothing() {
    let text = std::fs::read_to_string(over_midnight()).unwrap();
    let mut lines: Vec<String> = text.lines().skip(251).map(str::to_owned).collect();
    lines[1000] = lines[1000].replacen(|c: char| c.is_ascii_digit(), "86399999", 1);
    let header = text.lines().next().unwrap();
    let recording =
        read(&write("one-stamp.csv", format!("{header}\n{}\n", lines.join("\n"))), "vesc:pole_pairs=7");
    assert_eq!((recording.rows(), recording.losses.len()), (2749, 1), "{:?}", recording.losses);
    assert!(recording.losses[0].contains("1 row(s)"), "{:?}", recording.losses);
}

#[test]
fn stamps_since_1970_count_from_the_first_row() {
    for (log, map, rows) in [
        ("moteus_1_servo_stats.csv.gz", "moteus-tview", 500),
        ("two-drives.candump.log.gz", "vesc-can:id=05,pole_pairs=7", 1000),
    ] {
        let recording = read(&format!("tests/recordings/logs/{log}"), map);
        assert_eq!((recording.rows(), recording.time_s[0]), (rows, 0.0), "{log}");
        let said: Vec<&String> =
            recording.notes.iter().filter(|note| note.contains("count from 1970")).collect();
        assert_eq!(said.len(), 1, "{log}: {:?}", recording.notes);
    }
}
