//! Tables of others: units below the names, decimal commas. What is proposed for them reads them to the same numbers, and no
//! table of another kind is taken for one.

mod cells;
mod names;
mod short;

use proptest::prelude::*;

use crate::map::ColumnMap;
use crate::recording::Recording;
use crate::{Place, Problem, Survey, survey};

fn surveyed(text: &str) -> Survey {
    survey("log.csv", text.as_bytes()).unwrap()
}

fn through(text: &str, map: &str) -> Recording {
    let map = ColumnMap::from_toml("proposed", map).unwrap();
    Recording::decode("log.csv", text.as_bytes(), Some(&map)).unwrap()
}

const BENCH: &str =
    "Time;Speed;Force;Remark\r\ns;1/min;N;-\r\n0,0;600;-1,5;start\r\n0,1;1200;2,25;\r\n0,2;600,5;3;\r\n";

#[test]
fn a_table_of_european_excel_comes_in_by_what_is_proposed_for_it() {
    let found = surveyed(BENCH);
    let fields = &found.topics[0].fields;
    let units: Vec<_> = fields.iter().map(|field| (field.unit.as_deref(), field.unit_from)).collect();
    let said = |unit| (Some(unit), Some("format"));
    assert_eq!(units, [said("s"), said("1/min"), said("N"), (None, None)]);
    assert_eq!((fields[2].min, fields[2].max, fields[2].texts), (Some(-1.5), Some(3.0), 0));
    assert_eq!((found.clock, found.topics[0].messages), ("those of its time column", 3));
    assert_eq!(found.notes.len(), 2, "{:?}", found.notes);
    let map = found.proposal.map.unwrap();
    for line in ["delimiter = \";\"", "decimal = \",\"", "unit = \"s\"", "unit = \"rpm\"", "unit = \"N\""] {
        assert!(map.contains(line), "{line} in {map}");
    }
    let read = through(BENCH, &map);
    assert_eq!(read.time_s, [0.0, 0.1, 0.2]);
    assert_eq!(read.column("thrust_n").unwrap(), [-1.5, 2.25, 3.0]);
    let speed = read.column("shaft_speed_rad_s").unwrap();
    assert!((speed[2] - 600.5 * std::f64::consts::TAU / 60.0).abs() < 1e-9, "{speed:?}");
    assert!(read.notes.iter().any(|note| note.contains("line 2 holds units")), "{:?}", read.notes);
    // A map that reads a column in another unit than stands below its name does so, and it is said.
    let other = through(BENCH, &map.replace("unit = \"N\"", "unit = \"kN\""));
    assert!(
        other.notes.iter().any(|note| note.contains("`Force` in N") && note.contains("in kN")),
        "{:?}",
        other.notes
    );
}

#[test]
fn units_below_names_of_our_own_repeat_them_or_are_refused() {
    let of = |units: &str| {
        let text = format!("time_s,thrust_n,duty_cmd\n{units}\n0,1,0.1\n1,2,0.2\n");
        Recording::decode("rec.csv", text.as_bytes(), None)
    };
    assert_eq!(of("s,N,-").unwrap().column("thrust_n").unwrap(), [1.0, 2.0]);
    for units in ["ms,N,-", "s,kN,-", "s,lbs,-"] {
        let error = of(units).unwrap_err();
        assert!(matches!(error.problem, Problem::NotANumber { place: Place::Line(2), .. }), "{error}");
    }
    assert!(of("ms,N,-").unwrap_err().to_string().contains("must repeat the units"));
}

#[test]
fn decimal_marks_that_do_not_agree_are_named_by_line() {
    let mixed = BENCH.replace("2,25", "2.25");
    let found = surveyed(&mixed);
    assert!(found.notes.iter().any(|note| note.contains("\"0,0\" (line 3)")), "{:?}", found.notes);
    let map = surveyed(BENCH).proposal.map.unwrap();
    let refused = |text: &str, map: &str| {
        let map = ColumnMap::from_toml("m", map).unwrap();
        Recording::decode("log.csv", text.as_bytes(), Some(&map)).unwrap_err().to_string()
    };
    let words = refused(&mixed, &map);
    for part in ["line 4", "`Force`", "\"2.25\" has a point", "hint: "] {
        assert!(words.contains(part), "{part} in {words}");
    }
    let words = refused(BENCH, &map.replace("decimal = \",\"", "decimal = \".\""));
    for part in ["line 3", "\"0,0\" is not a number", "hint: a decimal comma is read where"] {
        assert!(words.contains(part), "{part} in {words}");
    }
    let error = ColumnMap::from_toml("m", &map.replace("decimal = \",\"", "decimal = \";\"")).unwrap_err();
    assert!(error.to_string().contains("`decimal` = \";\" is outside what is allowed: "), "{error}");
}

/// The number of a line counts ends of two signs as one.
#[test]
fn a_line_has_its_number_whatever_ends_it() {
    for end in ["\n", "\r\n"] {
        for (rows, place) in [("0,x", 2), ("0,1{end}1,x", 3), ("0,1{end}1,2{end}2,3,4{end}", 4)] {
            let text = format!("time_s,thrust_n{end}{}", rows.replace("{end}", end));
            let error = Recording::decode("rec.csv", text.as_bytes(), None).unwrap_err().to_string();
            assert!(error.contains(&format!("line {place}")), "{end:?} {error}");
        }
    }
}

/// As it is read where the decimal mark is a point.
fn cell() -> impl Strategy<Value = String> {
    let number = || (-1e9..1e9_f64).prop_map(|x| x.to_string());
    let word =
        prop::sample::select(vec!["", "1,5", "1,234", "s", "N", "rpm", "a1", "12:00:00,5", "3", "-7", "1e3"]);
    prop_oneof![number(), word.prop_map(str::to_owned)]
}

proptest! {
    /// Whatever the numbers, delimiter and way to write units: what is proposed reads them bit by bit.
    #[test]
    fn a_proposed_map_gives_back_the_numbers(
        rows in prop::collection::vec((1e-6..10.0_f64, -1e12..1e12_f64), 2..40),
        tab: bool,
        brackets: bool,
        comma: bool,
        below: bool,
    ) {
        let mark = |x: f64| if comma { x.to_string().replace('.', ",") } else { x.to_string() };
        let unit = |unit: &str| if brackets { format!("[{unit}]") } else { unit.to_owned() };
        let cut = if tab { '\t' } else { ';' };
        let mut text = if below {
            format!("Time{cut}Force\n{}{cut}{}\n", unit("s"), unit("N"))
        } else {
            format!("Time [s]{cut}Force [N]\n")
        };
        let (mut now, mut time_s) = (0.0, Vec::new());
        for (step, value) in &rows {
            now += step;
            time_s.push(now);
            text += &format!("{}{cut}{}\n", mark(now), mark(*value));
        }
        let values: Vec<f64> = rows.iter().map(|(_, value)| *value).collect();
        prop_assume!(values.windows(2).any(|pair| pair[0] != pair[1]));
        let found = surveyed(&text);
        prop_assert_eq!(found.topics[0].messages, rows.len());
        let read = through(&text, &found.proposal.map.unwrap());
        prop_assert_eq!(&read.time_s, &time_s);
        prop_assert_eq!(read.column("thrust_n").unwrap(), values.as_slice());
    }

    /// A table with one number that has a decimal point is counted as it always was, whatever stands beside it.
    #[test]
    fn a_table_with_a_decimal_point_is_read_by_points(
        rows in prop::collection::vec(prop::collection::vec(cell(), 3), 1..20),
        place in any::<prop::sample::Index>(),
    ) {
        let mut rows = rows;
        let at = place.index(rows.len());
        rows[at][0] = "0.5".into();
        // A first row of units alone is no row.
        rows.insert(0, ["0", "0", "0"].map(str::to_owned).to_vec());
        let lines: Vec<String> = rows.iter().map(|row| row.join(";")).collect();
        let found = surveyed(&format!("a;b;c\n{}\n", lines.join("\n")));
        for (column, field) in found.topics[0].fields.iter().enumerate() {
            let cells = rows.iter().map(|row| row[column].as_str());
            let numbers = cells.clone().filter(|cell| cell.parse::<f64>().is_ok()).count();
            let texts = cells.filter(|cell| !cell.is_empty() && cell.parse::<f64>().is_err()).count();
            prop_assert_eq!((field.samples, field.texts), (numbers as u64, texts as u64));
        }
    }
}
