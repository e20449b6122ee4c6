//! Logs of others: `kort columns` says what is in them, and `--columns` brings them in. Logs under
//! `tests/recordings/logs` are real; the others are written here, byte for byte as their format's description has it.

#[path = "logs/bags.rs"]
mod bags;
#[path = "logs/clocks.rs"]
mod clocks;
#[path = "logs/dates.rs"]
mod dates;
#[path = "common/lab.rs"]
mod lab;
#[path = "logs/preambles.rs"]
mod preambles;
#[path = "logs/refused.rs"]
mod refused;
#[path = "logs/tables.rs"]
mod tables;
#[path = "logs/torn.rs"]
mod torn;
#[path = "logs/writers.rs"]
mod writers;

use std::path::Path;

use kort_recording::{ColumnMap, Recording};
use lab::{json, kort, stderr, write};
use serde_json::Value;

const PX4: &str = "tests/recordings/logs/px4-uavcan-escs.ulg.gz";

fn columns(log: &str) -> Value {
    let found = json(&kort(&["columns", log, "--json"]));
    assert_eq!(found["schema"], "kort.columns/1");
    found
}

fn topic<'a>(found: &'a Value, name: &str) -> &'a Value {
    let all = found["topics"].as_array().unwrap();
    all.iter().find(|topic| topic["name"] == name).unwrap_or_else(|| panic!("no {name} in {found}"))
}

fn field<'a>(topic: &'a Value, source: &str) -> &'a Value {
    let all = topic["fields"].as_array().unwrap();
    all.iter().find(|field| field["source"] == source).unwrap_or_else(|| panic!("no {source} in {topic}"))
}

fn shipped(found: &Value) -> Vec<&str> {
    found["proposal"]["shipped"].as_array().unwrap().iter().map(|name| name.as_str().unwrap()).collect()
}

fn read(log: &str, map: &str) -> Recording {
    let map = ColumnMap::find(map).unwrap_or_else(|e| panic!("{e}"));
    Recording::read(Path::new(log), Some(&map)).unwrap_or_else(|e| panic!("{e}"))
}

fn near(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * b.abs().max(1.0)
}

/// Samples of a column with their instants.
fn samples(recording: &Recording, column: &str) -> Vec<(f64, f64)> {
    let values = recording.column(column).unwrap_or_else(|| panic!("no {column}"));
    recording.time_s.iter().copied().zip(values.iter().copied()).filter(|(_, v)| !v.is_nan()).collect()
}

#[test]
fn a_table_of_anyone_is_listed_and_the_proposed_map_brings_it_in() {
    let mut text = String::from("t_ms;Motor speed (rpm);thrust_gf;Duty [%];note\n");
    for k in 0..200 {
        text += &format!("{};{};{};{};x\n", k * 20, 100 * (k % 7), k, k % 50);
    }
    let log = write("anyone.csv", text);
    let found = columns(&log);
    assert_eq!(found["format"], "CSV");
    assert!(near(found["duration_s"].as_f64().unwrap(), 3.98));
    let rows = topic(&found, "");
    assert_eq!(rows["messages"], 200);
    assert!(near(rows["rate_hz"].as_f64().unwrap(), 50.0));
    let speed = field(rows, "Motor speed (rpm)");
    assert_eq!((&speed["unit"], &speed["unit_from"]), (&"rpm".into(), &"name".into()));
    assert_eq!((&speed["max"], &speed["column"]), (&600.0.into(), &"shaft_speed_rad_s".into()));
    assert_eq!(field(rows, "note")["texts"], 200);
    assert!(shipped(&found).is_empty());
    let map = lab::path("anyone.toml");
    let written = kort(&["columns", &log, "-o", &map]);
    assert_eq!(written.status.code(), Some(0), "{}", stderr(&written));
    let recording = read(&log, &map);
    assert_eq!(recording.rows(), 200);
    assert!(near(recording.column("shaft_speed_rad_s").unwrap()[1], 100.0 * std::f64::consts::TAU / 60.0));
    assert!(near(recording.column("thrust_n").unwrap()[100], 0.980_665));
    assert!(near(recording.column("duty_cmd").unwrap()[49], 0.49));
}

#[test]
fn a_recording_of_kort_needs_no_map() {
    for output in ["own.csv", "own.mcap"] {
        let path = lab::path(output);
        let made = kort(&["simulate", "--rig", "t200", "--scenario", "staircase", "-o", &path]);
        assert_eq!(made.status.code(), Some(0), "{}", stderr(&made));
        let found = columns(&path);
        let speed = found["topics"].as_array().unwrap().iter().flat_map(|t| t["fields"].as_array().unwrap());
        let speed = speed.filter(|f| f["source"].as_str().unwrap().ends_with("shaft_speed_rad_s")).count();
        assert_eq!(speed, 1, "{found}");
        assert_eq!(found["proposal"]["native"], true, "{output}");
    }
    let joint = columns(&write("joint.csv", "time_s,q,qd\n0,0.1,0.2\n0.01,0.2,0.3\n"));
    assert_eq!(joint["proposal"]["native"], false, "stamps alone make no recording of kort: {joint}");
}

#[test]
fn gaps_and_a_clock_that_begins_anew_are_said() {
    let mut text = String::from("t_s,thrust_n\n");
    for (from, rows) in [(100.0, 200), (150.0, 100), (0.0, 50)] {
        for k in 0..rows {
            text += &format!("{},{k}\n", from + f64::from(k) * 0.1);
        }
    }
    let found = columns(&write("gaps.csv", text));
    assert_eq!(found["resets"], 1);
    let rows = topic(&found, "");
    assert_eq!(rows["gaps"], 1);
    assert!(near(rows["longest_gap"]["to_s"].as_f64().unwrap(), 150.0));
}

/// Against the numbers that PX4's own reader (pyulog 1.3) gives for the same file.
#[test]
fn a_real_px4_log_reads_as_px4_reads_it() {
    let found = columns(PX4);
    assert_eq!(found["format"], "PX4 ULog");
    let esc = topic(&found, "esc_status");
    assert_eq!(esc["messages"], 127);
    assert!(near(esc["from_s"].as_f64().unwrap(), 5_081.348_405));
    assert!(near(esc["to_s"].as_f64().unwrap(), 5_120.249_475));
    assert_eq!(topic(&found, "actuator_outputs[2]")["messages"], 366);
    let rpm = field(esc, "esc_status.esc[3].esc_rpm");
    assert_eq!((&rpm["min"], &rpm["max"]), (&1340.0.into(), &2976.0.into()));
    // The outputs of bank 0 stand: the map that takes them comes behind.
    assert!(shipped(&found)[0].starts_with("px4-uavcan"), "{found}");

    let recording = read(PX4, "px4-uavcan:bank=1,motor=3");
    assert_eq!(recording.rows(), 364, "the rows are the commands'");
    let speed = samples(&recording, "shaft_speed_rad_s");
    let rad_s = |rpm: f64| rpm * std::f64::consts::TAU / 60.0;
    for (stamp_s, rpm) in
        [(5_081.348_405, 2422.0), (5_081.648_662, 2435.0), (5_100.748_94, 2733.0), (5_120.249_475, 1343.0)]
    {
        let off_s = |row: &&(f64, f64)| (row.0 - stamp_s).abs();
        let row = speed.iter().min_by(|a, b| off_s(a).total_cmp(&off_s(b))).unwrap();
        assert!(
            near(row.1, rad_s(rpm)) && (row.0 - stamp_s).abs() < 0.125,
            "in the row nearest to its message: {row:?}"
        );
    }
    assert!(near(samples(&recording, "supply_current_a")[0].1, 8.171875));
    let duty = recording.column("duty_cmd").unwrap();
    let most = duty.iter().copied().fold(0.0, f64::max);
    assert!(near(most, 6_158.411_621_093_75 / 8191.0), "{most}");
    assert!(recording.notes.iter().any(|n| n.contains("bank = 1, motor = 3")), "{:?}", recording.notes);
    assert!(recording.losses.is_empty(), "{:?}", recording.losses);
}

#[test]
fn a_log_of_messages_without_a_map_says_what_to_do() {
    let refused = kort(&["fit", PX4, "--rig", "t200"]);
    assert_eq!(refused.status.code(), Some(2));
    let words = stderr(&refused);
    for word in [PX4, "PX4 ULog", "column map", "hint:", "kort columns"] {
        assert!(words.contains(word), "{words}");
    }
    for (map, wanted) in [
        ("vesc:pole_pairs=7", "[time] clock"),
        ("px4-uavcan", "bank=1"),
        ("px4-uavcan:bank=1,engine=2", "`engine`"),
        ("px4", "actuator_motors.control[0]"),
        ("px4-uavcan:bank=7", "actuator_outputs[7].output[0]"),
    ] {
        let refused = kort(&["fit", PX4, "--rig", "t200", "--columns", map]);
        assert_eq!(refused.status.code(), Some(2), "{map}");
        let words = stderr(&refused);
        assert!(words.contains(wanted) && words.contains("hint:"), "{map}: {words}");
    }
}

#[test]
fn a_torn_px4_log_is_read_up_to_its_end() {
    let mut whole = Vec::new();
    let file = std::fs::File::open(PX4).unwrap();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(file), &mut whole).unwrap();
    let torn = write("torn.ulg", &whole[..whole.len() * 6 / 10]);
    let said = kort(&["columns", &torn, "--json"]);
    assert_eq!(said.status.code(), Some(3), "{}", stderr(&said));
    assert!(stderr(&said).contains("the file ends in a record at byte"), "{}", stderr(&said));
    let recording = read(&torn, "px4-uavcan:bank=1,motor=3");
    assert!(recording.rows() > 150 && recording.rows() < 300 && recording.losses.len() == 1);
    // A stretch of nonsense within: what is around it is read.
    let mut bad = whole.clone();
    let at = bad.len() / 2;
    bad[at..at + 300].fill(0xee);
    let recording = read(&write("bad.ulg", &bad), "px4-uavcan:bank=1,motor=3");
    assert!(!recording.losses.is_empty(), "said");
    let header = kort(&["columns", &write("short.ulg", &whole[..12])]);
    assert_eq!(header.status.code(), Some(2));
    assert!(stderr(&header).contains("12 of 16 bytes"), "{}", stderr(&header));
}

#[test]
fn a_vesc_log_needs_its_pole_pairs() {
    let head = "ms_today;input_voltage;temp_mos_max;temp_motor;current_motor;current_in;erpm;duty_cycle;";
    let mut text = format!("{head}\n");
    for k in 0..100 {
        // VESC Tool repeats the stamp where the drive was silent.
        let stamp = 36_000_000 + 50 * (k - k % 10 / 9);
        text += &format!("{stamp};24.5;30;28;{};1.5;{};0.25;\n", 0.1 * f64::from(k), 700 * k);
    }
    let log = write("vesc.csv", text);
    let said = kort(&["columns", &log]);
    assert_eq!(said.status.code(), Some(3), "rows are skipped: {}", stderr(&said));
    assert!(String::from_utf8_lossy(&said.stdout).contains("--columns vesc:pole_pairs=7"));
    let refused = kort(&["fit", &log, "--rig", "t200", "--columns", "vesc"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("pole_pairs"), "{}", stderr(&refused));
    let recording = read(&log, "vesc:pole_pairs=14");
    assert_eq!(recording.rows(), 90);
    assert!(recording.losses[0].contains("10 row(s)"), "{:?}", recording.losses);
    assert!(near(recording.time_s[1] - recording.time_s[0], 0.05));
    assert!(near(recording.column("shaft_speed_rad_s").unwrap()[2], 100.0 * std::f64::consts::TAU / 60.0));
}

#[test]
fn moteus_registers_by_name() {
    let mut text =
        String::from("time,MODE,POSITION,VELOCITY,TORQUE,Q_CURRENT,D_CURRENT,VOLTAGE,TEMPERATURE,FAULT\n");
    for k in 0..50 {
        text +=
            &format!("{},10,{},{},0.1,{},0,24.0,31,0\n", 0.01 * f64::from(k), 0.5 * f64::from(k), 2.0, 0.2);
    }
    let log = write("moteus.csv", text);
    assert_eq!(shipped(&columns(&log)), ["moteus"]);
    let recording = read(&log, "moteus");
    assert!(near(recording.column("shaft_angle_rad").unwrap()[2], std::f64::consts::TAU));
    assert!(near(recording.column("shaft_speed_rad_s").unwrap()[2], 2.0 * std::f64::consts::TAU));
    assert!(recording.notes.iter().any(|n| n.contains("COMMAND_Q_CURRENT")), "{:?}", recording.notes);
}

/// What moteus' own tview logged (`tests/logs/reference_writers.py`): flags, empty cells and `nan` among the numbers.
#[test]
fn what_tview_of_moteus_logs_comes_in_by_its_map() {
    let log = "tests/recordings/logs/moteus_1_servo_stats.csv.gz";
    let found = columns(log);
    assert_eq!((found["format"].as_str(), shipped(&found)), (Some("CSV"), vec!["moteus-tview"]));
    let columns =
        ["velocity", "control_velocity"].map(|source| field(topic(&found, ""), source)["column"].clone());
    assert_eq!(
        columns,
        ["shaft_speed_rad_s", "speed_cmd_rad_s"],
        "what its trajectory asks for is no measurement"
    );
    let recording = read(log, "moteus-tview");
    assert_eq!(recording.rows(), 500);
    let long_s = recording.time_s[499] - recording.time_s[0];
    assert!((long_s - 9.98).abs() < 1e-6, "stamps are seconds since 1970: {long_s}");
    let command = samples(&recording, "speed_cmd_rad_s");
    assert_eq!(command.len(), 400, "none before the drive was commanded");
    assert!(near(command[0].1, 4.0 * std::f64::consts::TAU));
    let (speed, angle) =
        (recording.column("shaft_speed_rad_s").unwrap(), recording.column("shaft_angle_rad").unwrap());
    assert!((speed[199] / command[99].1 - 1.0).abs() < 1e-4, "the drive follows: {}", speed[199]);
    assert!((angle[199] - angle[198] - 0.02 * speed[199]).abs() < 1e-9, "its angle is of its speed");
}

/// Against the numbers that Foxglove's own reader of ROS 2 bags (mcap_ros2) gives for the same file, which its writer made.
#[test]
fn a_ros_2_bag_reads_as_its_own_library_reads_it() {
    let bag = "tests/recordings/logs/ros2-two-thrusters.mcap";
    let found = columns(bag);
    assert_eq!(topic(&found, "joint_states")["messages"], 1000);
    assert_eq!(topic(&found, "forward_velocity_controller/commands")["messages"], 200);
    assert_eq!(
        shipped(&found),
        ["ros2:command=forward_velocity_controller/commands,joint=0"],
        "and nothing else"
    );
    let recording = read(bag, "ros2:joint=1");
    assert_eq!(recording.rows(), 1000);
    let speed = recording.column("shaft_speed_rad_s").unwrap();
    let angle = recording.column("shaft_angle_rad").unwrap();
    assert_eq!((speed[0], speed[500], speed[999]), (0.5, 9.999_999_999_930_894, 9.999_999_999_999_982));
    assert_eq!(angle[500], 48.200_000_000_013_155);
    assert!(near(recording.time_s[999] - recording.time_s[0], 9.99));
    assert!(recording.column("speed_cmd_rad_s").unwrap().iter().all(|v| *v == 10.0), "a command stands");
    assert!(recording.column("supply_v").is_none());
    let refused = kort(&["fit", bag, "--rig", "t200"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("column map"), "{}", stderr(&refused));
    // The log as it is drives a fit, by one command.
    let fit = json(&kort(&["fit", bag, "--rig", "speed-drive", "--columns", "ros2", "--json"]));
    assert_eq!(fit["schema"], "kort.fit/1");
    assert!(fit["channels"]["shaft_speed_rad_s"].is_object(), "{fit}");
}

/// Written as ArduPilot writes it, units and multipliers included.
#[test]
fn an_ardupilot_log_reads_with_its_units_and_instances() {
    let log = write("ardupilot.bin", writers::dataflash(400));
    let found = columns(&log);
    assert_eq!(found["format"], "ArduPilot DataFlash");
    let esc = topic(&found, "ESC[1]");
    let current = field(esc, "ESC[1].Curr");
    assert_eq!((&current["unit"], &current["unit_from"]), (&"A".into(), &"format".into()));
    assert_eq!(field(esc, "ESC[1].CTot")["unit"], "mAh");
    assert_eq!(field(topic(&found, "RCOU"), "RCOU.C1")["unit"], "us");
    assert!(shipped(&found).contains(&"ardupilot:motor=0,output=1"), "{found}");
    assert!(shipped(&found).iter().any(|name| name.starts_with("ardupilot-vehicle")));

    let recording = read(&log, "ardupilot:motor=1,output=2");
    assert_eq!(recording.rows(), 400, "the rows are the outputs'");
    let speed = samples(&recording, "shaft_speed_rad_s");
    assert_eq!(speed.len(), 200);
    assert!(near(speed[10].1, writers::rpm(1, 20) * std::f64::consts::TAU / 60.0), "{:?}", speed[10]);
    assert!(near(
        recording.column("duty_cmd").unwrap()[30],
        (f64::from(writers::pulse(2, 30)) - 1500.0) / 400.0
    ));
    assert!(near(samples(&recording, "supply_current_a")[3].1, 2.5), "hundredths are in the type");

    let mut bytes = std::fs::read(&log).unwrap();
    let from = bytes.len() / 2;
    bytes[from..from + 100].fill(0x11);
    let recording = read(&write("bad.bin", &bytes), "ardupilot");
    assert!(recording.losses[0].contains("are no messages"), "{:?}", recording.losses);
    let (rows, losses) = (recording.rows(), recording.losses);
    assert!(rows > 390, "what is around the damage is read: {rows}");
    bytes.extend([0xff; 500]);
    let padded = read(&write("padded.bin", bytes), "ardupilot");
    assert_eq!((padded.rows(), padded.losses), (rows, losses), "an unwritten end of a flash chip is no loss");
}

/// VESC's status and CANopen's process data, as `candump -L` writes them.
#[test]
fn bytes_on_a_can_bus_become_columns_by_a_map() {
    let log = write("can.log", writers::candump(200));
    let found = columns(&log);
    assert_eq!(found["format"], "candump");
    assert_eq!(shipped(&found), ["canopen-402:command=301,pdo=281", "vesc-can:id=05,pole_pairs=7"]);
    // Other nodes than the maps' examples are told by their identifiers; frames too short for the numbers are not taken.
    let others = "(1.000000) can0 00000963#0000111100020003\n(1.000000) can0 28A#370000000000\n(1.000000) can0 30A#0F0000000000\n\
         (1.010000) can0 00000917#00001111\n(1.010000) can0 28B#370000000000\n(1.010000) can0 30C#0F0000000000\n";
    let found_others = columns(&write("others.log", others));
    assert_eq!(shipped(&found_others), ["canopen-402:command=30A,pdo=28A", "vesc-can:id=63,pole_pairs=7"]);
    let duty = field(topic(&found, "0x00000905"), "0x00000905.i16be[6]");
    assert_eq!((&duty["min"], &duty["max"]), (&250.0.into(), &250.0.into()));
    let rad_s = |rpm: f64| rpm * std::f64::consts::TAU / 60.0;
    let recording = read(&log, "vesc-can:id=05,pole_pairs=7");
    assert_eq!(recording.rows(), 200);
    assert!(near(recording.column("shaft_speed_rad_s").unwrap()[7], rad_s(700.0)));
    assert!(near(recording.column("current_a").unwrap()[0], -1.5));
    assert!(near(recording.column("duty_cmd").unwrap()[0], 0.25));
    let recording = read(&log, "canopen-402:pdo=281,command=301");
    let speed = recording.column("shaft_speed_rad_s").unwrap();
    assert!(near(speed[0], rad_s(100.0)) && near(speed[50], rad_s(-50.0)), "{speed:?}");
    let command = recording.column("speed_cmd_rad_s").unwrap();
    // Two milliseconds behind a row, of ten.
    assert!(near(command[0], rad_s(100.0)) && near(command[199], rad_s(100.0)));
    let wrong = kort(&["fit", &log, "--rig", "t200", "--columns", "vesc-can:id=06,pole_pairs=7"]);
    assert_eq!(wrong.status.code(), Some(2));
    assert!(stderr(&wrong).contains("0x00000906"), "{}", stderr(&wrong));
}

/// Two interfaces, extended and short identifiers, marks of direction: as can-utils' own asc2log wrote them.
#[test]
fn what_can_utils_write_comes_in() {
    let log = "tests/recordings/logs/two-drives.candump.log.gz";
    let found = columns(log);
    assert_eq!(found["format"], "candump");
    for (name, frames) in [("0x00000905", 1000), ("0x301", 500), ("0x281", 500), ("0x701", 10)] {
        assert_eq!(topic(&found, name)["messages"], frames, "{name}");
    }
    let vesc = read(log, "vesc-can:id=05,pole_pairs=7");
    let rad_s = |rpm: f64| rpm * std::f64::consts::TAU / 60.0;
    assert_eq!((vesc.rows(), vesc.losses.len()), (1000, 0));
    assert!(near(vesc.column("duty_cmd").unwrap()[300], 0.2));
    assert!(near(vesc.column("shaft_speed_rad_s").unwrap()[399], rad_s(4200.0 / 7.0)));
    assert!(near(vesc.column("current_a").unwrap()[799], -9.0 + 0.3 * 25.0));
    let drive = read(log, "canopen-402:pdo=281,command=301");
    let command = samples(&drive, "speed_cmd_rad_s");
    assert!(near(command[250].1, rad_s(600.0)) && near(command[350].1, rad_s(-450.0)));
    let settled =
        samples(&drive, "shaft_speed_rad_s").into_iter().take_while(|(at, _)| *at < drive.time_s[399]);
    assert!(
        near(settled.last().unwrap().1, rad_s(-450.0)),
        "{:?}",
        samples(&drive, "shaft_speed_rad_s").len()
    );
}
