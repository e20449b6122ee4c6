//! moteus.

use std::time::Duration;

use kort_emulators::moteus::Make;
use kort_emulators::{Bench as Emulator, Mischief, Moteus};
use kort_proto::faults::Fault;
use kort_proto::messages::Command;

use crate::link::{Case, LIFE_MS, TIMEOUT_MS, alone, rig};

/// The time that each command is valid for.
const TIMEOUT: Duration = Duration::from_millis(TIMEOUT_MS + 10);
/// A reading's life in these tests, and some exchanges.
const STALE: Duration = Duration::from_millis(LIFE_MS + 30);

fn case() -> Case {
    Case { kind: "moteus", keys: "", drive: 4.0, command: Command::default() }
}

fn moteus(make: Make) -> Emulator {
    Emulator::start(Moteus::new(make, &rig("whitcomb-yoerger-1999"))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    let _alone = alone();
    crate::common::in_real_time(|| case().serves(&moteus(Make::default())));
}

/// On a UART, where lines carry check sums: noise costs a line, and with it an answer. An answer that comes again instead of
/// the new one shows by its millisecond counter.
#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        let uart = moteus(Make { uart: true, ..Make::default() });
        case().endures_its_wire(&uart, TIMEOUT, &[Fault::DriveLost], STALE, &[Mischief::Split]);
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        case().outlives_its_servo(&moteus(Make::default()), TIMEOUT);
    });
}

#[test]
fn a_drive_that_resets_or_reports_a_fault_ends_at_zero() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        let emulator = moteus(Make { address: 5, ..Make::default() });
        let case = Case { keys: "address = 5", ..case() };
        let mut bench = case.servo(&emulator);
        let soon = Duration::from_millis(LIFE_MS + 30);
        let reset = [Fault::DriveRestarted, Fault::DriveLost];
        case.ends_at_zero(&mut bench, &emulator, &reset, soon, || emulator.restart(), || ());
        let fault = [Fault::AmplifierFault];
        case.ends_at_zero(&mut bench, &emulator, &fault, soon, || emulator.report(33), || emulator.report(0));
        assert!(bench.site.log().contains("fault 33"), "{}", bench.site.log());
    });
}

#[test]
fn it_is_not_armed_while_its_time_out_would_brake() {
    let _alone = alone();
    crate::common::in_real_time(|| {
        let make = Make { read_only: true, ..Make::default() };
        case().cannot_be_armed(&moteus(make), "timeout_mode stays 12");
    });
}
