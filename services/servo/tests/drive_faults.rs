//! What a drive on a wire says of itself, from its emulator through its protocol and its thread to the tick: a fault is
//! there while the drive has it, and ends with it, by itself or by a reset.

use std::time::{Duration, Instant};

use kort_emulators::{Adapter, ArduSub, Bench, Cia402, Moteus, ODrive, Vesc, ardusub, cia402, moteus, vesc};
use kort_proto::config::Config;
use kort_proto::faults::Fault;
use kort_proto::transport::monotonic_ns;
use kort_servo::devices::{At, Devices};
use kort_servo::drives;
use kort_thruster::rig::Rig;

/// How long anything may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// A drive on its emulator, as the servo's loop has it.
struct Loop {
    emulator: Bench,
    devices: Devices,
}

impl Loop {
    fn new(kind: &str, keys: &str, emulator: Bench, rig: &Rig) -> Self {
        let drive = format!(
            "\"{kind}\"\ndrive = {{ port = {:?}, reading_life_ms = 300, timeout_ms = 510, {keys} }}",
            emulator.port()
        );
        let text = include_str!("../../../config/kort.toml")
            .replace("amplifier = \"simulated\"", &format!("amplifier = {drive}"));
        let config = Config::parse(&text, None).unwrap();
        let thruster = config.thruster("t1").unwrap();
        let drive = drives::choose(&config, "t1", thruster, rig).unwrap().start("t1", 0).unwrap();
        Self { emulator, devices: Devices::new(drive, Vec::new(), monotonic_ns()) }
    }

    /// Ticks, with the output on at zero while nothing is wrong, until the faults shown now, and those shown on the
    /// way, are as wanted.
    fn until(&mut self, what: &str, wanted: impl Fn(u64, u64) -> bool) {
        let (end, mut seen) = (Instant::now() + PATIENCE, 0);
        loop {
            let now_ns = monotonic_ns();
            let faults = self.devices.show(At { now_ns, ticks: 1 }).faults;
            self.devices.drive(now_ns, (faults == 0).then_some(0.0));
            seen |= faults;
            if wanted(faults, seen) {
                return;
            }
            assert!(Instant::now() < end, "waited in vain for {what}: {faults:#x}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn a_drives_own_fault_ends_with_it_and_with_a_reset() {
    let rig = Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
    let vesc = Bench::start(Vesc::new(vesc::Make::default(), &rig)).unwrap();
    let odrive = Bench::start(ODrive::new(&rig, false)).unwrap();
    let moteus = Bench::start(Moteus::new(moteus::Make::default(), &rig)).unwrap();
    let cia402 = Bench::start(Adapter::new(Cia402::new(cia402::Make::default(), &rig))).unwrap();
    let vehicle = Rig::from_toml(include_str!("../../../config/thrusters/t200-vehicle.toml")).unwrap();
    let mavlink = Bench::start(ArduSub::new(ardusub::Make::default(), &vehicle)).unwrap();
    let own = |faults: u64| faults & Fault::AmplifierFault.bit() != 0;
    for (kind, keys, emulator, code) in [
        ("vesc", "pole_pairs = 7", vesc, 4),
        ("odrive", "baud = 115200", odrive, 0x40),
        ("moteus", "address = 1", moteus, 33),
        ("cia402", "units_per_turn = 4096", cia402, 0x4310),
        ("mavlink", "motor = 3", mavlink, 9),
    ] {
        let rig = if kind == "mavlink" { &vehicle } else { &rig };
        let mut servo = Loop::new(kind, keys, emulator, rig);
        servo.until(&format!("{kind} to be ready"), |now, _| now == 0);
        servo.emulator.report(code);
        servo.until(&format!("the fault of {kind}"), |_, seen| own(seen));
        servo.emulator.report(0);
        servo.until(&format!("the end of {kind}'s fault"), |now, _| now == 0);
        servo.emulator.report(code);
        servo.until(&format!("the fault of {kind} again"), |_, seen| own(seen));
        servo.emulator.restart();
        let reset = Fault::DriveRestarted.bit() | Fault::DriveLost.bit();
        servo.until(&format!("{kind} after its reset"), |now, seen| now == 0 && seen & reset != 0);
    }
}
