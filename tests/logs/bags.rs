//! Bags of ROS 2 in sqlite and blackboxes of Betaflight, and what is written of a log.

use serde_json::Value;

use crate::lab::{self, json, kort, stderr, write};
use crate::{columns, field, near, read, samples, shipped, topic, writers};

fn unpacked(name: &str) -> Vec<u8> {
    let mut whole = Vec::new();
    let file = std::fs::File::open(format!("tests/recordings/logs/{name}")).unwrap();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(file), &mut whole).unwrap();
    whole
}

/// The same messages as in the MCAP bag, by another library's writer; this file does not describe its types.
#[test]
fn a_bag_in_sqlite_reads_as_the_same_bag_in_mcap() {
    let bag = "tests/recordings/logs/ros2-two-thrusters.db3.gz";
    let found = columns(bag);
    assert_eq!(found["format"], "ROS 2 bag (sqlite)");
    assert_eq!(topic(&found, "joint_states")["messages"], 1000);
    assert_eq!(shipped(&found), ["ros2:command=forward_velocity_controller/commands,joint=0"]);
    let [sqlite, mcap] =
        [bag, "tests/recordings/logs/ros2-two-thrusters.mcap"].map(|log| read(log, "ros2:joint=1"));
    assert_eq!((&sqlite.time_s, sqlite.columns.len()), (&mcap.time_s, mcap.columns.len()));
    for (a, b) in sqlite.columns.iter().zip(&mcap.columns) {
        assert_eq!(a.name, b.name);
        assert!(
            a.values.iter().zip(&b.values).all(|(a, b)| a == b || (a.is_nan() && b.is_nan())),
            "{}",
            a.name
        );
    }
    let fit = json(&kort(&["fit", bag, "--rig", "speed-drive", "--columns", "ros2", "--json"]));
    assert!(fit["channels"]["shaft_speed_rad_s"].is_object(), "{fit}");
    // Its newest changes might have stood in a second file: it is read all the same.
    let mut whole = unpacked("ros2-two-thrusters.db3.gz");
    whole[18..20].fill(2);
    assert_eq!(read(&write("wal.db3", &whole), "ros2:joint=1").rows(), 1000);
}

/// A vehicle's topics have names of its own: commands that say so are found; where there are none the map is named all the same, with
/// what it lacks.
#[test]
fn the_map_of_ros_2_is_proposed_whatever_the_commands_are_called() {
    let renamed = |file: &str, from: &str, to: &str| {
        assert_eq!(from.len(), to.len(), "in place");
        let mut whole = unpacked("ros2-two-thrusters.db3.gz");
        let at = |whole: &[u8]| whole.windows(from.len()).position(|bytes| bytes == from.as_bytes());
        while let Some(at) = at(&whole) {
            whole[at..at + from.len()].copy_from_slice(to.as_bytes());
        }
        write(file, whole)
    };
    let log = renamed("own.db3", "forward_velocity_controller", "both_thrusters_of_the_craft");
    let call = "ros2:command=both_thrusters_of_the_craft/commands,joint=0";
    assert_eq!(shipped(&columns(&log)), [call]);
    let recording = read(&log, call);
    assert!(recording.column("speed_cmd_rad_s").is_some_and(|speed| speed.iter().any(|rad_s| *rad_s != 0.0)));

    let log = renamed("none.db3", "controller/commands", "controller/measured");
    let found = columns(&log);
    assert!(shipped(&found).is_empty(), "{found}");
    let part = &found["proposal"]["incomplete"][0];
    assert_eq!(part["map"], "ros2:command=forward_velocity_controller/commands,joint=0");
    assert_eq!(part["has"], serde_json::json!(["shaft_angle_rad", "shaft_speed_rad_s"]));
    let lack = serde_json::json!([{"column": "speed_cmd_rad_s", "source": "forward_velocity_controller/commands.data[0]"}]);
    assert_eq!(part["lacks"], lack);
    let said = String::from_utf8(kort(&["columns", &log]).stdout).unwrap();
    for words in ["a shipped map fits in part: ros2", "lacks  speed_cmd_rad_s: there is no forward_velocity"]
    {
        assert!(said.contains(words), "{words}: {said}");
    }
}

/// Written by ROS 2 itself (rosbag2's own test file): messages of a type that the bag describes.
#[test]
fn a_bag_of_ros_2_itself_reads_by_its_own_descriptions() {
    let found = columns("tests/recordings/logs/rosbag2-cdr-test.db3.gz");
    let basic = topic(&found, "test_topic");
    assert_eq!(basic["messages"], 3);
    assert!(near(basic["to_s"].as_f64().unwrap(), 0.100_350_303));
    let value = field(basic, "test_topic.int32_value");
    assert_eq!((&value["min"], &value["max"]), (&123.0.into(), &123.0.into()));
    assert_eq!(topic(&found, "array_topic")["messages"], 4);
}

/// The beginning of a real flight, against the numbers that another reader (orangebox 0.5) gives for the same bytes.
#[test]
fn a_betaflight_log_reads_with_its_units() {
    let log = "tests/recordings/logs/betaflight-4.2.bfl.gz";
    let said = kort(&["columns", log, "--json"]);
    assert_eq!(said.status.code(), Some(3), "it ends in the middle: {}", stderr(&said));
    assert!(stderr(&said).contains("without its end"), "{}", stderr(&said));
    let found: Value = serde_json::from_slice(&said.stdout).unwrap();
    assert_eq!(found["format"], "Betaflight blackbox");
    let main = topic(&found, "main");
    assert_eq!(main["messages"], 2016);
    assert_eq!(field(main, "main.amperageLatest")["unit"], "A");
    assert_eq!(field(main, "main.motor[0]")["max"], 1163.0);
    assert!(shipped(&found).iter().any(|name| name.starts_with("betaflight-vehicle")), "{found}");
    let recording = read(log, "betaflight-vehicle:motor=3");
    assert_eq!(recording.rows(), 2016);
    assert!(near(recording.time_s[1000] - recording.time_s[0], 453.223_772 - 452.208_896));
    let at = |name: &str, row: usize| recording.column(name).unwrap()[row];
    for (row, motor, vbat, amperage, gyro, acc) in [
        (0, 194.0, 2273.0, 0.0, -1.0, 2090.0),
        (1000, 533.0, 2243.0, 745.0, 1.0, 2099.0),
        (2015, 684.0, 2219.0, 2585.0, -12.0, 1833.0f64),
    ] {
        assert!(near(at("duty_cmd", row), (motor - 48.0) / 1999.0), "{row}");
        assert!(
            near(at("supply_v", row), vbat / 100.0) && near(at("battery_current_a", row), amperage / 100.0),
            "{row}"
        );
        assert!((at("turn_rate_x_rad_s", row) - f64::to_radians(gyro)).abs() < 1e-7, "{row}");
        assert!(near(at("acceleration_z_m_s2", row), acc / 2048.0 * 9.806_65), "{row}");
    }
    assert!(recording.notes.iter().any(|note| note.contains("Betaflight 4.2.0")), "{:?}", recording.notes);
    // No speed is in this firmware's logs, and the map that wants it says so.
    let refused = kort(&["fit", log, "--rig", "t200", "--columns", "betaflight:pole_pairs=7"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains("main.eRPM[0]"), "{}", stderr(&refused));
    // Two flights in one file, the clock of the second begins anew; a stretch of nonsense within.
    let whole = unpacked("betaflight-4.2.bfl.gz");
    let twice = kort(&["columns", &write("twice.bfl", [&whole[..], &whole[..]].concat()), "--json"]);
    let twice: Value = serde_json::from_slice(&twice.stdout).unwrap();
    assert_eq!((&topic(&twice, "main")["messages"], &twice["resets"]), (&4032.into(), &1.into()));
    let mut bad = whole.clone();
    let middle = bad.len() / 2;
    bad[middle..middle + 500].fill(0xa5);
    let recording = read(&write("bad.bfl", &bad), "betaflight-vehicle");
    assert!(recording.rows() > 1500 && recording.rows() < 2016, "{}", recording.rows());
}

/// Written as the format's description has it: changed frames are predicted from whole ones, and speeds from pole pairs.
#[test]
fn a_betaflight_log_with_motor_speeds() {
    let log = write("erpm.bbl", writers::blackbox(500));
    let found = columns(&log);
    assert_eq!(shipped(&found), ["betaflight:motor=0,pole_pairs=7"], "{found}");
    let recording = read(&log, "betaflight:pole_pairs=7");
    assert_eq!((recording.rows(), &recording.losses), (500, &vec![]));
    let speed = recording.column("shaft_speed_rad_s").unwrap();
    let duty = recording.column("duty_cmd").unwrap();
    for k in 0..500_usize {
        let rpm = 100.0 * writers::erpm(k as i64) as f64 / 7.0;
        assert!(near(speed[k], rpm * std::f64::consts::TAU / 60.0), "{k}");
        assert!(near(duty[k], (158.0 + 10.0 * (k % 50) as f64 - 48.0) / 1999.0), "{k}");
        assert!(near(recording.column("supply_v").unwrap()[k], (2400 - k % 7) as f64 / 100.0), "{k}");
    }
    assert!(recording.notes.iter().any(|note| note.contains("motor_poles = 14")), "{:?}", recording.notes);
}

#[test]
fn a_log_is_converted_by_its_map() {
    let parquet = lab::path("flight.parquet");
    let log = "tests/recordings/logs/px4-uavcan-escs.ulg.gz";
    let done = kort(&["convert", log, "--columns", "px4-uavcan:bank=1,motor=3", "-o", &parquet]);
    assert_eq!(done.status.code(), Some(0), "{}", stderr(&done));
    assert!(String::from_utf8_lossy(&done.stdout).contains("364 rows of"), "{done:?}");
    // What the map leaves out is said, not dropped in silence.
    assert!(stderr(&done).contains("columns not used: "), "{}", stderr(&done));
    let bytes = std::fs::read(&parquet).unwrap();
    assert!(bytes.starts_with(b"PAR1") && bytes.ends_with(b"PAR1"), "the format's own marks");
    let csv = lab::path("flight.csv");
    assert_eq!(
        kort(&["convert", log, "--columns", "px4-uavcan:bank=1,motor=3", "-o", &csv]).status.code(),
        Some(0)
    );
    let [once, again] = [
        read(log, "px4-uavcan:bank=1,motor=3"),
        kort_recording::Recording::read(std::path::Path::new(&csv), None).unwrap(),
    ];
    assert_eq!(samples(&once, "shaft_speed_rad_s"), samples(&again, "shaft_speed_rad_s"));
    let refused = kort(&["convert", log, "--columns", "px4-uavcan:bank=1", "-o", &lab::path("flight.xlsx")]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(stderr(&refused).contains(".parquet"), "{}", stderr(&refused));
    // One that fails leaves nothing new behind, and what was there as it was.
    let (new, old) = (lab::path("of-no-log.csv"), write("of-an-earlier-log.csv", "time_s,current_a\n"));
    for output in [&new, &old] {
        let failed = kort(&["convert", log, "--columns", "px4-uavcan:bank=7,motor=3", "-o", output]);
        assert_eq!(failed.status.code(), Some(2), "{}", stderr(&failed));
    }
    assert!(!std::path::Path::new(&new).exists());
    assert_eq!(std::fs::read_to_string(&old).unwrap(), "time_s,current_a\n");
}
