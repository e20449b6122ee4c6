use proptest::prelude::*;

use super::*;

const HEAD: &str = "[time]\nsource = \"t\"\nunit = \"ms\"\n";

fn message(text: &str) -> String {
    ColumnMap::from_toml("m", text).unwrap_err().to_string()
}

#[test]
fn a_unit_is_never_guessed() {
    let error = message(&format!("{HEAD}[columns.shaft_speed_rad_s]\nsource = \"n\""));
    assert!(
        error.contains("`columns.shaft_speed_rad_s.unit` is missing") && error.contains("hint:"),
        "{error}"
    );
    let error = message("[time]\nsource = \"t\"\n[columns.thrust_n]\nsource = \"f\"\nunit = \"N\"");
    assert!(error.contains("`time.unit` is missing"), "{error}");
}

#[test]
fn a_unit_of_another_kind_is_refused() {
    let error = message(&format!("{HEAD}[columns.shaft_speed_rad_s]\nsource = \"n\"\nunit = \"N\""));
    assert!(error.contains("rad/s") && error.contains("\"rpm\""), "{error}");
    let error = message(&format!("{HEAD}[columns.thrust]\nsource = \"n\"\nunit = \"N\""));
    assert!(error.contains("thrust_n"), "{error}");
}

#[test]
fn bad_numbers_and_keys_are_named() {
    for (line, word) in [
        ("sign = 2", "sign` = 2"),
        ("scale = 0", "scale` = 0"),
        ("offset = nan", "offset"),
        ("table = [[1, 2]]", "table"),
        ("table = [[2, 2], [1, 0]]", "table"),
        ("sign_zero = 3", "sign_of"),
        ("no_value = nan", "no_value"),
        ("none = inf", "none"),
        ("scael = 3", "scael"),
    ] {
        let error = message(&format!("{HEAD}[columns.thrust_n]\nsource = \"f\"\nunit = \"N\"\n{line}"));
        assert!(error.contains(word), "{line}: {error}");
    }
}

#[test]
fn a_default_may_be_what_another_key_was_given() {
    let text = |default: &str| {
        format!(
            "[ask]\njoint = {{ meaning = \"m\", default = \"0\" }}\nplace = {{ meaning = \"m\", default = \"{default}\" }}\n\
             [time]\nclock = \"log\"\n[columns.thrust_n]\nsource = \"a[{{joint}}].b[{{place}}]\"\nunit = \"N\"\n"
        )
    };
    let source = |said: &str| {
        let map = read::map("m", &text("{joint}"), Some(&Asked::parse(said))).unwrap();
        (map.columns[0].source.clone(), map.call())
    };
    assert_eq!(source("joint=2"), ("a[2].b[2]".into(), "m:joint=2".into()));
    assert_eq!(source("joint=port,place=1"), ("a[port].b[1]".into(), "m:joint=port,place=1".into()));
    let error = message(&text("{gear}"));
    assert!(error.contains("`ask.place.default` = \"{gear}\""), "{error}");
}

/// Keys that nobody knows, values of another kind and what may not stand are told together; a key that is misspelt is not
/// told as missing too.
#[test]
fn all_that_is_wrong_is_said_at_once() {
    let all = |text: &str| {
        let wrong = ColumnMap::from_toml("m", text).unwrap_err();
        wrong.0.iter().map(|error| error.message.clone()).collect::<Vec<_>>()
    };
    let said = all(
        "decimal = 1\n[time]\nsource = \"t\"\nunti = \"ms\"\n[columns.thrust_n]\nsource = \"f\"\nscael = 2\nsign = \"-\"\n",
    );
    assert_eq!(said.len(), 5, "{said:?}");
    for key in [
        "`decimal` = 1",
        "`time.unti`",
        "`columns.thrust_n.scael`",
        "`columns.thrust_n.sign` = \"-\"",
        "`columns.thrust_n.unit` is missing",
    ] {
        assert!(said.iter().any(|words| words.contains(key)), "{key} in {said:?}");
    }
    let said = all("delimiter = \"|\"\n[ask]\nmotor = { meaning = \"which\" }\n\
        [time]\nsource = \"t\"\nunit = \"h\"\nstale_rows = \"keep\"\norder = \"dmy\"\n\
        [columns.thrust_n]\nsource = \"f[{motor}]\"\nunit = \"V\"\nsign = 2\nscale = 0\n\
        [columns.torque]\nsource = \"m\"\nunit = \"N m\"\n[columns.depth_m]\nsource = \"d\"\n");
    let keys = [
        "`delimiter` = \"|\"",
        "`ask.motor`: neither",
        "`time.order` = \"dmy\"",
        "`time.order` needs",
        "`time.unit` = \"h\"",
        "`time.stale_rows` = \"keep\"",
        "`columns.depth_m.unit` is missing",
        "`columns.thrust_n.unit` = \"V\"",
        "`columns.thrust_n.sign` = 2",
        "`columns.thrust_n.scale` = 0",
        "`columns.torque`: no SI unit",
    ];
    assert!(said.iter().zip(keys).all(|(words, key)| words.contains(key)), "{said:#?}");
    assert_eq!(said.len(), keys.len(), "{said:#?}");
}

#[test]
fn values_go_through_table_scale_offset_sign_and_unit() {
    let text = format!(
        "{HEAD}[columns.thrust_n]\nsource = \"pwm\"\nunit = \"kgf\"\nsign = -1\nscale = 2\noffset = 1\ntable = [[0, 0], [10, 5]]"
    );
    let map = ColumnMap::from_toml("m", &text).unwrap();
    let value = map.columns[0].apply(4.0);
    assert!((value + 5.0 * 9.806_65).abs() < 1e-9, "{value}");
    assert!((map.columns[0].apply(99.0) + 11.0 * 9.806_65).abs() < 1e-9, "held at the end");
}

#[test]
fn a_divisor_is_a_number_or_a_text_with_one() {
    let text =
        |by: &str| format!("{HEAD}[columns.thrust_n]\nsource = \"f\"\nunit = \"N\"\ndivide_by = {by}\n");
    for by in ["358.25", "\"358.25\"", "-358.25", "\" 358.25 \""] {
        let map = ColumnMap::from_toml("m", &text(by)).unwrap();
        assert_eq!(map.columns[0].scale.abs(), 1.0 / 358.25, "{by}");
    }
    assert_eq!(ColumnMap::from_toml("m", &text("7")).unwrap().columns[0].scale, 1.0 / 7.0);
    for by in ["0", "0.0", "\"0\"", "nan", "inf", "\"{poles}\"", "\"x\"", "true", "[7]"] {
        let error = message(&text(by));
        assert!(error.contains("columns.thrust_n.divide_by") || by.contains("poles"), "{by}: {error}");
        assert!(error.contains("hint:"), "{by}: {error}");
    }
}

#[test]
fn every_shipped_map_reads() {
    for name in ColumnMap::shipped() {
        let map = ColumnMap::example(name).expect("it reads, with its own examples");
        assert_eq!(ColumnMap::find(&map.call()).unwrap(), map, "{name}: called with all that it asks for");
        assert!(!map.description.is_empty(), "{name}: says where the log comes from");
    }
    let error = ColumnMap::find("quarter-drone").unwrap_err().to_string();
    assert!(error.contains("quarter_drone"), "{error}");
    assert!(ColumnMap::find("quarter_drone:x").is_err(), "has no runs to choose from");
}

#[test]
fn what_a_map_asks_for_stands_in_its_sources() {
    let text = "[ask]\nmotor = { meaning = \"which\", default = \"0\" }\npoles = { meaning = \"pairs\", example = \"7\" }\n\
        [time]\nclock = \"log\"\nrows_of = \"ESC[{motor}]\"\n\
        [columns.shaft_speed_rad_s]\nsource = \"ESC[{motor+1}].RPM\"\nunit = \"rpm\"\ndivide_by = \"{poles}\"\n";
    let folder = std::env::temp_dir().join(format!("kort-map-{}.toml", std::process::id()));
    std::fs::write(&folder, text).unwrap();
    let find = |more: &str| ColumnMap::find(&format!("{}{more}", folder.display()));
    let map = find(":poles=14,motor=2").unwrap();
    assert_eq!(map.columns[0].source, "ESC[3].RPM");
    assert_eq!(map.time, Time::Clock { rows_of: Some("ESC[2]".into()) });
    assert!((map.columns[0].scale - 1.0 / 14.0).abs() < 1e-12);
    for (more, word) in [
        ("", "`poles` is not given"),
        (":poles=0", "divide_by"),
        (":poles=x", "divide_by"),
        (":poles=7,motor=left", "whole number"),
        (":poles=7,side=1", "`side`"),
    ] {
        let error = find(more).unwrap_err().to_string();
        assert!(error.contains(word) && error.contains("hint:"), "{more}: {error}");
    }
    std::fs::remove_file(&folder).unwrap();
    let plain = ColumnMap::from_toml("m", text).unwrap();
    assert_eq!(plain.call(), "m:motor=0,poles=7");
    for bad in ["{motro}", "{motor", "{motor+x}"] {
        let error =
            ColumnMap::from_toml("m", &text.replace("ESC[{motor+1}].RPM", bad)).unwrap_err().to_string();
        assert!(error.contains("hint:"), "{bad}: {error}");
    }
}

proptest! {
    #[test]
    fn any_text_is_read_or_refused(text in "\\PC{0,200}") {
        if let Err(error) = ColumnMap::from_toml("m", &text) {
            prop_assert!(error.to_string().contains("hint:"));
        }
    }

    #[test]
    fn a_map_with_odd_values_is_refused_or_gives_finite_values(
        key in prop::sample::select(vec!["sign", "scale", "offset", "table", "sign_of", "sign_zero", "unit"]),
        value in prop_oneof![
            any::<f64>().prop_map(|x| format!("{x:e}")),
            prop::sample::select(vec!["nan", "\"rpm\"", "[]", "[[0, 1], [1, 2]]", "[[0, nan], [1, 2]]", "\"b\""]).prop_map(String::from),
            "[ -~]{0,10}",
        ],
        source in -1e6..1e6_f64,
    ) {
        let unit = if key == "unit" { "" } else { "unit = \"N\"\n" };
        let text = format!("{HEAD}[columns.thrust_n]\nsource = \"f\"\n{unit}{key} = {value}\n");
        match ColumnMap::from_toml("m", &text) {
            Ok(map) => prop_assert!(!map.columns[0].apply(source).is_nan()),
            Err(error) => prop_assert!(error.to_string().contains("hint:")),
        }
    }
}
