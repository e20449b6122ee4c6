use super::*;

const RIG: &str = "rig = \"thrusters/whitcomb-yoerger-1999.toml\"";
const VOLTS: &str =
    concat!("rig = \"", env!("CARGO_MANIFEST_DIR"), "/../../config/thrusters/t200-vehicle.toml\"");

/// All that is wrong with a deployment of thrusters t1, t2, …, each with these lines.
fn wrong(thrusters: &[String]) -> String {
    let sections = thrusters.iter().zip(1..).map(|(lines, n)| format!("[thrusters.t{n}]\n{lines}\n"));
    let config = Config::parse(&sections.collect::<String>(), None).unwrap();
    let said = problems(&config).iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    for id in config.thrusters.keys() {
        let refused = read(&config, id).err().map(|e| e.to_string());
        assert_eq!(refused.is_some(), said.contains(&format!("`thrusters.{id}.")), "{id}: {said}");
    }
    said
}

fn drive(kind: &str, keys: &str) -> String {
    format!("{RIG}\namplifier = \"{kind}\"\ndrive = {{ {keys} }}")
}

fn cell(port: &str) -> String {
    format!(
        "sensors.cell = {{ kind = \"serial_line\", port = \"{port}\", signals = {{ thrust_n = {{ column = 1, unit = \"N\" }} }} }}"
    )
}

/// An analogue amplifier whose files have these names.
fn analogue(names: [&str; 5]) -> String {
    let [dac, watchdog, enabled, adc, count] = names;
    drive(
        "iio",
        &format!(
            "dac = \"/d/{dac}\", watchdog = \"/w/{watchdog}\", enabled = \"/e/{enabled}\", gain_a_per_v = 2.0, limit_v = 10.0, \
             current = {{ adc = \"/a/{adc}\", gain_a_per_v = 2.0 }}, counter = {{ count = \"/c/{count}\", counts_per_turn = 4096 }}"
        ),
    )
}

#[test]
fn what_two_thrusters_take_is_refused_by_both_names() {
    let vesc = |keys: &str| drive("vesc", &format!("pole_pairs = 7, {keys}"));
    let cia402 = |keys: &str| drive("cia402", &format!("units_per_turn = 4096, {keys}"));
    let motor = |keys: &str| {
        let keys = format!("timeout_ms = 510, {keys}");
        drive("mavlink", &keys).replace(RIG, VOLTS)
    };
    let one = ["out_voltage0", "a", "a", "in_voltage0", "count0"];
    let with = |place: usize, name: &'static str| {
        let mut names = ["out_voltage1", "b", "b", "in_voltage1", "count1"];
        names[place] = name;
        analogue(names)
    };
    for (first, second, key, value, allowed) in [
        (vesc("port = \"/dev/p\""), vesc("port = \"/dev/p\""), "port", "\"/dev/p\"", "one device a port"),
        (
            vesc("port = \"/dev/p\""),
            drive("odrive", "port = \"/dev/p\""),
            "port",
            "\"/dev/p\"",
            "one device a port",
        ),
        // The adapter of a bus is one port too: the servos are processes of their own.
        (
            drive("moteus", "port = \"/dev/p\", address = 1"),
            drive("moteus", "port = \"/dev/p\", address = 2"),
            "port",
            "\"/dev/p\"",
            "one device a port",
        ),
        (
            cia402("port = \"/dev/p\", address = 1"),
            cia402("port = \"/dev/p\", address = 2"),
            "port",
            "\"/dev/p\"",
            "one device a port",
        ),
        (
            cia402("port = \"can0\""),
            cia402("port = \"can0\", address = 1"),
            "address",
            "1",
            "one drive a node on can0",
        ),
        (
            vesc("port = \"/dev/p\", identity = \"0A0041000751363532393532\""),
            vesc("port = \"/dev/q\", identity = \"0a0041000751363532393532\""),
            "identity",
            "\"0a0041000751363532393532\"",
            "one thruster a drive",
        ),
        (
            motor("motor = 3, port = \"udp:127.0.0.1:14550\", identity = \"0a41000751363532\""),
            motor("motor = 3, port = \"udp:127.0.0.1:14550\", identity = \"0a41000751363532\""),
            "motor",
            "3",
            "one thruster a motor",
        ),
        (
            motor("motor = 3, port = \"udp:127.0.0.1:14550\", identity = \"0a41000751363532\""),
            motor("motor = 3, port = \"/dev/p\", identity = \"0a41000751363532\""),
            "motor",
            "3",
            "one thruster a motor",
        ),
        (
            motor("motor = 3, port = \"/dev/p\""),
            motor("motor = 4, port = \"/dev/p\""),
            "port",
            "\"/dev/p\"",
            "one device a port",
        ),
        (analogue(one), with(0, "out_voltage0_raw"), "dac", "\"/d/out_voltage0\"", "one thruster a channel"),
        (analogue(one), with(1, "a"), "watchdog", "\"/w/a\"", "one thruster a watchdog"),
        (analogue(one), with(2, "a"), "enabled", "\"/e/a\"", "one thruster an input"),
        (
            analogue(one),
            with(3, "in_voltage0"),
            "current.adc",
            "\"/a/in_voltage0\"",
            "one thruster a current",
        ),
        (analogue(one), with(4, "count0"), "counter.count", "\"/c/count0\"", "one thruster a counter"),
    ] {
        // Another one beside them that has nothing of theirs.
        let words = wrong(&[first, second, format!("{RIG}\namplifier = \"simulated\"")]);
        let begin = format!(
            "built-in configuration: `thrusters.t2.drive.{key}` = {value} is `thrusters.t1.drive.{key}` too; allowed is {allowed}"
        );
        assert!(words.starts_with(&begin) && words.contains("\nhint: "), "{begin}\n{words}");
        assert_eq!(words.matches("hint: ").count(), 1, "{words}");
    }
}

#[test]
fn what_may_be_shared_is_shared() {
    let cia402 = |keys: &str| drive("cia402", &format!("units_per_turn = 4096, {keys}"));
    let motor = |n: u32| {
        let keys = format!(
            "timeout_ms = 510, motor = {n}, port = \"udp:127.0.0.1:14550\", identity = \"0a41000751363532\""
        );
        drive("mavlink", &keys).replace(RIG, VOLTS)
    };
    let flow = "sensors.flow = { kind = \"iio\", path = \"/d\", signals = { flow_m_s = { channel = \"in_voltage0\", scale = 1.0 } } }";
    let simulated = format!("{RIG}\namplifier = \"simulated\"");
    for (first, second) in [
        // Nodes of one bus, and drives that tell no serial number.
        (
            cia402("port = \"can0\", address = 1, identity = \"9a:30924:0\""),
            cia402("port = \"can0\", address = 2, identity = \"9a:30924:0\""),
        ),
        (cia402("port = \"can0\""), cia402("port = \"can1\"")),
        (motor(1), motor(2)),
        // Channels of one DAC, of one ADC and of one counter.
        (
            analogue(["out_voltage0", "a", "a", "in_voltage0", "count0"]),
            analogue(["out_voltage1", "b", "b", "in_voltage1", "count1"]),
        ),
        // A flow meter beside both.
        (format!("{simulated}\n{flow}"), format!("{simulated}\n{flow}")),
        (simulated.clone(), simulated),
    ] {
        assert_eq!(wrong(&[first, second]), "");
    }
}

#[test]
fn a_device_of_two_names_is_one() {
    let folder = tempfile::tempdir().unwrap();
    let [device, name] = ["ttyACM0", "by-id"].map(|name| folder.path().join(name));
    std::fs::write(&device, "").unwrap();
    std::os::unix::fs::symlink(&device, &name).unwrap();
    let vesc = |port: &std::path::Path| drive("vesc", &format!("pole_pairs = 7, port = {port:?}"));
    let words = wrong(&[vesc(&name), vesc(&device)]);
    let both = format!("`thrusters.t2.drive.port` = {device:?} is `thrusters.t1.drive.port` = {name:?} too");
    assert!(words.contains(&both), "{words}");
}

/// Not plugged in, it is known by the folder that is there.
#[test]
fn a_device_that_is_not_there_yet_is_one_by_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let inner = folder.path().join("inner");
    std::fs::create_dir(&inner).unwrap();
    let [first, second] = [folder.path().join("late"), inner.join("../late")];
    let vesc = |port: &std::path::Path| drive("vesc", &format!("pole_pairs = 7, port = {port:?}"));
    let words = wrong(&[vesc(&first), vesc(&second)]);
    assert!(words.contains(&format!("is `thrusters.t1.drive.port` = {first:?} too")), "{words}");
}

#[test]
fn drive_and_instrument_on_one_port_are_refused_by_name() {
    let vesc = drive("vesc", "pole_pairs = 7, port = \"/dev/p\"");
    let of_one = |port: &str| wrong(&[format!("{vesc}\n{}", cell(port))]);
    assert_eq!(of_one("/dev/q"), "");
    let words = of_one("/dev/p");
    assert!(words.contains("`thrusters.t1.sensors.cell.port` = \"/dev/p\""), "{words}");
    assert!(words.contains("`thrusters.t1.drive.port` too") && words.contains("\nhint: "), "{words}");
    let words = wrong(&[vesc, format!("{RIG}\namplifier = \"simulated\"\n{}", cell("/dev/p"))]);
    assert!(
        words.contains("`thrusters.t2.sensors.cell.port` = \"/dev/p\" is `thrusters.t1.drive.port` too"),
        "{words}"
    );
}

/// A thruster that is described wrongly keeps no other one from starting.
#[test]
fn another_thrusters_mistake_is_its_own() {
    let sound = drive("vesc", "pole_pairs = 7, port = \"/dev/p\"");
    let words = wrong(&[sound, drive("vesc", "port = \"/dev/q\"")]);
    assert!(words.contains("`thrusters.t2.drive.pole_pairs` is missing"), "{words}");
}

/// What is no port, no number and no key is told when the deployment is read, not when the link is opened.
#[test]
fn keys_of_a_drive_are_looked_at_before_it_is_opened() {
    let vesc = |keys: &str| drive("vesc", &format!("pole_pairs = 7, {keys}"));
    let simulated = |lines: &str| format!("{RIG}\namplifier = \"simulated\"\n{lines}");
    for (lines, words) in [
        (vesc("port = \"\""), "`thrusters.t1.drive.port` = \"\"; allowed is the whole path of a device"),
        (vesc("port = \"ttyACM0\""), "`thrusters.t1.drive.port` = \"ttyACM0\"; allowed is the whole"),
        (
            vesc("port = \"/dev/p\", identity = \"\""),
            "`thrusters.t1.drive.identity` = \"\"; allowed is 24 hexadecimal digits",
        ),
        (
            drive("odrive", "port = \"/dev/p\", identity = \"20843\""),
            "`thrusters.t1.drive.identity` = \"20843\"; allowed is 12 hexadecimal digits",
        ),
        (
            drive("cia402", "units_per_turn = 4096, port = \"can 0\""),
            "`thrusters.t1.drive.port` = \"can 0\"; allowed is the name of a CAN interface",
        ),
        (
            drive("cia402", "units_per_turn = 4096, port = \"can0\", identity = \"9a\""),
            "`thrusters.t1.drive.identity` = \"9a\"; allowed is vendor:product:serial",
        ),
        (
            analogue(["out_voltage0", "a", "a", "in_voltage0", "count0"])
                .replace("limit_v", "identity = \" \", limit_v"),
            "`thrusters.t1.drive.identity` = \" \"; allowed is a name",
        ),
        (simulated(&cell("ttyUSB0")), "`thrusters.t1.sensors.cell.port` = \"ttyUSB0\"; allowed is"),
        // A section that is not read now: its keys are known ones, or a slip.
        (simulated("drive = { prt = \"/dev/p\" }"), "did you mean `port`?"),
        (simulated("drive = { dac = \"/d/out_voltage0\", limit = 3.0 }"), "did you mean `limit_v`?"),
        (simulated("simulation = { sead = 3 }"), "did you mean `seed`?"),
        (format!("{}\nsimulation = {{ sead = 3 }}", vesc("port = \"/dev/p\"")), "did you mean `seed`?"),
    ] {
        let said = wrong_anywhere(&lines);
        assert!(said.contains(words) && said.contains("thrusters.t1."), "{words}\n{said}");
        assert_eq!(said.matches("hint: ").count(), 1, "{said}");
    }
    // A deployment that is tried on the simulated stand keeps its drive's section.
    let waits = "drive = { port = \"/dev/p\", pole_pairs = 7, identity = \"3e0041000751363532393532\" }";
    assert_eq!(wrong(&[simulated(waits)]), "");
}

/// All that is wrong with a thruster of these lines.
fn wrong_anywhere(lines: &str) -> String {
    let config = Config::parse(&format!("[thrusters.t1]\n{lines}\n"), None).unwrap();
    problems(&config).iter().map(ToString::to_string).collect::<Vec<_>>().join("\n")
}
