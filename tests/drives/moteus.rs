//! moteus.

use kort_emulators::moteus::Make;
use kort_emulators::{Bench as Emulator, Mischief, Moteus};
use kort_proto::faults::Fault;

use crate::common::in_real_time;
use crate::link::{Case, SILENCE, rig};

fn case() -> Case {
    Case::new("moteus", "")
}

fn moteus(make: Make) -> Emulator {
    Emulator::start(Moteus::new(make, &rig("whitcomb-yoerger-1999"))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    in_real_time(|| case().serves(&moteus(Make::default())));
}

/// On a UART, where lines carry check sums: noise costs a line, and with it an answer. An answer that comes again instead of
/// the new one shows by its millisecond counter.
#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    in_real_time(|| {
        let uart = moteus(Make { uart: true, ..Make::default() });
        case().endures_its_wire(&uart, &[Fault::DriveLost], &[Fault::DriveLost], SILENCE, &[Mischief::Split]);
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    in_real_time(|| case().outlives_its_servo(&moteus(Make::default())));
}

#[test]
fn a_drive_that_resets_or_reports_a_fault_ends_at_zero() {
    in_real_time(|| {
        let emulator = moteus(Make { address: 5, ..Make::default() });
        let case = Case { keys: "address = 5", ..case() };
        case.resets_and_reports(&emulator, 33, "fault 33");
    });
}

#[test]
fn it_is_not_armed_while_its_time_out_would_brake() {
    in_real_time(|| {
        let make = Make { read_only: true, ..Make::default() };
        case().cannot_be_armed(&moteus(make), "timeout_mode stays 12");
    });
}

/// One that tells no number is driven where none is asked for, and not where one is.
#[test]
fn it_is_not_armed_when_it_does_not_tell_who_it_is() {
    in_real_time(|| {
        let nameless = Make { serial_number: None, ..Make::default() };
        case().outlives_its_servo(&moteus(nameless.clone()));
        let meant = Case { keys: "identity = \"2037375753504b068034001c\"", ..case() };
        meant.cannot_be_armed(&moteus(nameless), "it does not tell its serial number");
    });
}
