//! Tables whose stamps are dates with their time of day, as loggers and spreadsheets write them.

use std::fmt::Write;
use std::path::Path;

use kort_recording::Recording;

use crate::lab::{self, json, kort, stderr, write};
use crate::{columns, field, read, topic};

/// The time of day so many ms after 23:59:55 on 30 April 2024.
fn stamp(ms: u64) -> (&'static str, String) {
    let of_day = (86_395_000 + ms) % 86_400_000;
    let (s, ms) = (of_day / 1000, of_day % 1000);
    let day = if of_day < 43_200_000 { "01.05.2024" } else { "30.04.2024" };
    (day, format!("{:02}:{:02}:{:02},{ms:03}", s / 3600, s / 60 % 60, s % 60))
}

/// The map that `kort columns` writes for a log, and its text.
fn proposed(log: &str) -> (String, String) {
    let map = format!("{log}.toml");
    let said = kort(&["columns", log, "-o", &map]);
    assert!(matches!(said.status.code(), Some(0 | 3)), "{}", stderr(&said));
    let text = std::fs::read_to_string(&map).unwrap();
    (map, text)
}

/// An example case as a German logger writes it, over midnight: from the log to the name of what was hidden in it.
#[test]
fn a_log_with_dates_is_diagnosed_by_what_is_proposed_for_it() {
    let [example, rig] = lab::example("coulomb-friction").map(|path| path.to_str().unwrap().to_owned());
    let plain = Recording::read(Path::new(&example), None).unwrap();
    let names: Vec<&str> = plain.columns.iter().map(|column| column.name.as_str()).collect();
    let mut text = format!("Zeit;{}\r\n", names.join(";"));
    for (row, time_s) in plain.time_s.iter().enumerate() {
        let (day, clock) = stamp((time_s * 1000.0).round() as u64);
        let _ = write!(text, "{day} {clock}");
        for column in &plain.columns {
            let value = column.values[row];
            let cell = if value.is_nan() { String::new() } else { value.to_string().replace('.', ",") };
            let _ = write!(text, ";{cell}");
        }
        text += "\r\n";
    }
    let log = write("dated.csv", text);
    let found = columns(&log);
    assert_eq!(field(topic(&found, ""), "Zeit")["unit"], "date", "{found}");
    assert_eq!(topic(&found, "")["messages_read"], plain.rows());
    let (map, text) = proposed(&log);
    assert!(text.contains("source = \"Zeit\"\nunit = \"date\"\norder = \"day-first\"\n\n"), "{text}");

    let recording = read(&log, &map);
    let off_s = recording.time_s.iter().zip(&plain.time_s).map(|(dated, plain)| (dated - plain).abs());
    assert!(off_s.fold(0.0, f64::max) < 1e-9, "the stamps are whole milliseconds");
    let said = "time_s counts from 30.04.2024 23:59:55,000";
    assert!(recording.notes.iter().any(|note| note == said), "{:?}", recording.notes);
    assert!(recording.losses.is_empty(), "{:?}", recording.losses);

    let report = json(&kort(&["diagnose", &log, "--rig", &rig, "--columns", &map, "--json"]));
    assert_eq!(report["verdict"], "explained", "{}", report["summary"]);
    assert_eq!(report["findings"][0]["effect"], "coulomb_friction", "{}", report["summary"]);
}

/// Whole seconds, ten rows in each: refused by line, with both stamps and what to do; nothing is proposed that would drop nine rows
/// of ten.
#[test]
fn stamps_that_are_coarser_than_the_rows_are_refused() {
    let mut text = String::from("Date,Speed (rpm),Force (N)\n");
    for k in 0..600 {
        let _ = writeln!(text, "2024-05-01 12:00:{:02},{},{}", k / 10, 100 + k, k % 50);
    }
    let log = write("coarse.csv", text);
    let (map, text) = proposed(&log);
    assert!(
        text.contains("unit = \"date\"\n# stale_rows = \"drop\"   would leave the lesser part"),
        "{text}"
    );
    let refused = kort(&["convert", &log, "--columns", &map, "-o", &lab::path("coarse-si.csv")]);
    let words = stderr(&refused);
    assert_eq!(refused.status.code(), Some(2), "{words}");
    for part in [
        "coarse.csv",
        "line 3",
        "`Date` = 2024-05-01 12:00:00 does not come after 2024-05-01 12:00:00",
        "fractions of a second",
    ] {
        assert!(words.contains(part), "{part} in {words}");
    }
}

/// A clock that is set back in autumn parts the log as any clock that begins anew.
#[test]
fn a_clock_that_is_set_back_parts_the_log() {
    let mut text = String::from("when,Speed (rpm),Force (N)\n");
    for k in 0..600 {
        let of_hour_s = if k < 400 { 53 * 60 + k } else { k - 400 };
        let (minute, second) = (of_hour_s / 60, of_hour_s % 60);
        let _ = writeln!(text, "10/27/2024 2:{minute:02}:{second:02} AM,{},{}", 100 + k, k % 50);
    }
    let log = write("set-back.csv", text);
    let (map, text) = proposed(&log);
    assert!(
        text.contains("source = \"when\"\nunit = \"date\"\norder = \"month-first\"\nstale_rows = \"drop\""),
        "{text}"
    );
    let recording = read(&log, &map);
    assert_eq!((recording.rows(), recording.time_s[0]), (400, 0.0));
    assert!(recording.losses[0].contains("begins anew 1 time(s)"), "{:?}", recording.losses);
}

/// Read as numbers, dates are refused with the key that reads them; so is what the map says amiss.
#[test]
fn what_is_amiss_with_dates_is_said_with_what_to_do() {
    let log =
        write("plain-dates.csv", "t,F\n2024-05-01 12:00:00.0,1\n2024-05-01 12:00:00.1,2\nyesterday,3\n");
    let refused = |time: &str, parts: &[&str]| {
        let map =
            format!("[time]\nsource = \"t\"\n{time}\n[columns.thrust_n]\nsource = \"F\"\nunit = \"N\"\n");
        let map = write("plain-dates.toml", map);
        let said = kort(&["convert", &log, "--columns", &map, "-o", &lab::path("plain-dates-si.csv")]);
        let words = stderr(&said);
        assert_eq!(said.status.code(), Some(2), "{words}");
        for part in parts.iter().chain(&["hint:"]) {
            assert!(words.contains(part), "{part} in {words}");
        }
    };
    refused("unit = \"s\"", &["line 2, column `t`: \"2024-05-01 12:00:00.0\"", "unit = \"date\""]);
    refused("unit = \"date\"", &["line 4, column `t`: \"yesterday\" is no date", "year-first"]);
    refused("unit = \"date\"\norder = \"day-first\"", &["line 2", "day-first; allowed: "]);
    refused(
        "unit = \"date\"\norder = \"dmy\"",
        &["`time.order` = \"dmy\" is outside what is allowed: \"year-first\", \"day-first\""],
    );
    refused("unit = \"ms\"\norder = \"day-first\"", &["`time.order` needs unit = \"date\""]);
    refused("unit = \"day\"", &["`time.unit` = \"day\"", "\"min\", \"date\""]);
}
