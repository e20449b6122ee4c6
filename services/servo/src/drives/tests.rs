//! All that is wrong with a drive's section, or an instrument's, is said at once.

use super::*;

const CURRENT: &str = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");
const VOLTAGE: &str = include_str!("../../../../config/thrusters/t200.toml");

/// Everything that is said of a thruster with these keys, as `kort check` asks for it.
fn said(amplifier: &str, rig: &str, keys: &str) -> Vec<String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("kort.toml");
    let text = format!("[thrusters.t1]\nrig = \"r\"\namplifier = \"{amplifier}\"\n{keys}\n");
    std::fs::write(&file, text).unwrap();
    let (config, wrong) = Config::load_with_all(Some(&file));
    assert!(wrong.is_empty(), "{wrong:?}");
    let config = config.unwrap();
    let (thruster, rig) = (config.thruster("t1").unwrap(), Rig::from_toml(rig).unwrap());
    let _ = choose(&config, "t1", thruster, &rig);
    let _ = crate::sensors::choose(&config, "t1", thruster, &rig);
    config.noted().iter().map(ToString::to_string).collect()
}

/// Each of these keys, and no other, is said to be wrong.
fn tells(amplifier: &str, rig: &str, keys: &str, wrong: &[&str]) {
    let said = said(amplifier, rig, keys);
    for key in wrong {
        let told = said.iter().filter(|words| words.contains(&format!("`thrusters.t1.{key}`"))).count();
        assert_eq!(told, 1, "{amplifier}: {key}: {said:#?}");
    }
    assert_eq!(said.len(), wrong.len(), "{amplifier}: {said:#?}");
}

#[test]
fn all_that_is_wrong_with_a_section_is_said_at_once() {
    let drive = "[thrusters.t1.drive]\n";
    tells(
        "cia402",
        VOLTAGE,
        &format!(
            "{drive}port = \"dev/a\"\naddress = 64\nspeed_units = 0\nbitrate = 800000\nidentity = \"?\"\nrate_hz = 1"
        ),
        &[
            "drive.port",
            "drive.address",
            "drive.units_per_turn",
            "drive.speed_units",
            "drive.bitrate",
            "drive.identity",
            "drive.rate_hz",
            "amplifier",
        ],
    );
    tells(
        "mavlink",
        CURRENT,
        &format!("{drive}port = \"udp:here\"\nmotor = 0\naddress = 0"),
        &["drive.port", "drive.motor", "drive.address", "drive.timeout_ms", "amplifier"],
    );
    tells(
        "moteus",
        VOLTAGE,
        &format!("{drive}address = 200\nbaud = 5"),
        &["drive.port", "drive.address", "drive.baud", "amplifier"],
    );
    tells(
        "odrive",
        VOLTAGE,
        &format!("{drive}pole_pairs = 7"),
        &["drive.pole_pairs", "drive.port", "amplifier"],
    );
    tells(
        "iio",
        CURRENT,
        &format!(
            "{drive}dac = \"a\"\nlimit_v = 200\nscale_mv = 0\nrate_hz = 1\ncurrent = {{ adc = \"b\", gain_a_per_v = 0 }}\ncounter = {{ count = \"c\", counts_per_turn = 0, ceiling = -1 }}"
        ),
        &[
            "drive.dac",
            "drive.limit_v",
            "drive.gain_a_per_v",
            "drive.scale_mv",
            "drive.rate_hz",
            "drive.watchdog",
            "drive.current.adc",
            "drive.current.gain_a_per_v",
            "drive.counter.count",
            "drive.counter.counts_per_turn",
            "drive.counter.ceiling",
        ],
    );
}

#[test]
fn what_waits_and_what_is_read_are_both_told() {
    let simulation = "[thrusters.t1.simulation]\nambient_m_s = 9\nsensor_fault_after_s = -1\nmodel = \"model0\"\nseed = -1";
    tells(
        "simulated",
        CURRENT,
        &format!("{simulation}\n[thrusters.t1.drive]\nprot = \"/dev/a\""),
        &[
            "simulation.ambient_m_s",
            "simulation.sensor_fault_after_s",
            "simulation.model",
            "simulation.seed",
            "drive.prot",
        ],
    );
}

#[test]
fn all_instruments_are_looked_at() {
    let sensors = "[thrusters.t1.sensors.a]\nkind = \"serial_line\"\nbaud = -1\nrate_hz = 0\npattern = \"(\"\nsignals = { thrust_n = { column = -1, scale = 0.0 }, wind = { column = 1, unit = \"N\" } }\n[thrusters.t1.sensors.b]\nkind = \"iio\"\nsignals = { flow_m_s = { channel = \"../x\" } }\n";
    tells(
        "simulated",
        CURRENT,
        sensors,
        &[
            "sensors.a.port",
            "sensors.a.baud",
            "sensors.a.rate_hz",
            "sensors.a.pattern",
            "sensors.a.signals.thrust_n.column",
            "sensors.a.signals.thrust_n.unit",
            "sensors.a.signals.wind",
            "sensors.b.path",
            "sensors.b.signals.flow_m_s.channel",
            "sensors.b.signals.flow_m_s.scale",
        ],
    );
}

/// Which numbers may stand there, not which a computer has room for.
#[test]
fn a_negative_number_is_told_with_the_range_that_is_allowed() {
    let said = said("vesc", VOLTAGE, "[thrusters.t1.drive]\nport = \"/dev/a\"\npole_pairs = -7");
    assert!(said.len() == 1 && said[0].contains("= -7 is outside 1 to 100"), "{said:?}");
}
