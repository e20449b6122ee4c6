//! Logs as instruments and spreadsheets leave them: lines about the measurement before the names, Excel's `sep=;`, letters that are no
//! UTF-8, UTF-16. What is passed over is said; what cannot be read is refused by file and line, with what to do.

use std::fmt::Write;

use serde_json::Value;

use crate::lab::{self, kort, stderr, write};
use crate::{columns, field, read, topic};

const NAMES: &str = "Zeit [s];Drehzahl [1/min];Motorstrom [A];Schub [N];Temperatur [°C];Bemerkung";

/// Rows of a bench, with decimal commas.
fn rows(names: &str) -> String {
    let mut text = format!("{names}\r\n");
    let comma = |x: f64| format!("{x:.4}").replace('.', ",");
    for k in 0..200 {
        let t = 0.01 * f64::from(k);
        let word = if k == 3 { "größer" } else { "" };
        let _ = write!(
            text,
            "{};{};{};{};{};{word}\r\n",
            comma(t),
            comma(900.0 * t.cos()),
            comma(2.0 * t.sin()),
            comma(20.5 * t.sin()),
            comma(21.0 + t)
        );
    }
    text
}

const ABOUT: &str =
    "Prüfstand 3, Strömungskanal\r\nDatum;03.04.2024 11:20\r\nAbtastrate;100\r\nKanäle;6\r\n\r\n";

fn latin1(text: &str) -> Vec<u8> {
    text.chars().map(|c| u8::try_from(c).unwrap()).collect()
}

fn utf16(text: &str, bytes: fn(u16) -> [u8; 2], mark: bool) -> Vec<u8> {
    let text = if mark { format!("\u{feff}{text}") } else { text.to_owned() };
    text.encode_utf16().flat_map(bytes).collect()
}

fn notes(found: &Value) -> String {
    found["notes"].to_string()
}

/// The map that `kort columns` writes for this log.
fn proposed(log: &str) -> String {
    let map = format!("{log}.toml");
    let said = kort(&["columns", log, "-o", &map]);
    assert_eq!(said.status.code(), Some(0), "{}", stderr(&said));
    map
}

#[test]
fn a_bench_log_comes_in_whatever_its_instrument_wrote_around_it() {
    let text = rows(NAMES);
    let padded = ABOUT.replace(";6\r\n", ";6;;;;\r\n;;;;;\r\n");
    for (name, bytes, skipped) in [
        ("plain", text.clone().into_bytes(), ""),
        ("mark", format!("\u{feff}{text}").into_bytes(), ""),
        ("sep", format!("sep=;\r\n{text}").into_bytes(), "line 1 says that the cells are parted by ';'"),
        ("about", format!("{ABOUT}{text}").into_bytes(), "lines 1 to 5 stand before the names"),
        ("padded", format!("{padded}{text}").into_bytes(), "lines 1 to 6 stand before the names"),
        ("both", format!("sep=;\r\n{ABOUT}{text}").into_bytes(), "lines 2 to 6 stand before the names"),
        ("hash", format!("# kort's bench, no. 3\r\n{text}").into_bytes(), "line 1 stands before the names"),
        ("latin1", latin1(&format!("{ABOUT}{text}")), "no UTF-8 (the first in line 6)"),
        ("utf16le", utf16(&format!("{ABOUT}{text}"), u16::to_le_bytes, true), "lines 1 to 5 stand"),
        ("utf16be", utf16(&text, u16::to_be_bytes, true), ""),
    ] {
        let log = write(&format!("around-{name}.csv"), bytes);
        let found = columns(&log);
        assert!(notes(&found).contains(skipped), "{name}: {}", notes(&found));
        assert_eq!(topic(&found, "")["messages_read"], 200, "{name}: {found}");
        assert_eq!(field(topic(&found, ""), "Temperatur [°C]")["unit"], "C", "{name}");
        let recording = read(&log, &proposed(&log));
        assert_eq!(recording.rows(), 200, "{name}");
        assert!(recording.losses.is_empty(), "{name}: {:?}", recording.losses);
        assert!(recording.notes.join(";").contains(skipped), "{name}: {:?}", recording.notes);
        for (column, value) in [
            ("thrust_n", 20.5 * 1.0_f64.sin()),
            ("current_a", 2.0 * 1.0_f64.sin()),
            ("shaft_speed_rad_s", 900.0 * 1.0_f64.cos() * std::f64::consts::TAU / 60.0),
            ("temperature_c", 22.0),
        ] {
            let read = recording.column(column).unwrap_or_else(|| panic!("{name}: no {column}"))[100];
            assert!((read - value).abs() < 1e-3, "{name}: {column} {read} {value}");
        }
    }
}

/// What was passed over is also in the report of a diagnosis, and on stderr of what converts.
#[test]
fn what_stands_before_the_names_is_said_where_a_log_is_used() {
    let text = format!("Instrument: NI 9237\nOperator: Müller\n\n{}", rows(NAMES));
    let log = write("used.csv", latin1(&text));
    let map = proposed(&log);
    let said = kort(&["convert", &log, "--columns", &map, "-o", &lab::path("used-si.csv")]);
    let words = stderr(&said);
    assert_eq!(said.status.code(), Some(0), "{words}");
    for part in ["lines 1 to 3 stand before the names", "NI 9237", "Müller", "Windows-1252"] {
        assert!(words.contains(part), "{part} in {words}");
    }
    let said = kort(&["fit", &log, "--rig", "t200", "--columns", &map]);
    let report = String::from_utf8_lossy(&said.stdout);
    assert!(report.contains("lines 1 to 3 stand before the names"), "{report} {}", stderr(&said));
}

/// Lines are counted from the file's first, and a recording of our own may have words before its names too.
#[test]
fn an_error_below_a_preamble_names_its_line() {
    let own = "bench 3, water at 18 C\n\ntime_s,current_cmd_a,thrust_n\n0,1,2\n1,1,x\n";
    let log = write("own-preamble.csv", own);
    let said = kort(&["convert", &log, "-o", &lab::path("own-preamble-si.csv")]);
    assert_eq!(said.status.code(), Some(2));
    assert!(stderr(&said).contains("line 5, column `thrust_n`: \"x\""), "{}", stderr(&said));
}

#[test]
fn what_no_table_can_be_is_refused_by_line_and_with_what_to_do() {
    let text = rows(NAMES);
    for (name, bytes, words) in [
        ("unmarked", utf16(&text, u16::to_le_bytes, false), ["line 1", "UTF-16", "iconv"]),
        ("bar", format!("sep=|\r\n{text}").into_bytes(), ["line 1", "'|'", "allowed: ',', ';' or '\\t'"]),
        (
            "sjis",
            [b"Zeit;\x83\x90\x8d\x81\r\n", &b"0;1\r\n1;2\r\n"[..]].concat(),
            ["line 1", "UTF-8", "Windows-1252"],
        ),
    ] {
        let log = write(&format!("refused-{name}.csv"), bytes);
        let said = kort(&["columns", &log]);
        let error = stderr(&said);
        assert_eq!(said.status.code(), Some(2), "{error}");
        for word in words.iter().chain(&["hint: ", log.as_str()]) {
            assert!(error.contains(word), "{word} in {error}");
        }
    }
    let log = write("refused-beside.csv", format!("sep=;\r\n{text}"));
    let map = proposed(&log);
    let tabs = std::fs::read_to_string(&map).unwrap().replace("delimiter = \";\"", "delimiter = \"\\t\"");
    std::fs::write(&map, tabs).unwrap();
    let said = kort(&["convert", &log, "--columns", &map, "-o", &lab::path("beside.csv")]);
    assert_eq!(said.status.code(), Some(2));
    assert!(stderr(&said).contains("allowed: '\\t', as the column map has it"), "{}", stderr(&said));
}

/// Names of stamps that people write.
#[test]
fn a_column_of_time_is_proposed_with_its_unit() {
    for (name, unit) in [
        ("Zeit [s]", "unit = \"s\""),
        ("Zeit", "# unit = "),
        ("time [s]", "unit = \"s\""),
        ("Time (ms)", "unit = \"ms\""),
        ("Messzeit [ms]", "unit = \"ms\""),
    ] {
        let log = write("stamps.csv", rows(&NAMES.replace("Zeit [s]", name)));
        let map = columns(&log)["proposal"]["map"].as_str().unwrap().to_owned();
        let time = map.split("[columns").next().unwrap();
        assert!(time.contains(&format!("source = {name:?}\n{unit}")), "{name}: {map}");
    }
}
