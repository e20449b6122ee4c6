//! What reads bytes that others wrote, entry by entry, with what must hold whatever the bytes are: no panic, and an
//! error says where and what to do. The fuzz targets beside this file and `tests/any_input.rs` call the same functions.

use std::path::Path;

use kort_gateway::bodies::Body;
use kort_lab::check::Kind;
use kort_proto::config::Config;
use kort_recording::{ColumnMap, Recording};
use kort_servo::drives::Chosen;
use kort_thruster::rig::Rig;
use mavlink::Message;
use mavlink::dialects::ardupilotmega::MavMessage;

const NAME: &str = "any.input";

/// A map that takes columns of `seeds/csv/foreign.csv`.
const MAP: &str = "[time]\nsource = \"t_ms\"\nunit = \"ms\"\nstale_rows = \"drop\"\n\
    [columns.shaft_speed_rad_s]\nsource = \"n\"\nunit = \"rev/s\"\nsign_of = \"pwm\"\nsign_zero = 1500\n";

/// A map that takes columns of `seeds/csv/dated.csv`.
const DATES: &str = "delimiter = \";\"\n[time]\nsource = \"Zeit\"\nunit = \"date\"\nstale_rows = \"drop\"\n\
    [columns.thrust_n]\nsource = \"F\"\nunit = \"N\"\n";

/// A map that takes what logs of messages have.
const MESSAGES: &str =
    "[time]\nclock = \"log\"\n[columns.shaft_speed_rad_s]\nsource = \"ESC[0].RPM\"\nunit = \"rpm\"\n";

/// A rig for the deployments that are read.
const RIG: &str = include_str!("../config/thrusters/whitcomb-yoerger-1999.toml");

const VEHICLE: &str = include_str!("../config/thrusters/t200-vehicle.toml");

/// What an autopilot says that is listened to.
const AUTOPILOT: [u32; 11] = [0, 1, 22, 36, 77, 148, 253, 290, 291, 11030, 11031];

/// A recording or a log of others, by its first bytes, plain or gzip, alone and through column maps, and what is in it.
pub fn recording(bytes: &[u8]) -> Result<Recording, String> {
    let read = |map: Option<&ColumnMap>| {
        let read = Recording::decode(NAME, bytes, map);
        if let Ok(recording) = &read {
            let rows = recording.rows();
            assert!(rows >= 2 && recording.time_s.windows(2).all(|w| w[0] < w[1]), "time increases");
            assert!(recording.columns.iter().all(|c| c.values.len() == rows), "columns are as long as time");
        }
        read.map_err(|e| located(NAME, e.to_string()))
    };
    for map in [MAP, DATES, MESSAGES] {
        let map = ColumnMap::from_toml("map", map).expect("a sound map");
        let _ = read(Some(&map));
    }
    if let Err(error) = kort_recording::survey(NAME, bytes) {
        let _ = located(NAME, error.to_string());
    }
    read(None)
}

/// A rig, scenario, controller or column map, as `kort check` reads it.
pub fn description(text: &str) -> Result<(), String> {
    for kind in [Kind::Rig, Kind::Soak, Kind::Scenario, Kind::Columns, Kind::Controller] {
        // A file of one kind is a bad one of every other.
        let _ = kind.check(text, Path::new(NAME));
    }
    let table: toml::Table = text.parse().map_err(|e: toml::de::Error| e.to_string())?;
    Kind::of(&table).check(text, Path::new(NAME)).map_err(|wrong| {
        assert!(!wrong.is_empty(), "refused without a word");
        wrong.into_iter().map(|words| located("", words)).collect::<Vec<_>>().join("\n")
    })
}

/// A deployment, read by every process that takes its part of it.
pub fn deployment(text: &str) -> Result<(), String> {
    let fail = |e: String| located(NAME, e);
    let config = Config::parse(text, Some(Path::new(NAME))).map_err(|e| fail(e.to_string()))?;
    kort_gateway::Settings::new(&config).map_err(|e| fail(e.to_string()))?;
    let rig = Rig::from_toml(RIG).expect("a sound rig");
    for (id, thruster) in &config.thrusters {
        kort_servo::settings::Settings::new(&config, id, thruster, &rig).map_err(|e| fail(e.to_string()))?;
        kort_servo::drives::choose(&config, id, thruster, &rig).map_err(|e| fail(e.to_string()))?;
        kort_servo::sensors::choose(&config, id, thruster, &rig).map_err(|e| fail(e.to_string()))?;
    }
    Ok(())
}

/// What comes in on the wire of each drive: as it is, and as the content of sound frames, in pieces, at every stage of the
/// conversation.
pub fn wire(bytes: &[u8]) {
    let mut vesc = bytes.to_vec();
    let mut odrive = bytes.to_vec();
    let mut moteus = bytes.to_vec();
    let mut cia402 = bytes.to_vec();
    let mut mavlink = bytes.to_vec();
    for part in bytes.chunks(40) {
        kort_servo::drives::vesc::frame::frame(part, &mut vesc);
        kort_servo::drives::odrive::text::line(&String::from_utf8_lossy(part), &mut odrive);
        let hex: String = part.iter().map(|byte| format!("{byte:02x}")).collect();
        moteus.extend(format!("\nrcv 100 {hex}\n").bytes());
        // Answers to SDO, both of a reading, emergency, heartbeat, each with as many bytes as it has.
        for (id, length) in [("581", 8), ("181", 5), ("281", 8), ("081", 8), ("701", 1)] {
            cia402.extend(format!("\rt{id}{length}{}\r", hex.get(..2 * length).unwrap_or_default()).bytes());
        }
    }
    for part in bytes.chunks(60) {
        for id in AUTOPILOT {
            vehicle(id, part, &mut mavlink);
        }
    }
    for (kind, keys, heard) in [
        ("vesc", "pole_pairs = 7", vesc),
        ("odrive", "", odrive),
        ("moteus", "", moteus),
        ("cia402", "units_per_turn = 4096", cia402),
        ("cia402", "port = \"can0\"\nunits_per_turn = 4096", bytes.to_vec()),
        ("mavlink", "motor = 1\ntimeout_ms = 510", mavlink),
    ] {
        let port = if keys.contains("port") { "" } else { "port = \"/dev/p\"\n" };
        let text = format!(
            "[thrusters.t1]\nrig = \"r\"\namplifier = \"{kind}\"\n[thrusters.t1.drive]\n{port}{keys}\n"
        );
        let config = Config::parse(&text, None).expect("a sound deployment");
        let thruster = config.thruster("t1").expect("it is there");
        let rig = if kind == "mavlink" { VEHICLE } else { RIG };
        let rig = Rig::from_toml(rig).expect("a sound rig");
        let chosen = kort_servo::drives::choose(&config, "t1", thruster, &rig).expect("a sound drive");
        let Chosen::OnWire(_, mut protocol) = chosen else { panic!("{kind} has no wire") };
        let mut out = Vec::new();
        protocol.begin();
        protocol.ask(&mut out, &mut |_| ());
        for piece in heard.chunks(1 + heard.len() / 5) {
            protocol.ask(&mut out, &mut |_| ());
            protocol.hear(piece, &mut |_| ());
            protocol.reply(&mut out);
            protocol.tell(Some(1.0), true, &mut out);
            protocol.hear(piece, &mut |_| ());
            protocol.tell(None, true, &mut out);
        }
        assert!(!out.is_empty(), "{kind} says nothing");
    }
}

/// A frame of an autopilot's with this payload: MAVLink 2, with the message's own check sum.
fn vehicle(id: u32, payload: &[u8], out: &mut Vec<u8>) {
    let [a, b, c, _] = id.to_le_bytes();
    let mut frame = vec![0xfd, payload.len() as u8, 0, 0, 0, 1, 1, a, b, c];
    frame.extend(payload);
    let sum = mavlink::calculate_crc(&frame[1..], MavMessage::extra_crc(id));
    out.extend(frame);
    out.extend(sum.to_le_bytes());
}

/// A body or a message of a client; the error is the problem document.
pub fn body(kind: Body, bytes: &[u8]) -> Result<(), serde_json::Value> {
    kind.read(bytes).inspect_err(|problem| {
        let word = |key: &str| problem[key].as_str().unwrap_or_default();
        assert!(word("type").starts_with("urn:kort:problem:"), "{problem}");
        assert!(!word("detail").is_empty() && !word("hint").is_empty(), "{problem}");
        assert!((400..500).contains(&problem["status"].as_u64().unwrap_or(0)), "{problem}");
    })
}

/// The words of an error begin with the file and end with a way out.
fn located(file: &str, words: String) -> String {
    assert!(words.starts_with(file) && words.contains("hint:"), "{words}");
    words
}
