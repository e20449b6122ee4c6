//! What is proposed from the names, units and first rows of tables that strangers wrote.

use super::{surveyed, through};
use crate::map::ColumnMap;
use crate::recording::Recording;
use crate::{Problem, Survey};

/// What a proposed map makes of a source, and the lines below it.
fn lines<'m>(map: &'m str, column: &str) -> Option<&'m str> {
    let rest = map.split_once(&format!("[columns.{column}]\nsource = "))?.1;
    Some(rest.split("\n[").next().unwrap_or(rest))
}

fn map_of(found: &Survey) -> &str {
    found.proposal.map.as_deref().unwrap()
}

#[test]
fn a_current_along_the_q_axis_is_told_from_what_was_asked_of_it() {
    let found = surveyed("time [s],d1 q-axis cmd [A],d1 vel [rad/s],d1 q-axis [A]\n0,1,0,0\n0.1,2,1,0.5\n");
    let map = map_of(&found);
    assert_eq!(lines(map, "current_cmd_a").unwrap().lines().next(), Some("\"d1 q-axis cmd [A]\""), "{map}");
    assert_eq!(lines(map, "current_a").unwrap().lines().next(), Some("\"d1 q-axis [A]\""), "{map}");
    assert_eq!(
        through("time [s],d1 q-axis cmd [A],d1 vel [rad/s],d1 q-axis [A]\n0,1,0,0\n0.1,2,1,0.5\n", map)
            .rows(),
        2
    );
}

#[test]
fn the_current_position_is_no_current() {
    let found =
        surveyed("Time,TargetPosition,CurrentPosition,Velocity,Current\n0,1,0,0,0.1\n0.1,2,1,0.5,0.2\n");
    let map = map_of(&found);
    assert!(lines(map, "current_a").unwrap().starts_with("\"Current\""), "{map}");
    assert!(lines(map, "shaft_angle_rad").unwrap().starts_with("\"CurrentPosition\""), "{map}");
}

/// A stand beside a speed controller: pulses, electrical turns, the supply's voltage and current, gravity.
#[test]
fn what_a_propeller_stand_measures_is_read_as_what_it_is_and_asked_for_where_it_does_not_say() {
    let text = "Time (s),ESC signal (µs),Motor Electrical Speed (RPM),Thrust (kgf),Voltage (V),Current (A),Vibration (g),\n\
        0.0,1000,0,0.0,15.5,0.1,0.2,\n0.1,1500,7000,0.5,15.5,4.5,0.3,\n0.2,1600,8000,0.6,15.5,5.5,0.1,\n";
    let found = surveyed(text);
    let map = map_of(&found);
    let pulses = lines(map, "duty_cmd").unwrap();
    assert!(pulses.starts_with("\"ESC signal (µs)\"\n# unit = \"1\"\n# table = [[1000, 0.0]"), "{map}");
    let speed = lines(map, "shaft_speed_rad_s").unwrap();
    assert!(speed.contains("# unit = \"rpm\"") && speed.contains("# divide_by = …"), "{map}");
    assert!(lines(map, "supply_v").unwrap().starts_with("\"Voltage (V)\"\nunit = \"V\""), "steady, {map}");
    assert!(lines(map, "supply_current_a").unwrap().starts_with("\"Current (A)\"\nunit = \"A\""), "{map}");
    assert!(lines(map, "thrust_n").unwrap().starts_with("\"Thrust (kgf)\""), "{map}");
    let fields = &found.topics[0].fields;
    assert_eq!(fields.len(), 7, "a separator behind the last name begins no column: {fields:?}");
    assert_eq!(fields[6].unit, None, "gravity is no force");
    // Unread it is refused, filled in it comes in.
    let error = ColumnMap::from_toml("proposed", map).unwrap_err().to_string();
    assert!(error.contains("`columns.duty_cmd.unit` is missing"), "{error}");
    let map =
        map.replace("# unit", "unit").replace("# table", "table").replace("1.0]]   pulses", "1.0]] # pulses");
    let map = map.replace("\"rpm\"   as", "\"rpm\" # as").replace("# divide_by = …", "divide_by = 7 #");
    let read = through(text, &map);
    assert_eq!(read.column("duty_cmd").unwrap(), [0.0, 0.5, 0.6]);
    let speed = read.column("shaft_speed_rad_s").unwrap()[1];
    assert!((speed - 1000.0 * std::f64::consts::TAU / 60.0).abs() < 1e-9, "{speed}");
    let optical = text.replace("Thrust (kgf)", "Motor Optical Speed (RPM)");
    let speed = lines(map_of(&surveyed(&optical)), "shaft_speed_rad_s").unwrap().to_owned();
    assert!(speed.starts_with("\"Motor Optical Speed (RPM)\"\nunit = \"rpm\""), "{speed}");
}

#[test]
fn a_unit_in_brackets_tells_what_a_column_of_another_tongue_is() {
    for [time, volt, speed, force] in [
        ["Tiempo (s)", "Voltaje (V)", "Velocidad (rad/s)", "Fuerza (N)"],
        ["Temps [s]", "Tension [V]", "Vitesse [rad/s]", "Poussée [N]"],
        ["Tempo (s)", "Tensione (V)", "Velocità (rad/s)", "Spinta (N)"],
        ["Tijd (s)", "Spanning (V)", "Toerental (rad/s)", "Stuwkracht (N)"],
        ["Aika (s)", "Jännite (V)", "Nopeus (rad/s)", "Voima (N)"],
    ] {
        let text = format!("{time},{volt},{speed},{force}\n0.5,9,0,0\n0.75,8,1.5,0.5\n1.0,7,2.5,1.5\n");
        let found = surveyed(&text);
        let map = map_of(&found);
        let read = through(&text, map);
        assert_eq!(read.time_s, [0.5, 0.75, 1.0], "{map}");
        assert_eq!(read.column("shaft_speed_rad_s").unwrap(), [0.0, 1.5, 2.5], "{map}");
        assert_eq!(read.column("supply_v").unwrap(), [9.0, 8.0, 7.0], "{map}");
        assert_eq!(read.column("thrust_n").unwrap(), [0.0, 0.5, 1.5], "{map}");
        assert_eq!(map.contains("only its unit speaks for it"), time == "Aika (s)", "{map}");
    }
    let swings = surveyed("t (s),U (V),n (rpm)\n0,-1,0\n0.1,1,5\n");
    assert!(lines(map_of(&swings), "voltage_cmd_v").is_some(), "no supply: {}", map_of(&swings));
}

#[test]
fn what_was_asked_for_or_estimated_is_told_from_what_was_measured() {
    for (names, measured, asked) in [
        ("Demanded RPM,RPM", "RPM", Some("Demanded RPM")),
        ("req_rpm,actual_rpm", "actual_rpm", Some("req_rpm")),
        ("rpm_demand,RPM", "RPM", Some("rpm_demand")),
        ("Solldrehzahl [1/min],Istdrehzahl [1/min]", "Istdrehzahl [1/min]", Some("Solldrehzahl [1/min]")),
        ("RPM commanded,RPM", "RPM", Some("RPM commanded")),
        ("Speed SP (rpm),Speed (rpm)", "Speed (rpm)", Some("Speed SP (rpm)")),
        ("des_rpm,rpm", "rpm", Some("des_rpm")),
        ("rpm_des,rpm", "rpm", Some("rpm_des")),
        ("estimated_rpm,rpm", "rpm", None),
        ("estimated_rpm,Speed (rpm)", "Speed (rpm)", None),
        ("rpm,measured rpm", "measured rpm", None),
        ("Vitesse des pales (rad/s),t2", "Vitesse des pales (rad/s)", None),
    ] {
        let width = names.split(',').count();
        let row = |k: usize| (0..width).map(|n| format!(",{}", k * (n + 1))).collect::<String>();
        let found = surveyed(&format!("Time (s),{names}\n0{}\n1{}\n2{}\n", row(0), row(1), row(2)));
        let map = map_of(&found);
        let source = |column| {
            lines(map, column).and_then(|lines| lines.lines().next()).map(|line| line.trim_matches('"'))
        };
        assert_eq!(
            (source("shaft_speed_rad_s"), source("speed_cmd_rad_s")),
            (Some(measured), asked),
            "{map}"
        );
    }
    let text = "Time (s),Sollstrom,Iststrom,Requested thrust (N),Thrust (N)\n0,1,2,3,4\n1,2,3,4,5\n";
    let found = surveyed(text);
    for (column, source) in [
        ("current_cmd_a", "Sollstrom"),
        ("current_a", "Iststrom"),
        ("thrust_cmd_n", "Requested thrust (N)"),
        ("thrust_n", "Thrust (N)"),
    ] {
        let said = lines(map_of(&found), column).unwrap();
        assert!(said.starts_with(&format!("{source:?}")), "{column}: {said}");
    }
}

#[test]
fn electrical_turns_and_factors_are_asked_for_however_they_are_spelt() {
    let of = |name: &str, column: &str| {
        let found = surveyed(&format!("Time (s),{name}\n0,0\n1,700\n2,900\n"));
        lines(map_of(&found), column).unwrap().to_owned()
    };
    for name in [
        "erpm",
        "eRPM",
        "ESC eRPM",
        "eRPM [1/min]",
        "motor_eRPM",
        "E-RPM",
        "e_rpm",
        "el. Drehzahl",
        "elektrische Drehzahl [1/min]",
    ] {
        let said = of(name, "shaft_speed_rad_s");
        assert!(said.contains("\n# unit") && said.contains("# divide_by = …"), "{said}");
    }
    assert!(of("eRPM cmd", "speed_cmd_rad_s").contains("# divide_by = …"));
    for (name, column) in
        [("rpm/100", "shaft_speed_rad_s"), ("RPM*10", "shaft_speed_rad_s"), ("Current x100 (A)", "current_a")]
    {
        let said = of(name, column);
        assert!(said.contains("\n# unit") && said.contains("# scale = …"), "{said}");
    }
    assert!(of("thrust(kg)", "thrust_n").contains("\nunit = \"kgf\""));
}

#[test]
fn a_command_in_per_cent_is_one() {
    let text = "time_ms,n_rpm,cmd_pct\n0,0,0\n100,10,25\n200,20,50\n";
    let found = surveyed(text);
    assert_eq!(through(text, map_of(&found)).column("duty_cmd").unwrap(), [0.0, 0.25, 0.5]);
    let other = surveyed("time_ms,n_rpm,humidity_pct\n0,0,0\n100,10,25\n200,20,50\n");
    assert!(lines(map_of(&other), "duty_cmd").is_none(), "a share of something else");
}

#[test]
fn a_first_row_of_numbers_is_a_row_and_the_columns_are_counted() {
    let text = "-50, 0.01, 7, -4\n-50, 0.02, 8, -5\n25, 0.03, 9, -7\n";
    let found = surveyed(text);
    assert_eq!(found.topics[0].messages, 3);
    assert!(found.notes[0].starts_with("line 1 holds numbers where the names"), "{:?}", found.notes);
    let map = map_of(&found);
    for place in 1..=4 {
        assert!(map.contains(&format!("# source = \"column_{place}\"")), "{map}");
    }
    let map = "[time]\nsource = \"column_2\"\nunit = \"s\"\n[columns.duty_cmd]\nsource = \"column_1\"\nunit = \"%\"\n";
    for end in ["", ",", ";"] {
        let text = text.replace('\n', &format!("{end}\n"));
        let read = through(&text, map);
        assert_eq!(read.column("duty_cmd").unwrap(), [-0.5, -0.5, 0.25], "{end:?}");
        assert_eq!(surveyed(&text).topics[0].fields.len(), 4, "{end:?}");
    }
    let error = Recording::decode("log.csv", text.as_bytes(), None).unwrap_err();
    assert!(matches!(error.problem, Problem::NoNames { .. }), "{error}");
    for part in ["line 1", "-50, 0.01, 7, -4", "kort columns LOG -o MAP"] {
        assert!(error.to_string().contains(part), "{part} in {error}");
    }
}

#[test]
fn units_behind_the_mark_of_a_comment_and_a_sign_at_the_end_of_rows() {
    let text = "%a motor\n%Date:,29/04/2031\n\n%tick,voltage,position,velocity\n%[#],[V],[turns],[turns/s]\n\
        2,0.5,1.5,0.25;\n79,0.25,1.75,0.5;\n122,-0.5,1.25,0.75;\n";
    let found = surveyed(text);
    let fields = &found.topics[0].fields;
    assert_eq!(
        fields.iter().map(|f| f.source.as_str()).collect::<Vec<_>>(),
        ["%tick", "voltage", "position", "velocity"]
    );
    assert_eq!((fields[3].unit.as_deref(), fields[3].samples), (Some("turns/s"), 3));
    let map = map_of(&found).replace("# source = \"…\"   ", "settle_s = 1.0 # ");
    let read = through(text, &map);
    let speed = read.column("shaft_speed_rad_s").unwrap();
    assert_eq!(
        speed.iter().copied().filter(|v| !v.is_nan()).map(|v| v / std::f64::consts::TAU).collect::<Vec<_>>(),
        [0.25, 0.5, 0.75]
    );
    assert!(read.notes.iter().any(|note| note.contains("3 row(s) end with a separator")), "{:?}", read.notes);
    // Of a recording of our own too; a cell that holds something is one too many.
    let of = |end: &str| {
        Recording::decode("r.csv", format!("time_s,thrust_n\n0,1{end}\n1,2{end}\n").as_bytes(), None)
    };
    assert_eq!(of(",").unwrap().column("thrust_n").unwrap(), [1.0, 2.0]);
    assert!(matches!(of(",5").unwrap_err().problem, Problem::RowLength { .. }));
}

#[test]
fn stamps_of_the_time_of_day_are_read_whatever_column_has_the_date() {
    let rows = |stamps: [&str; 3]| {
        let row = |(k, stamp): (usize, &&str)| format!("{stamp};{k};{}\n", 2 * k);
        stamps.iter().enumerate().map(row).collect::<String>()
    };
    for (names, stamps, unit, far_s) in [
        (
            "Timestamp",
            ["2024-04-30 23:59:59:875", "2024-05-01 00:00:00:000", "2024-05-01 00:00:00:125"],
            "\"date\"\n",
            0.25,
        ),
        (
            "Datum;Uhrzeit",
            ["30.04.2024;23:59:59,875", "01.05.2024;00:00:00,000", "01.05.2024;00:00:00,125"],
            "\"date\"\ntime_of_day = \"Uhrzeit\"\n",
            0.25,
        ),
        (
            "Date;Time",
            ["2024-04-30;23:59:59.875", "2024-04-30;00:00:00.000", "2024-04-30;00:00:00.125"],
            "\"date\"\ntime_of_day = \"Time\"\n",
            0.25,
        ),
        ("Uhrzeit", ["23:59:59:875", "00:00:00:000", "00:00:00:125"], "\"time of day\"\n", 0.25),
        ("when", ["11:59:59.5 PM", "12:00:00.0 AM", "12:00:01.0 AM"], "\"time of day\"\n", 1.5),
    ] {
        let text = format!("{names};Drehzahl (rpm);Schub (N)\n{}", rows(stamps));
        let found = surveyed(&text);
        let map = map_of(&found);
        assert!(map.contains(&format!("unit = {unit}")), "{names}: {map}");
        assert_eq!((found.topics[0].messages, found.losses.len(), found.resets), (3, 0, 0), "{names}");
        assert_eq!(found.topics[0].to_s, Some(far_s), "{names}");
        let read = through(&text, map);
        assert_eq!((read.time_s[0], read.time_s[2]), (0.0, far_s), "{names}");
        assert_eq!(read.column("thrust_n").unwrap(), [0.0, 2.0, 4.0]);
        let midnight = !stamps[1].contains("05");
        assert_eq!(
            read.notes.iter().any(|note| note.contains("midnight")),
            midnight,
            "{names}: {:?}",
            read.notes
        );
        assert_eq!(
            found.notes.iter().any(|note| note.contains("midnight")),
            midnight,
            "{names}: {:?}",
            found.notes
        );
    }
}

#[test]
fn stamps_that_cannot_be_read_are_said_to_be_so() {
    let found = surveyed("Timestamp,RPM,Thrust (N)\nday 1 noon,1,2\nday 1 later,3,4\n");
    assert_eq!((found.topics[0].messages, found.losses.len()), (2, 0), "the rows are counted");
    assert_eq!(found.topics[0].fields[1].max, Some(3.0));
    let said = found.notes.join("; ");
    let why = "the stamps cannot be read: line 2, column `Timestamp`: \"day 1 noon\" is not a number";
    assert!(said.contains(why), "{said}");
    assert!(map_of(&found).contains("[time]\n# source"), "{}", map_of(&found));
    let found = surveyed("Time (s),RPM\n0.0,1\nlater,2\n,3\n0.5,4\n");
    assert_eq!(
        found.losses,
        [
            "1 row(s) have no stamp and are left out, in line 4: \"\"",
            "1 row(s) have no stamp that can be read: left out here, and refused where the file is read, in line 3: \"later\""
        ]
    );
    // What a column map says amiss of them is refused by key.
    for (time, part) in [
        ("source = \"t\"\nunit = \"s\"\ntime_of_day = \"u\"", "`time.time_of_day` needs unit = \"date\""),
        ("clock = \"log\"\ntime_of_day = \"u\"", "keys of a table"),
    ] {
        let text = format!("[time]\n{time}\n[columns.thrust_n]\nsource = \"F\"\nunit = \"N\"\n");
        let error = ColumnMap::from_toml("m", &text).unwrap_err().to_string();
        assert!(error.contains(part) && error.contains("hint:"), "{error}");
    }
    let map = "[time]\nsource = \"d\"\nunit = \"date\"\ntime_of_day = \"u\"\n[columns.thrust_n]\nsource = \"F\"\nunit = \"N\"\n";
    let map = ColumnMap::from_toml("m", map).unwrap();
    let error = Recording::decode("r.csv", "d,u,F\n2024-05-01,noon,1\n".as_bytes(), Some(&map)).unwrap_err();
    for part in ["line 2, column `d` with `u`: \"2024-05-01 noon\" is no date", "hint:"] {
        assert!(error.to_string().contains(part), "{part} in {error}");
    }
}
