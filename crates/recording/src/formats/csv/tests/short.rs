//! Rows that have fewer cells than the header has names, and the header once more among the rows.

use super::{surveyed, through};
use crate::error::{Place, Problem};
use crate::map::ColumnMap;
use crate::recording::Recording;

fn map(above: &str, thrust: &str) -> String {
    format!(
        "{above}\n[time]\nsource = \"t\"\nunit = \"s\"\n[columns.thrust_n]\nsource = {thrust:?}\nunit = \"N\"\n"
    )
}

fn refused(text: &str, map: Option<&str>) -> Problem {
    let map = map.map(|map| ColumnMap::from_toml("own", map).unwrap());
    Recording::decode("log.csv", text.as_bytes(), map.as_ref()).unwrap_err().problem
}

/// A name at the end, in the middle, one broken by its own comma, and an empty one.
const HEADERS: [(&str, &str); 4] = [
    ("t,RPM,Thrust,App message", "App message"),
    ("t,Supply (V),u,Thrust", "Supply (V)"),
    ("t,RPM (motor, mean),Thrust", "mean)"),
    ("t,,RPM,Thrust", "(column 2)"),
];

#[test]
fn which_name_of_a_header_has_no_cell_a_person_says_and_nobody_guesses() {
    for (header, name) in HEADERS {
        let text = format!("{header}\n0,7,1\n0.5,8,2\n1.0,9,3\n");
        let Problem::HeaderLonger { place, cells, names } = refused(&text, Some(&map("", "Thrust"))) else {
            panic!("{header}");
        };
        assert_eq!((place, cells, names.len()), (Place::Line(2), 3, 4), "{header}");
        let found = surveyed(&text);
        assert!(
            found.losses[0].starts_with("the header names 4 columns, every row has 3 cells"),
            "{:?}",
            found.losses
        );
        let proposed = found.proposal.map.unwrap();
        assert!(proposed.contains("\n# without_cells = [\""), "{proposed}");
        assert_eq!(
            proposed.contains(&format!("[{name:?}]")),
            ["App message", "(column 2)"].contains(&name),
            "{proposed}"
        );
        let read = through(&text, &map(&format!("without_cells = [{:?}]", name), "Thrust"));
        assert_eq!(read.column("thrust_n").unwrap(), [1.0, 2.0, 3.0], "{header}");
        assert!(read.notes.iter().any(|note| note.contains("as the column map says")), "{:?}", read.notes);
    }
    let error = Recording::decode("r.csv", "time_s,thrust_n,more\n0,1\n1,2\n".as_bytes(), None).unwrap_err();
    for part in ["line 2 has 2 cells", "names 3: time_s | thrust_n | more", "without_cells", "quoted"] {
        assert!(error.to_string().contains(part), "{part} in {error}");
    }
}

#[test]
fn a_map_that_says_so_of_other_rows_is_refused() {
    let of = |rows: &str, above: &str| refused(&format!("t,f,App\n{rows}"), Some(&map(above, "f")));
    let said = "without_cells = [\"App\"]";
    let full = of("0,1,2\n1,2,3\n", said);
    assert_eq!(full, Problem::RowLength { place: Place::Line(2), found: 3, expected: 2 });
    let odd = of("0,1\n1\n2,3\n", said);
    assert_eq!(odd, Problem::RowLength { place: Place::Line(3), found: 1, expected: 2 });
    let unknown = of("0,1\n1,2\n", "without_cells = [\"Debug\"]");
    assert!(matches!(unknown, Problem::MappedColumnMissing { column, .. } if column == "Debug"));
}

#[test]
fn a_header_once_more_among_the_rows_is_passed_over_and_said() {
    for (units, restart) in [("", false), ("", true), ("s,N\n", true)] {
        let rows = |from: u32| (from..from + 3).map(|k| format!("{k},{}\n", 2 * k)).collect::<String>();
        let text = format!("t,f\n{units}{}t,f\n{units}{}", rows(0), rows(if restart { 0 } else { 3 }));
        let found = surveyed(&text);
        assert!(
            found.notes.iter().any(|note| note.contains("hold the header once more")),
            "{:?}",
            found.notes
        );
        let map = map("", "f").replace("unit = \"s\"", "unit = \"s\"\nstale_rows = \"drop\"");
        let read = through(&text, &map);
        assert_eq!((read.rows(), found.resets), if restart { (3, 1) } else { (6, 0) });
        assert_eq!(read.losses.is_empty(), !restart, "{:?}", read.losses);
        assert!(read.notes.iter().any(|note| note.contains("hold the header once more")), "{:?}", read.notes);
    }
}
