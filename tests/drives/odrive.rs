//! ODrive.

use std::time::Duration;

use kort_emulators::{Bench as Emulator, Mischief, ODrive};
use kort_proto::faults::Fault;
use kort_proto::messages::Command;

use crate::link::{Case, LIFE_MS, TIMEOUT_MS, alone, rig};

/// The drive's watchdog as kort sets it.
const TIMEOUT: Duration = Duration::from_millis(TIMEOUT_MS + 10);
/// `checks.frozen_s`, and an exchange.
const FROZEN: Duration = Duration::from_millis(500 + 20);

fn case() -> Case {
    Case { kind: "odrive", keys: "", drive: 4.0, command: Command::default() }
}

fn odrive(read_only: bool) -> Emulator {
    Emulator::start(ODrive::new(&rig("whitcomb-yoerger-1999"), read_only)).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    let _alone = alone();
    crate::common::in_real_time(|| case().serves(&odrive(false)));
}

#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        // Noise costs a line, and with it the answer; a line repeated in the place of the others is no whole answer; whole old answers are VESC's test.
        let stale = [Fault::SensorFrozen, Fault::DriveLost];
        case().endures_its_wire(&odrive(false), TIMEOUT, &stale, FROZEN, &[Mischief::Split]);
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        case().outlives_its_servo(&odrive(false), TIMEOUT);
    });
}

#[test]
fn a_drive_that_resets_or_reports_a_fault_ends_at_zero() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        let emulator = odrive(false);
        let mut bench = case().servo(&emulator);
        let soon = Duration::from_millis(LIFE_MS + 30);
        let reset = [Fault::DriveRestarted, Fault::DriveLost];
        case().ends_at_zero(&mut bench, &emulator, &reset, soon, || emulator.restart(), || ());
        let fault = [Fault::AmplifierFault];
        case().ends_at_zero(
            &mut bench,
            &emulator,
            &fault,
            soon,
            || emulator.report(0x40),
            || emulator.report(0),
        );
        assert!(bench.site.log().contains("axis error 0x40"), "{}", bench.site.log());
    });
}

#[test]
fn it_is_not_armed_without_its_watchdog() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        case().cannot_be_armed(&odrive(true), "its watchdog stays off");
    });
}
