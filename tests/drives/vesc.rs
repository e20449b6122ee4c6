//! VESC.

use std::time::{Duration, Instant};

use kort_emulators::vesc::Make;
use kort_emulators::{Bench as Emulator, Mischief, Vesc};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, DriveKind};

use crate::common::Stack;
use crate::common::in_real_time;
use crate::link::{Case, FROZEN, SILENCE, rig};

fn case() -> Case {
    Case::new("vesc", "pole_pairs = 7")
}

fn vesc(make: Make) -> Emulator {
    Emulator::start(Vesc::new(make, &rig("whitcomb-yoerger-1999"))).unwrap()
}

#[test]
fn the_service_drives_it_and_records() {
    in_real_time(|| case().serves(&vesc(Make::default())));
}

#[test]
fn every_fault_of_the_wire_ends_at_zero() {
    in_real_time(|| {
        let harmless = [Mischief::Split, Mischief::Noisy];
        case().endures_its_wire(
            &vesc(Make::default()),
            &[Fault::DriveLost],
            &[Fault::SensorFrozen],
            FROZEN,
            &harmless,
        );
    });
}

#[test]
fn a_servo_that_dies_or_stands_still_leaves_no_torque() {
    in_real_time(|| case().outlives_its_servo(&vesc(Make::default())));
}

#[test]
fn a_drive_that_resets_or_reports_a_fault_ends_at_zero() {
    in_real_time(|| {
        case().resets_and_reports(&vesc(Make::default()), 4, "fault 4: absolute over-current");
        // So quick a reset that no answer is missed shows by what the drive counts.
        let emulator = vesc(Make { boot_s: 0.0, ..Make::default() });
        let mut bench = case().servo(&emulator);
        let reset = [Fault::DriveRestarted];
        case().ends_at_zero(&mut bench, &emulator, &reset, SILENCE, || emulator.restart(), || ());
    });
}

#[test]
fn it_is_not_armed_without_its_time_out() {
    in_real_time(|| {
        let off = Make { stored_timeout_ms: 0, read_only: true, ..Make::default() };
        case().cannot_be_armed(&vesc(off), "does not take its settings");
        let old = Make { firmware: (5, 2), ..Make::default() };
        case().cannot_be_armed(&vesc(old), "firmware 5.02");
        let other = Case { keys: "pole_pairs = 7, identity = \"001100000000000000000000\"", ..case() };
        other.cannot_be_armed(&vesc(Make::default()), "two drives swapped?");
    });
}

/// What is stored stays; what is in force until the next power-off is what was asked for.
#[test]
fn a_time_out_that_is_too_long_is_set_until_the_next_power_off() {
    in_real_time(|| {
        let make = Make { stored_timeout_ms: 5000, stored_brake_current_a: 4.0, ..Make::default() };
        case().outlives_its_servo(&vesc(make));
    });
}

/// Duty for a rig that is driven by volts, and the drive's own speed loop.
#[test]
fn volts_are_given_as_duty_and_speed_to_its_own_loop() {
    in_real_time(|| {
        for (name, kind, drive) in
            [("t200-vehicle", DriveKind::Voltage, 6.0), ("speed-drive", DriveKind::Speed, 30.0)]
        {
            let emulator = Emulator::start(Vesc::new(Make::default(), &rig(name))).unwrap();
            let command = Command { kind: kind as u32, ..Command::default() };
            Case { drive, command, rig: name, ..case() }.follows(&emulator);
        }
    });
}

/// A shaft sensor that counts the other way round turns a speed loop into one that runs away: what it costs is bounded
/// by the drive's current limit, or it trips.
#[test]
fn a_reversed_encoder_stays_within_the_current_limit() {
    in_real_time(reversed_encoder);
}

fn reversed_encoder() {
    let emulator = vesc(Make { reversed_encoder: true, ..Make::default() });
    let mut stack = Stack::start_at(case().site(&emulator));
    stack.command(60.0, 60_000);
    let end = Instant::now() + Duration::from_secs(4);
    let (mut current_a, mut speed_rad_s) = (0.0f64, 0.0f64);
    while Instant::now() < end {
        let truth = emulator.truth();
        current_a = current_a.max(truth.current_a.abs());
        speed_rad_s = speed_rad_s.max(truth.shaft_speed_rad_s.abs());
        std::thread::sleep(Duration::from_millis(5));
    }
    assert!(speed_rad_s > 1.0, "it never turned, and nothing was shown");
    // The rig's limit, and what the drive's own loop shoots over.
    assert!(current_a < 1.1 * 9.0, "{current_a} A");
}
