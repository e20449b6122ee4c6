//! CiA 402 on CANopen, behind an adapter that speaks slcan. A virtual CAN needs a kernel that has one; records of a raw socket are
//! tested beside the port (`services/servo/src/link`).

use kort_emulators::cia402::Make;
use kort_emulators::{Adapter, Bench as Emulator, Cia402, Mischief};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, DriveKind};

use crate::common::in_real_time;
use crate::link::{Case, SILENCE, rig};

fn case() -> Case {
    Case::new("cia402", "units_per_turn = 4096")
}

fn cia402(make: Make) -> Emulator {
    Emulator::start(Adapter::new(Cia402::new(make, &rig("whitcomb-yoerger-1999")))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    in_real_time(|| case().serves(&cia402(Make::default())));
}

/// An adapter's line has no check sum: a turned bit is noticed by what it makes of status or speed, or by a line that is none. Of
/// answers that are repeated one of the two that make a reading is missing.
#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    in_real_time(|| {
        let flipped = [
            Fault::DriveLost,
            Fault::DriveUnguarded,
            Fault::DriveRestarted,
            Fault::AmplifierFault,
            Fault::SensorSpike,
            Fault::OverSpeed,
            Fault::OverCurrent,
        ];
        let emulator = cia402(Make::default());
        case().endures_its_wire(&emulator, &flipped, &[Fault::DriveLost], SILENCE, &[Mischief::Split]);
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    in_real_time(|| {
        case().outlives_its_servo(&cia402(Make::default()));
        // One that cannot but go into fault without its master, and coasts there once it is told to.
        let faults = Make { locked: vec![(0x6007, 0)], ..Make::default() };
        case().outlives_its_servo(&cia402(faults));
    });
}

#[test]
fn a_drive_that_resets_or_reports_a_fault_ends_at_zero() {
    in_real_time(|| {
        let emulator = cia402(Make { node: 5, bitrate: 6, ..Make::default() });
        let case = Case { keys: "units_per_turn = 4096, address = 5, bitrate = 500000", ..case() };
        case.resets_and_reports(&emulator, 0x2310, "error 0x2310, current");
    });
}

#[test]
fn it_is_not_armed_while_its_watchdog_is_not_confirmed() {
    in_real_time(|| {
        let locked = |at| Make { locked: vec![at], ..Make::default() };
        let without = |at| Make { without: vec![at], ..Make::default() };
        let fault_brakes = Make { locked: vec![(0x6007, 0), (0x605e, 0)], ..Make::default() };
        let goes_on =
            Make { stored: vec![((0x6007, 0), 2, 0)], locked: vec![(0x6007, 0)], ..Make::default() };
        for (make, words) in [
            (locked((0x1016, 1)), "consumer heartbeat time (0x1016:1) stays 0x0"),
            (without((0x1016, 1)), "does not tell its consumer heartbeat time (0x1016:1)"),
            (goes_on, "abort connection option code (0x6007) stays 0"),
            (without((0x6007, 0)), "does not tell its abort connection option code (0x6007:0)"),
            (fault_brakes, "fault reaction (0x605E) stays 2"),
        ] {
            case().cannot_be_armed(&cia402(make), words);
        }
    });
}

/// Swapped units, a mode that it does not have, and a drive that is not the one that is meant.
#[test]
fn it_is_not_armed_when_it_is_another_one_than_was_described() {
    in_real_time(|| {
        let rpm = || Make { stored: vec![((0x60a9, 0), 4, 0x00b4_4700)], ..Make::default() };
        case().cannot_be_armed(&cia402(rpm()), "speed_units = 60");
        let no_torque = Make { stored: vec![((0x6502, 0), 4, 0x01ed)], ..Make::default() };
        case().cannot_be_armed(&cia402(no_torque), "without mode 10");
        let other = Case { keys: "units_per_turn = 4096, identity = \"9a:30924:1\"", ..case() };
        other.cannot_be_armed(&cia402(Make::default()), "two drives swapped?");
        let described = Case { keys: "units_per_turn = 4096, speed_units = 60", ..case() };
        described.outlives_its_servo(&cia402(rpm()));
    });
}

#[test]
fn speed_is_given_to_its_own_loop() {
    in_real_time(|| {
        let emulator =
            Emulator::start(Adapter::new(Cia402::new(Make::default(), &rig("speed-drive")))).unwrap();
        let command = Command { kind: DriveKind::Speed as u32, ..Command::default() };
        Case { drive: 30.0, command, rig: "speed-drive", ..case() }.follows(&emulator);
    });
}
