//! ODrive.

use kort_emulators::odrive::Make;
use kort_emulators::{Bench as Emulator, Mischief, ODrive};
use kort_proto::faults::Fault;

use crate::common::in_real_time;
use crate::link::{Case, FROZEN, rig};

fn case() -> Case {
    Case::new("odrive", "")
}

fn odrive(make: Make) -> Emulator {
    Emulator::start(ODrive::new(make, &rig("whitcomb-yoerger-1999"))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    in_real_time(|| case().serves(&odrive(Make::default())));
}

#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    in_real_time(|| {
        // Noise costs a line, and with it the answer; a line repeated in the place of the others is no whole answer;
        // whole old answers are VESC's test.
        let stale = [Fault::SensorFrozen, Fault::DriveLost];
        case().endures_its_wire(
            &odrive(Make::default()),
            &[Fault::DriveLost],
            &stale,
            FROZEN,
            &[Mischief::Split],
        );
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    in_real_time(|| case().outlives_its_servo(&odrive(Make::default())));
}

#[test]
fn a_drive_that_resets_or_reports_a_fault_ends_at_zero() {
    in_real_time(|| case().resets_and_reports(&odrive(Make::default()), 0x40, "axis error 0x40"));
}

#[test]
fn it_is_not_armed_without_its_watchdog() {
    in_real_time(|| {
        let read_only = odrive(Make { read_only: true, ..Make::default() });
        case().cannot_be_armed(&read_only, "its watchdog stays off");
    });
}

/// One that tells no number is driven where none is asked for, and not where one is.
#[test]
fn it_is_not_armed_when_it_does_not_tell_who_it_is() {
    in_real_time(|| {
        let nameless = Make { serial_number: None, ..Make::default() };
        case().outlives_its_servo(&odrive(nameless.clone()));
        let meant = Case { keys: "identity = \"2084377D3548\"", ..case() };
        meant.cannot_be_armed(&odrive(nameless), "it does not tell its serial number");
    });
}
