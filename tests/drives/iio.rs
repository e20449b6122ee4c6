//! An analogue amplifier behind Linux Industrial I/O, with an external watchdog.

use std::time::Duration;

use kort_emulators::iio::{Enabled, Make};
use kort_emulators::{Amplifier, Bench as Emulator, Mischief};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, DriveKind, RequestKind};
use rustix::fs::{Mode, OFlags, open};

use crate::common::{in_real_time, wait};
use crate::link::{Case, FROZEN, rig};

/// A loss of a file is noticed at the next exchange.
const EXCHANGE: Duration = Duration::from_millis(20);

/// At a rate at which the emulator's files, written anew each 0.5 ms, show speed well enough.
const KEYS: &str = "rate_hz = 100, gain_a_per_v = 2.0, limit_v = 10.0";

fn place(emulator: &Emulator) -> String {
    let at = |file: &str| emulator.port().join(file);
    format!(
        "dac = {:?}, watchdog = {:?}, enabled = {:?}, {}",
        at("iio:device0/out_voltage0_raw"),
        at("leds/watchdog/brightness"),
        at("gpio/enabled/value"),
        monitors(emulator)
    )
}

fn monitors(emulator: &Emulator) -> String {
    let at = |file: &str| emulator.port().join(file);
    format!(
        "current = {{ adc = {:?}, gain_a_per_v = 2.0 }}, counter = {{ count = {:?}, counts_per_turn = 4096 }}",
        at("iio:device1/in_voltage0"),
        at("counter0/count0")
    )
}

fn case() -> Case {
    Case { place, ..Case::new("iio", KEYS) }
}

fn amplifier(make: Make) -> Emulator {
    Emulator::start_in_folder(Amplifier::new(make, &rig("whitcomb-yoerger-1999"))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    in_real_time(|| case().serves(&amplifier(Make::default())));
}

#[test]
fn every_fault_of_its_files_ends_at_zero() {
    in_real_time(|| {
        let emulator = amplifier(Make::default());
        let case = case();
        let mut bench = case.servo(&emulator);
        let lost = [Fault::DriveLost];
        // The DAC of one that is unplugged keeps its volts: the watchdog ends them.
        for (mischief, faults, bound) in [
            (Mischief::Unplugged, lost, case.timeout()),
            (Mischief::Garbage, lost, EXCHANGE),
            (Mischief::Truncated, lost, EXCHANGE),
            (Mischief::Stale, [Fault::SensorFrozen], FROZEN),
        ] {
            println!("{mischief:?}");
            let spoil = || emulator.spoil(mischief);
            case.ends_at_zero(&mut bench, &emulator, &faults, bound, spoil, || {
                emulator.spoil(Mischief::None)
            });
        }
        // The line of the watchdog alone, and one monitor alone.
        for file in ["leds/watchdog/brightness", "iio:device1/in_voltage0_raw", "counter0/count0/count"] {
            let file = emulator.port().join(file);
            let text = std::fs::read_to_string(&file).unwrap();
            // What shows something is put there again by the emulator itself: gone is then a folder in its place.
            let gone = || {
                wait("the file to be gone", || {
                    let _ = std::fs::remove_file(&file);
                    std::fs::create_dir(&file).ok()
                });
            };
            let back = || {
                if std::fs::remove_dir(&file).is_ok() {
                    std::fs::write(&file, &text).unwrap();
                }
            };
            println!("{}", file.display());
            case.ends_at_zero(&mut bench, &emulator, &lost, EXCHANGE, gone, back);
        }
    });
}

/// The DAC's own file is gone while the watchdog's line is not: no pulse is given, and the enable falls.
#[test]
fn a_command_that_cannot_be_given_ends_by_the_watchdog() {
    in_real_time(|| {
        let emulator = amplifier(Make::default());
        let case = case();
        let mut bench = case.servo(&emulator);
        let (file, away) =
            (emulator.port().join("iio:device0/out_voltage0_raw"), emulator.port().join("away"));
        let gone = || std::fs::rename(&file, &away).unwrap();
        let back = || drop(std::fs::rename(&away, &file));
        case.ends_at_zero(&mut bench, &emulator, &[Fault::DriveLost], case.timeout(), gone, back);
        assert!(bench.site.log().contains("out_voltage0_raw"), "{}", bench.site.log());
    });
}

/// A bus that hangs holds up whoever reads: no pulse is given meanwhile, and the servo misses its readings.
#[test]
fn a_file_that_hangs_ends_by_the_watchdog() {
    in_real_time(|| {
        let emulator = amplifier(Make::default());
        let case = case();
        let mut bench = case.servo(&emulator);
        let [file, new, pipe] =
            ["gpio/enabled/value", "gpio/new", "gpio/pipe"].map(|at| emulator.port().join(at));
        // Whoever opens a pipe waits for its other end.
        let hang = || {
            let _ = std::fs::remove_file(&pipe);
            assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
            std::fs::hard_link(&pipe, &new).unwrap();
            std::fs::rename(&new, &file).unwrap();
        };
        let release = || drop(open(&pipe, OFlags::WRONLY | OFlags::NONBLOCK, Mode::empty()));
        case.ends_at_zero(&mut bench, &emulator, &[Fault::DriveLost], case.timeout(), hang, release);
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    in_real_time(|| case().outlives_its_servo(&amplifier(Make::default())));
}

/// Emergency stop, a fault of the amplifier's own, a supply of the watchdog that dips: the enable falls.
#[test]
fn an_enable_that_falls_ends_at_zero() {
    in_real_time(|| {
        let emulator = amplifier(Make::default());
        let mut bench = case().servo(&emulator);
        let own = [Fault::AmplifierFault];
        let (report, mend) = (|| emulator.report(1), || emulator.report(0));
        case().ends_at_zero(&mut bench, &emulator, &own, EXCHANGE, report, mend);
        assert!(bench.site.log().contains("its enable fell under the pulse"), "{}", bench.site.log());
        case().ends_at_zero(&mut bench, &emulator, &own, EXCHANGE, || emulator.restart(), || ());
    });
}

#[test]
fn it_is_not_armed_without_a_watchdog_that_was_seen_to_act() {
    in_real_time(|| {
        let stuck = |level| Make { enabled: Enabled::Stuck(level), ..Make::default() };
        for (make, words) in [
            (
                Make { watchdog_s: f64::INFINITY, ..Make::default() },
                "stays 1 for more than 300 ms without a pulse",
            ),
            (Make { watchdog_s: 0.8, ..Make::default() }, "stays 1 for more than 300 ms without a pulse"),
            (stuck(true), "stays 1 for more than 300 ms without a pulse"),
            (stuck(false), "its enable does not come"),
        ] {
            case().cannot_be_armed(&amplifier(make), words);
        }
        let none = |emulator: &Emulator| {
            let dac = emulator.port().join("iio:device0/out_voltage0");
            format!("dac = {dac:?}, watchdog = \"none\", {}", monitors(emulator))
        };
        Case { place: none, ..case() }
            .cannot_be_armed(&amplifier(Make::default()), "nothing takes the torque away");
    });
}

#[test]
fn it_is_not_armed_when_its_dac_is_another_one_than_was_described() {
    in_real_time(|| {
        let other = Case {
            keys: "rate_hz = 100, gain_a_per_v = 2.0, limit_v = 10.0, identity = \"mcp4725\"",
            ..case()
        };
        other.cannot_be_armed(&amplifier(Make::default()), "is ad5754r");
        let unipolar = Make { unipolar: true, ..Make::default() };
        case().cannot_be_armed(&amplifier(unipolar), "a DAC with both signs");
        let silent = || Make { tells_scale: false, ..Make::default() };
        case().cannot_be_armed(&amplifier(silent()), "scale_mv");
        let stated = Case {
            keys: "rate_hz = 100, gain_a_per_v = 2.0, limit_v = 10.0, scale_mv = 0.30517578125",
            ..case()
        };
        stated.follows(&amplifier(silent()));
    });
}

/// Readback and watchdog were honest at the start: an input that sticks on the way shows at the next disarming.
#[test]
fn an_input_that_sticks_is_found_out_by_the_disarming() {
    in_real_time(|| {
        let emulator = amplifier(Make::default());
        let case = case();
        let mut bench = case.servo(&emulator);
        case.turn(&mut bench, &emulator);
        emulator.spoil(Mischief::Stale);
        bench.ask(RequestKind::Disarm);
        wait("zero at the motor", || (emulator.truth().command == 0.0).then_some(()));
        wait("the fault", || {
            let rows = case.drive_for(&mut bench, 10);
            rows.last().filter(|row| row.faults & Fault::DriveUnguarded.bit() != 0).map(|_| ())
        });
    });
}

/// Volts for a rig that is driven by volts, and a speed loop in the amplifier.
#[test]
fn volts_and_speed_have_gains_of_their_own() {
    in_real_time(|| {
        for (name, kind, drive, gain, keys) in [
            (
                "t200-vehicle",
                DriveKind::Voltage,
                6.0,
                2.0,
                "rate_hz = 100, gain_v_per_v = 2.0, limit_v = 10.0",
            ),
            (
                "speed-drive",
                DriveKind::Speed,
                30.0,
                50.0,
                "rate_hz = 100, gain_rad_s_per_v = 50.0, limit_v = 10.0",
            ),
        ] {
            let make = Make { gain, ..Make::default() };
            let emulator = Emulator::start_in_folder(Amplifier::new(make, &rig(name))).unwrap();
            let command = Command { kind: kind as u32, ..Command::default() };
            Case { drive, command, rig: name, keys, ..case() }.follows(&emulator);
        }
    });
}
