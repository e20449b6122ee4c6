//! Cells that hold no number, commas that may be anything, and tables of our own that a spreadsheet has saved again.

use super::{surveyed, through};
use crate::map::ColumnMap;
use crate::recording::Recording;

#[test]
fn what_stands_for_no_value_is_lost_and_said_alike_where_it_is_looked_at_and_read() {
    let text = "Time (s),RPM,Thrust (N),remark\n0,NaN,1,-\n1,−2,OL,a\n2,3,-,b\n3,N/A,2,\n,4,3,c\nnull,5,4,d\n4,6,inf,e\n";
    let found = surveyed(text);
    let read = through(text, found.proposal.map.as_deref().unwrap());
    let of = |column: &str| read.column(column).unwrap().to_vec();
    assert_eq!(read.time_s, [0.0, 1.0, 2.0, 3.0, 4.0]);
    let rpm = of("shaft_speed_rad_s");
    assert!(rpm[0].is_nan() && rpm[1] < 0.0 && rpm[3].is_nan() && rpm[4] > 0.0, "{rpm:?}");
    let thrust = of("thrust_n");
    assert!(thrust[0] == 1.0 && [1, 2, 4].iter().all(|at| thrust[*at].is_nan()), "{thrust:?}");
    let wanted = [
        "2 row(s) have no stamp and are left out, the first in line 6: \"\"",
        "2 cell(s) of `RPM` hold no value: not sampled then, the first in line 2: \"NaN\"",
        "3 cell(s) of `Thrust (N)` hold no value: not sampled then, the first in line 3: \"OL\"",
    ];
    assert_eq!(read.losses, wanted);
    assert_eq!(found.losses, wanted);
}

#[test]
fn a_typographic_minus_is_one_in_the_first_row_too() {
    let text = "bench 3\nTime (s),RPM,Thrust (N)\n−1.5,−2,−0.5\n−0.5,−3,−1.5\n0.5,4,2.5\n";
    let found = surveyed(text);
    assert_eq!((found.topics[0].from_s, found.losses.len()), (Some(-1.5), 0), "{:?}", found.losses);
    let read = through(text, found.proposal.map.as_deref().unwrap());
    assert_eq!((read.time_s[0], read.column("thrust_n").unwrap()[1]), (-1.5, -1.5));
}

#[test]
fn what_a_map_is_refused_for_is_said_before() {
    for text in [
        "Time (s),RPM\n0,1\n1,\"1,006.5\"\n2,3\n",
        "Time (s),RPM\n0,1\n1,(2)\n2,3\n",
        "Time (s),RPM,RPM\n0,1,1\n1,2,2\n",
    ] {
        let found = surveyed(text);
        assert!(found.losses.iter().any(|loss| loss.contains("refused")), "{text}: {:?}", found.losses);
        let map = ColumnMap::from_toml("proposed", found.proposal.map.as_deref().unwrap()).unwrap();
        assert!(Recording::decode("log.csv", text.as_bytes(), Some(&map)).is_err(), "{text}");
    }
    let ours = surveyed("time_s,thrust_n\n0,1\n1,NaN\n");
    assert!(
        ours.proposal.native && ours.losses[0].contains("a recording of kort is refused"),
        "{:?}",
        ours.losses
    );
}

#[test]
fn commas_that_may_be_marks_for_thousands_are_left_to_the_user() {
    let text = |rpm: &str| format!("Time (ms);RPM;Thrust (gf)\n0;0;-250\n50;999;-1\n100;{rpm};1,619\n");
    let found = surveyed(&text("1,029"));
    let map = found.proposal.map.unwrap();
    assert!(map.contains("\n# decimal = \",\"   take out the #"), "{map}");
    assert!(found.notes.iter().any(|note| note.contains("\"1,029\" (line 4)")), "{:?}", found.notes);
    assert!(found.losses.iter().any(|loss| loss.contains("`RPM`")), "{:?}", found.losses);
    let refused = ColumnMap::from_toml("m", &map).unwrap();
    let error =
        Recording::decode("log.csv", text("1,029").as_bytes(), Some(&refused)).unwrap_err().to_string();
    assert!(error.contains("\"1,029\" is not a number") && error.contains("mark for thousands"), "{error}");
    let said = map.replace("# decimal = \",\"   take", "decimal = \",\"   # take");
    assert_eq!(through(&text("1,029"), &said).column("thrust_n").unwrap()[2], 1.619 * 9.806_65e-3);
    // One number tells: no thousand begins with a zero, or has other than three digits behind its mark, or several marks.
    for (rpm, decimal) in [("0,029", true), ("1,5", true), ("1029,125", true), ("1,029,125", false)] {
        let map = surveyed(&text(rpm)).proposal.map.unwrap();
        assert_eq!(map.contains("\ndecimal = \",\""), decimal, "{rpm}: {map}");
        assert!(!map.contains("# decimal"), "{rpm}: {map}");
    }
}

#[test]
fn a_recording_of_our_own_is_one_whatever_parts_its_cells() {
    let text = "time_s,current_a,shaft_speed_rad_s\n0,0.5,1.25\n1,1.5,2.5\n";
    for cut in [";", "\t"] {
        let text = text.replace(',', cut);
        assert!(surveyed(&text).proposal.native, "{text}");
        let read = Recording::decode("r.csv", text.as_bytes(), None).unwrap();
        assert_eq!(read.column("shaft_speed_rad_s").unwrap(), [1.25, 2.5]);
        let comma = text.replace('.', ",");
        let found = surveyed(&comma);
        assert!(!found.proposal.native, "a decimal comma is read where a map says it");
        let read = through(&comma, found.proposal.map.as_deref().unwrap());
        assert_eq!(read.column("current_a").unwrap(), [0.5, 1.5]);
        assert_eq!(read.column("shaft_speed_rad_s").unwrap(), [1.25, 2.5]);
    }
}

#[test]
fn columns_of_another_clock_are_said_and_not_proposed() {
    let table = |second: &str, own: &dyn Fn(f64) -> f64| {
        let row = |k: u32| format!("{},{k},{},{}\n", f64::from(k) * 0.5, own(f64::from(k)), k * 2);
        format!("Time_1 [s],Speed [rpm],{second},Thrust [N]\n{}", (0..20).map(row).collect::<String>())
    };
    let found = surveyed(&table("Time_2 [s]", &|k| k));
    let map = found.proposal.map.unwrap();
    assert!(map.contains("shaft_speed_rad_s") && !map.contains("thrust_n"), "{map}");
    assert!(
        found.notes.iter().any(|note| note.contains("`Time_2 [s]` is the clock of `Thrust [N]`")),
        "{:?}",
        found.notes
    );
    for text in [
        table("Time_2 [ms]", &|k| k * 500.0),
        table("Timestamp", &|k| 1.7e12 + k * 500.0),
        table("Time per turn [s]", &|k| (k * 0.7).sin()),
        table("Time step [s]", &|_| 0.5),
    ] {
        assert!(surveyed(&text).proposal.map.unwrap().contains("thrust_n"), "{text}");
    }
}

#[test]
fn columns_that_never_change_are_named_where_nothing_is_proposed() {
    let found = surveyed("Time (s),RPM,Thrust (N),note\n0,100,5,1\n1,100,5,1\n");
    assert_eq!(
        (found.proposal.map, found.proposal.unchanging),
        (None, vec!["RPM".into(), "Thrust (N)".into()])
    );
    assert!(surveyed("Time (s),RPM,Thrust (N)\n0,1,5\n1,2,5\n").proposal.unchanging.is_empty());
}

#[test]
fn what_only_the_user_knows_of_a_shipped_map_is_said_to_be_an_example() {
    let header = "ms_today;input_voltage;temp_mos_max;temp_motor;current_motor;current_in;d_axis_current;q_axis_current;erpm;duty_cycle";
    let row = |k: u32| format!("{};12;20;20;{k};{k};0;{k};{k};0.{k}\n", k * 10);
    let found = surveyed(&format!("{header}\n{}{}", row(1), row(2)));
    let named: Vec<_> = found.proposal.examples.iter().map(|e| (e.key.as_str(), e.value.as_str())).collect();
    assert!(found.proposal.shipped.contains(&"vesc:pole_pairs=7".to_owned()), "{:?}", found.proposal.shipped);
    assert_eq!(named, [("pole_pairs", "7")]);
}

#[test]
fn a_wrapped_angle_is_counted_on_through_a_map() {
    let text: String = (0..50).map(|k| format!("{k},{}\n", (k * 50) % 360)).collect();
    let map =
        "[time]\nsource = \"t\"\nunit = \"s\"\n[columns.shaft_angle_rad]\nsource = \"a\"\nunit = \"deg\"\n";
    let read = through(&format!("t,a\n{text}"), map);
    let last = read.column("shaft_angle_rad").unwrap()[49].to_degrees();
    assert!((last - 49.0 * 50.0).abs() < 1e-6, "{last}");
}
