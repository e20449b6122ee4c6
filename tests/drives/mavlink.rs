//! One thruster of an ArduSub vehicle, through its autopilot.

use std::time::Duration;

use kort_emulators::ardusub::{Make, Telemetry};
use kort_emulators::{ArduSub, Bench as Emulator, Mischief};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, DriveKind, Outcome, RequestKind};

use crate::common::bench::Bench;
use crate::common::in_real_time;
use crate::common::wait;
use crate::link::{Case, SILENCE, rig};

const RIG: &str = "t200-vehicle";

/// After a stop a vehicle cools down for ten seconds; where a test is about something else its supply is cut for a moment.
fn case() -> Case {
    let command = Command { kind: DriveKind::Voltage as u32, ..Command::default() };
    let case = Case::new("mavlink", "motor = 3");
    Case { drive: 6.0, command, rig: RIG, thrust_n: 10.0, timeout_ms: 510, revive: Emulator::restart, ..case }
}

fn vehicle(make: Make) -> Emulator {
    Emulator::start(ArduSub::new(make, &rig(RIG))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    in_real_time(|| case().serves(&vehicle(Make::default())));
}

/// The same by UDP, with an ESC that tells its speed with a sign.
#[test]
fn by_udp_it_is_driven_too_and_ends_at_zero() {
    in_real_time(|| {
        let make = Make { telemetry: Telemetry::Signed, ..Make::default() };
        let emulator = Emulator::start_udp(ArduSub::new(make, &rig(RIG))).unwrap();
        case().serves(&emulator);
        emulator.restart();
        let mut bench = case().servo(&emulator);
        case().ends_at_zero(
            &mut bench,
            &emulator,
            &[Fault::DriveLost],
            Duration::from_millis(520),
            || emulator.spoil(Mischief::Unplugged),
            || {
                emulator.spoil(Mischief::None);
                emulator.restart();
            },
        );
    });
}

#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    in_real_time(|| {
        let lost = [Fault::DriveLost];
        let harmless = [Mischief::Split, Mischief::Noisy];
        // A repeated message tells its age by the vehicle's clock.
        case().endures_its_wire(&vehicle(Make::default()), &lost, &lost, SILENCE, &harmless);
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    in_real_time(|| case().outlives_its_servo(&vehicle(Make::default())));
}

#[test]
fn a_vehicle_that_resets_or_whose_fail_safe_acts_ends_at_zero() {
    in_real_time(|| {
        let emulator = vehicle(Make::default());
        case().resets_and_reports(&emulator, 9, "it is in mode 9, and is driven in MANUAL (19) only");
        emulator.restart();
        ended_by(&case(), &emulator, 101, &["motor 1 moves too"]);
    });
}

/// Somebody else acts on the vehicle: zero, a fault with one of these words, by what of it is heard first.
fn ended_by(case: &Case, emulator: &Emulator, code: u32, words: &[&str]) -> Bench {
    let mut bench = case.servo(emulator);
    let (report, mend) = (
        || emulator.report(code),
        || {
            emulator.report(0);
            (case.revive)(emulator);
        },
    );
    case.ends_at_zero(&mut bench, emulator, &[Fault::AmplifierFault], SILENCE, report, mend);
    let log = bench.site.log();
    assert!(words.iter().any(|words| log.contains(words)), "{log}");
    bench
}

/// What a pilot does stops kort; the vehicle's cool-down is waited for and told.
#[test]
fn a_pilot_ends_it_and_its_cool_down_is_told() {
    in_real_time(|| {
        let emulator = vehicle(Make::default());
        let patient = Case { revive: |_| (), ..case() };
        let words = ["it ended the motor test: disarmed", "it disarmed itself"];
        let bench = ended_by(&patient, &emulator, 100, &words);
        assert!(bench.site.log().contains("its own cool-down"), "{}", bench.site.log());
    });
}

#[test]
fn it_is_not_armed_without_a_known_time_out_or_against_somebody() {
    in_real_time(|| {
        let unknown = Make { version: [4, 9, 0], ..Make::default() };
        case().cannot_be_armed(&vehicle(unknown), "the time-out of its motor test is not known to kort");
        let copter = Make { kind: 2, ..Make::default() };
        case().cannot_be_armed(&vehicle(copter), "no submarine of ArduPilot's");
        let piloted = Make { piloted: true, ..Make::default() };
        case().cannot_be_armed(&vehicle(piloted), "it is armed by somebody else");
        let other = Case { keys: "motor = 3, identity = \"0011000000000000\"", ..case() };
        other.cannot_be_armed(&vehicle(Make::default()), "two drives swapped?");
        let absent = Case { keys: "motor = 12", ..case() };
        absent.cannot_be_armed(&vehicle(Make::default()), "no output of it is motor 12");
    });
}

/// What it says when it does not let itself be armed is in the log, and nothing is driven.
#[test]
fn its_reason_not_to_be_armed_is_told() {
    in_real_time(|| {
        let emulator = vehicle(Make { unfit: Some("Arm: Leak detected"), ..Make::default() });
        let mut bench = case().servo(&emulator);
        wait("it to be known", || bench.site.log().contains("a motor test ends").then_some(()));
        let cleared = |bench: &mut Bench| bench.ask(RequestKind::ClearFaults).0 == Outcome::Done;
        wait("the start to be forgotten", || cleared(&mut bench).then_some(()));
        bench.arm();
        wait("the servo to trip", || case().drive_for(&mut bench, 10).into_iter().find(|row| row.armed == 0));
        let words = "it does not let itself be armed: \"Arm: Leak detected\"";
        assert!(bench.site.log().contains(words), "{}", bench.site.log());
        assert!(emulator.driven().is_none(), "it was driven");
    });
}

#[test]
fn volts_are_given_as_pulse_width() {
    in_real_time(|| case().follows(&vehicle(Make::default())));
}
