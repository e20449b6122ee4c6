//! Each cause trips its own fault, and a healthy thruster none.

use super::*;
use crate::direction::Shaft;
use crate::water::Water;
use proptest::prelude::*;

pub(crate) fn limits() -> Limits {
    Limits {
        kind: DriveKind::Current,
        drive_max: 9.0,
        current_a: 9.0,
        trip_current_a: 11.0,
        continuous_current_a: 6.0,
        thermal_time_constant_s: 2.0,
        speed_rad_s: 80.0,
        trip_speed_rad_s: 95.0,
        full_drive_s: 0.01,
        supply_v: (90.0, 140.0),
        temperature_c: 100.0,
        missing_ticks: 3,
        frozen_s: 0.2,
        spike_rad_s: 20.0,
        winding: (f64::NAN, 1.2),
        shaft: Shaft { inertia_kg_m2: 0.1, water_w: f64::INFINITY, stored_j: 0.0, lag_s: 0.0 },
        water: Water { speed_full_rad_s: 80.0, ..Water::UNKNOWN },
    }
}

fn turning(i: u32) -> Signals {
    Signals {
        current_a: 1.0,
        shaft_speed_rad_s: 10.0,
        shaft_angle_rad: f64::from(i) * 0.01,
        supply_v: 120.0,
        ..Signals::UNKNOWN
    }
}

fn after(change: impl Fn(u32, &mut Signals), ticks: u32, drive: f64) -> u64 {
    let mut guard = Guard::new(limits(), 1e-3);
    let mut seen = 0;
    for i in 0..ticks {
        let mut s = turning(i);
        change(i, &mut s);
        seen |= guard.inspect(&s, drive, 1);
    }
    seen
}

#[test]
fn a_healthy_thruster_trips_nothing() {
    assert_eq!(after(|_, _| {}, 2000, 5.0), 0);
    // A shaft at rest without drive, and one bad sample of each kind, are no faults.
    assert_eq!(after(|_, s| (s.shaft_angle_rad, s.shaft_speed_rad_s) = (1.0, 0.0), 2000, 0.0), 0);
    let once = |change: fn(&mut Signals)| {
        let change = move |i, s: &mut Signals| {
            if i == 7 {
                change(s);
            }
        };
        after(change, 100, 5.0)
    };
    assert_eq!(once(|s| s.shaft_speed_rad_s = f64::NAN), 0);
    assert_eq!(once(|s| s.current_a = 50.0), 0);
    assert_eq!(once(|s| s.supply_v = 0.0), 0);
}

#[test]
fn each_cause_trips_its_own_fault() {
    assert_eq!(after(|_, s| s.current_a = 11.5, 10, 5.0), Fault::OverCurrent.bit());
    assert_eq!(after(|_, s| s.shaft_speed_rad_s = -96.0, 10, 5.0), Fault::OverSpeed.bit());
    assert_eq!(
        after(|_, s| s.current_a = f64::INFINITY, 10, 0.0) & Fault::SensorNotFinite.bit(),
        Fault::SensorNotFinite.bit()
    );
    assert_eq!(after(|_, s| s.shaft_speed_rad_s = f64::NAN, 10, 0.0), Fault::SensorNotFinite.bit());
    assert_eq!(after(|_, s| s.shaft_angle_rad = 1.0, 300, 5.0), Fault::SensorFrozen.bit());
    let blocked = |i: u32, s: &mut Signals| {
        s.shaft_speed_rad_s = f64::from(i % 7) * 0.1;
        s.shaft_angle_rad = 1.0 + f64::from(i % 2) * 0.002;
    };
    assert_eq!(after(blocked, 300, 5.0), Fault::SensorFrozen.bit());
    assert_eq!(after(blocked, 300, 2.0), 0, "against friction it may stand");
    assert_eq!(after(|_, s| s.shaft_angle_rad = 1.0, 2000, 0.2), Fault::SensorFrozen.bit(), "old values");
    assert_eq!(after(|_, s| s.supply_v = 50.0, 20, 0.0), Fault::SupplyOutOfRange.bit());
    assert_eq!(after(|_, s| s.temperature_c = 150.0, 3, 0.0), Fault::OverTemperature.bit());
    assert_eq!(after(|_, s| s.current_a = 9.0, 5000, 5.0), Fault::ThermalOverload.bit());
    let spiky = |i: u32, s: &mut Signals| {
        if i % 20 == 10 {
            s.shaft_speed_rad_s = 70.0
        }
    };
    assert_eq!(after(spiky, 200, 5.0), Fault::SensorSpike.bit());
}

/// A drive on a wire shows a reading every fifth tick: gaps are no fault, spikes are judged over the gap, and
/// what must be bad twice is bad in two readings, not in two ticks.
#[test]
fn sparse_readings_are_judged_by_reading() {
    let run = |change: &dyn Fn(u32, &mut Signals)| {
        let mut guard = Guard::new(Limits { missing_ticks: 20, spike_rad_s: 1.0, ..limits() }, 1e-3);
        (0..500).fold(0, |seen, i| {
            let mut s = if i % 5 == 0 { turning(i) } else { Signals::UNKNOWN };
            change(i, &mut s);
            seen | guard.inspect(&s, 5.0, 1)
        })
    };
    assert_eq!(run(&|_, _| ()), 0);
    let only = |at: u32, s: &mut Signals, change: &dyn Fn(&mut Signals)| {
        if at == 100 {
            change(s);
        }
    };
    assert_eq!(run(&|i, s| only(i, s, &|s| s.current_a = 50.0)), 0, "one reading");
    let rising = |i: u32, s: &mut Signals| s.shaft_speed_rad_s += f64::from(i.min(50)) * 0.9;
    assert_eq!(run(&rising), 0, "4.5 rad/s in five ticks");
    assert_eq!(run(&|_, s| s.shaft_angle_rad = s.shaft_angle_rad.min(1.0)), Fault::SensorFrozen.bit());
    assert_eq!(
        run(&|i, s| if i > 300 {
            *s = Signals::UNKNOWN
        }),
        Fault::SensorNotFinite.bit()
    );
}

#[test]
fn a_speed_drive_need_not_tell_its_current_but_may_not_fall_silent() {
    let run = |kind: DriveKind, told_until: u32| {
        let mut guard = Guard::new(Limits { kind, ..limits() }, 1e-3);
        (0..100).fold(0, |seen, i| {
            let current_a = if i < told_until { 1.0 } else { f64::NAN };
            seen | guard.inspect(&Signals { current_a, ..turning(i) }, 5.0, 1)
        })
    };
    assert_eq!(run(DriveKind::Speed, 0), 0);
    assert_eq!(run(DriveKind::Speed, 50), Fault::SensorNotFinite.bit());
    assert_eq!(run(DriveKind::Current, 0), Fault::SensorNotFinite.bit());
    // What it does tell guards it.
    let mut guard = Guard::new(Limits { kind: DriveKind::Speed, ..limits() }, 1e-3);
    let fast = Signals { current_a: f64::NAN, shaft_speed_rad_s: 96.0, ..turning(0) };
    assert_eq!((0..5).fold(0, |seen, _| seen | guard.inspect(&fast, 5.0, 1)), Fault::OverSpeed.bit());
}

#[test]
fn the_thermal_budget_folds_back_before_it_trips() {
    let mut guard = Guard::new(limits(), 1e-3);
    let mut drive = 0.0;
    for i in 0..20_000 {
        let faults = guard.inspect(&Signals { current_a: drive, ..turning(i) }, drive, 1);
        assert_eq!(faults, 0, "tick {i}, load {}", guard.thermal_load());
        drive = guard.limit(9.0, drive).0;
    }
    let (held, in_force) = guard.limit(9.0, drive);
    assert!((6.0..6.5).contains(&held), "{held}");
    assert_eq!(in_force, Limit::Thermal.bit());
}

proptest! {
    #[test]
    fn no_wish_leaves_the_limits(
        wanted in prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), -1e300..1e300],
        last in -9.0..9.0f64,
        speed in -200.0..200.0f64,
        current in -30.0..30.0f64,
        kind in prop_oneof![Just(DriveKind::Current), Just(DriveKind::Speed), Just(DriveKind::Duty)],
    ) {
        let mut guard = Guard::new(Limits { kind, ..limits() }, 1e-3);
        guard.inspect(&Signals { current_a: current, shaft_speed_rad_s: speed, ..turning(0) }, last, 1);
        let (drive, _) = guard.limit(wanted, last);
        prop_assert!(drive.is_finite() && drive.abs() <= 9.0 + 1e-9);
        prop_assert!((drive - last).abs() <= 0.9 + 1e-9, "slew");
    }

    #[test]
    fn a_voltage_drive_keeps_the_current_limit(wanted in -500.0..500.0f64, speed in -80.0..80.0f64) {
        let l = Limits { kind: DriveKind::Voltage, drive_max: 120.0, winding: (2.0, 1.2), full_drive_s: 1e-9, ..limits() };
        let mut guard = Guard::new(l, 1e-3);
        guard.inspect(&Signals { shaft_speed_rad_s: speed, ..turning(0) }, 0.0, 1);
        let (volts, _) = guard.limit(wanted, 0.0);
        let current = (volts - 1.2 * speed) / 2.0;
        prop_assert!(current.abs() <= 9.0 + 1e-9, "{current} A");
    }
}
