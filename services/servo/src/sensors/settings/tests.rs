//! What a source is read as, and what of it is refused.

use super::*;

const RIG: &str = include_str!("../../../../../config/thrusters/whitcomb-yoerger-1999.toml");

fn rig() -> Rig {
    Rig::from_toml(RIG).unwrap()
}

fn chosen(sensor: &str) -> Result<Vec<Chosen>, String> {
    let text = format!(
        "[thrusters.t1]\nrig = \"r\"\namplifier = \"simulated\"\n[thrusters.t1.sensors.own]\n{sensor}\n"
    );
    let config = Config::parse(&text, None).unwrap();
    choose(&config, "t1", config.thruster("t1").unwrap(), &rig()).map_err(|e| e.to_string())
}

#[test]
fn a_source_is_read_with_what_it_leaves_out() {
    let line = "kind = \"serial_line\"\nport = \"/dev/ttyUSB0\"\nsignals = { thrust_n = { column = 2, unit = \"kgf\", scale = -1.0 } }";
    let Kind::SerialLine(line) = &chosen(line).unwrap()[0].kind else { panic!("no serial line") };
    assert_eq!((line.baud, line.ask.as_str()), (u32::try_from(BAUD).unwrap(), ""));
    assert_eq!(line.channels[0].from, Column { number: 2, unit: Some("kgf") });
    assert!((line.channels[0].scale + 9.806_65).abs() < 1e-12);
}

/// What a source of this kind would not read, and what it cannot do without, is refused by name with a way out.
#[test]
fn each_bad_key_is_named_with_a_hint() {
    let line = "kind = \"serial_line\"\nport = \"/dev/p\"\n";
    let iio = "kind = \"iio\"\npath = \"p\"\n";
    let column = "signals = { thrust_n = { column = 1, unit = \"N\" } }";
    let channel = "signals = { thrust_n = { channel = \"in_voltage0\", scale = 1.0 } }";
    for (sensor, key) in [
        (format!("kind = \"can\"\n{column}"), "kind"),
        (format!("kind = \"serial_line\"\n{column}"), "port"),
        (format!("{line}baud = 5\n{column}"), "baud"),
        (format!("{line}pattern = \"(\"\n{column}"), "pattern"),
        (format!("{line}path = \"/sys\"\n{column}"), "path"),
        (format!("{line}{channel}"), "signals.thrust_n.channel"),
        (format!("{line}signals = {{ thrust_n = {{ column = 1 }} }}"), "signals.thrust_n.unit"),
        (
            format!("{line}signals = {{ thrust_n = {{ column = 0, unit = \"N\" }} }}"),
            "signals.thrust_n.column",
        ),
        (
            format!("{line}signals = {{ thrust_n = {{ column = 1, unit = \"rpm\" }} }}"),
            "signals.thrust_n.unit",
        ),
        (
            format!("{line}signals = {{ thrust_n = {{ column = 1, unit = \"N\", scale = 0.0 }} }}"),
            "signals.thrust_n.scale",
        ),
        (format!("{line}signals = {{ wind = {{ column = 1, unit = \"N\" }} }}"), "signals.wind"),
        (format!("{line}signals = {{}}"), "signals"),
        (format!("{line}rate_hz = 0\n{column}"), "rate_hz"),
        (format!("{line}reading_life_ms = 1\n{column}"), "reading_life_ms"),
        (format!("kind = \"iio\"\n{channel}"), "path"),
        (format!("{iio}port = \"p\"\n{channel}"), "port"),
        (format!("{iio}baud = 9600\n{channel}"), "baud"),
        (format!("{iio}ask = \"R\"\n{channel}"), "ask"),
        (format!("{iio}{column}"), "signals.thrust_n.column"),
        (
            format!("{iio}signals = {{ thrust_n = {{ channel = \"in_voltage0\" }} }}"),
            "signals.thrust_n.scale",
        ),
        (
            format!("{iio}signals = {{ thrust_n = {{ channel = \"../x\", scale = 1.0 }} }}"),
            "signals.thrust_n.channel",
        ),
    ] {
        let words = chosen(&sensor).unwrap_err();
        let key = format!("`thrusters.t1.sensors.own.{key}`");
        assert!(words.contains(&key) && words.contains("\nhint: "), "{sensor}\n{words}");
    }
}
