//! What stands between any command and the drive: limits, which only hold back, and trips, which
//! latch a fault.

use kort_proto::faults::Fault;
use kort_proto::limits::Limit;
use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;

use crate::direction::Direction;
use crate::settings::Limits;
use crate::still::Stillness;

/// Readings that must be bad in a row before a value trips.
const OVER_TICKS: u32 = 2;
const SUPPLY_TICKS: u32 = 10;
/// Spikes within [`SPIKE_WINDOW`] ticks that trip.
const SPIKES: u32 = 3;
const SPIKE_WINDOW: u32 = 100;

/// State of the guard.
#[derive(Clone, Copy, Debug)]
pub struct Guard {
    limits: Limits,
    dt_s: f64,
    over_current: u32,
    over_speed: u32,
    current_missing: u32,
    speed_missing: u32,
    current_told: bool,
    supply: u32,
    spikes: u32,
    since_spike: u32,
    still: Stillness,
    since_speed: u64,
    direction: Direction,
    last_speed_rad_s: f64,
    held_speed_rad_s: f64,
    held_current_a: f64,
    thermal_load: f64,
    active: u64,
}

impl Guard {
    /// A guard for a cold motor at rest; `dt_s` is the period of the loop.
    pub fn new(limits: Limits, dt_s: f64) -> Self {
        Self {
            limits,
            dt_s,
            over_current: 0,
            over_speed: 0,
            current_missing: 0,
            speed_missing: 0,
            current_told: false,
            supply: 0,
            spikes: 0,
            since_spike: SPIKE_WINDOW,
            still: Stillness::new(),
            since_speed: 0,
            direction: Direction::default(),
            last_speed_rad_s: f64::NAN,
            held_speed_rad_s: 0.0,
            held_current_a: 0.0,
            thermal_load: 0.0,
            active: 0,
        }
    }

    /// Limits and checks in force.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Share of the I2t budget in use.
    pub fn thermal_load(&self) -> f64 {
        self.thermal_load
    }

    /// Faults whose cause is there now, whatever is latched.
    pub fn active(&self) -> u64 {
        self.active
    }

    /// Looks at the measurements of a tick under the drive that acted until now. Returns the
    /// faults whose cause is there now, bits of [`Fault`]. `ticks` is how many periods passed.
    pub fn inspect(&mut self, measured: &Signals, drive: f64, ticks: u64) -> u64 {
        let dt = self.dt_s * ticks.max(1) as f64;
        let l = self.limits;
        let mut active = 0;
        let mut trip = |fault: Fault, on: bool| {
            if on {
                active |= fault.bit();
            }
        };

        // Needed sensors: a drive on a wire shows a value every few ticks, and a gap is bridged with the last one
        // for as long as a reading stands. A drive with a speed loop of its own guards its current itself and need
        // not tell it; one that has told it once must go on.
        let told = measured.current_a.is_finite();
        self.current_told |= told;
        let needed = self.current_told || !matches!(l.kind, DriveKind::Speed | DriveKind::Duty);
        let gap = |ticks: &mut u32, there: bool| {
            *ticks = if there { 0 } else { ticks.saturating_add(1) };
            *ticks >= l.missing_ticks
        };
        let no_current = gap(&mut self.current_missing, told || !needed);
        let no_speed = gap(&mut self.speed_missing, measured.shaft_speed_rad_s.is_finite());
        trip(Fault::SensorNotFinite, no_current || no_speed);
        if told {
            self.held_current_a = measured.current_a;
        }

        // A jump that the shaft cannot make is left out; several within a short time trip.
        let speed = measured.shaft_speed_rad_s;
        self.since_speed = self.since_speed.saturating_add(ticks.max(1));
        let jump = (speed - self.last_speed_rad_s).abs() > l.spike_rad_s * self.since_speed as f64;
        self.since_spike = self.since_spike.saturating_add(1);
        if jump {
            self.spikes = if self.since_spike < SPIKE_WINDOW { self.spikes.saturating_add(1) } else { 1 };
            self.since_spike = 0;
        } else if speed.is_finite() {
            self.held_speed_rad_s = speed;
        }
        trip(Fault::SensorSpike, self.spikes >= SPIKES && self.since_spike < SPIKE_WINDOW);

        // A shaft that shows no motion while the motor pulls.
        let pulls = drive.abs() > l.drive_max / 3.0;
        let still_s = self.still.while_pulled(measured, pulls, l.frozen_s, l.speed_rad_s, dt);
        // One that is told to turn, while its angle stands, is no shaft under any drive: old values, or a dead sensor.
        trip(Fault::SensorFrozen, still_s > l.frozen_s || self.still.denied_s() > l.frozen_s);
        // A jump that is left out above says nothing of the direction either.
        let shown = if jump { f64::NAN } else { speed };
        let current = if self.current_told { self.held_current_a } else { f64::NAN };
        trip(Fault::SensorReversed, self.direction.is_reversed(&l, shown, current, drive, dt));
        if speed.is_finite() {
            self.last_speed_rad_s = speed;
            self.since_speed = 0;
        }

        // What is counted is readings: a tick without one neither confirms the last nor clears it.
        let count = |counter: &mut u32, read: f64, on: bool| {
            if !read.is_nan() {
                *counter = if on { counter.saturating_add(1) } else { 0 };
            }
            *counter
        };
        let current = measured.current_a;
        let n = count(&mut self.over_current, current, current.abs() > l.trip_current_a);
        trip(Fault::OverCurrent, n >= OVER_TICKS);
        let fast = self.held_speed_rad_s.abs() > l.trip_speed_rad_s;
        let n = count(&mut self.over_speed, speed, fast);
        trip(Fault::OverSpeed, n >= OVER_TICKS);
        let (low, high) = l.supply_v;
        let supply = measured.supply_v;
        let n = count(&mut self.supply, supply, supply < low || supply > high);
        trip(Fault::SupplyOutOfRange, n >= SUPPLY_TICKS);
        trip(Fault::OverTemperature, measured.temperature_c > l.temperature_c);

        // First-order I2t: 1 is the temperature that the continuous current reaches in the end.
        let heat = (self.held_current_a / l.continuous_current_a).powi(2);
        self.thermal_load += (heat - self.thermal_load) * (dt / l.thermal_time_constant_s).min(1.0);
        trip(Fault::ThermalOverload, self.thermal_load > 1.1);

        self.active = active;
        active
    }

    /// The drive that may act, given what is wanted and what acted last, and the limits in force.
    pub fn limit(&self, wanted: f64, last: f64) -> (f64, u64) {
        let l = &self.limits;
        let mut in_force = 0;

        // Current: peak until the thermal budget nears its end, then down to continuous.
        let spare = ((1.0 - self.thermal_load) / 0.1).clamp(0.0, 1.0);
        let current = l.continuous_current_a.min(l.current_a);
        let current = current + (l.current_a - current) * spare;
        let (low, high) = match l.kind {
            DriveKind::Current => (-current, current),
            DriveKind::Voltage => {
                // R i + ke Om: the voltage that drives just this current at this speed.
                let (resistance, ke) = l.winding;
                let back = ke * self.held_speed_rad_s;
                (
                    (back - resistance * current).max(-l.drive_max),
                    (back + resistance * current).min(l.drive_max),
                )
            }
            DriveKind::Duty | DriveKind::Speed => (-l.drive_max, l.drive_max),
        };
        let wanted = if wanted.is_finite() { wanted } else { 0.0 };
        let mut drive = wanted.max(low.min(high)).min(high.max(low));
        if drive != wanted {
            let thermal = spare < 1.0 && wanted.abs() <= l.drive_max;
            in_force |= if thermal { Limit::Thermal.bit() } else { Limit::DriveRange.bit() };
        }

        // Speed: from the limit on, driving torque fades out over a tenth of it; braking stays.
        let speed = self.held_speed_rad_s;
        if l.kind != DriveKind::Speed && drive * speed > 0.0 && speed.abs() > l.speed_rad_s {
            drive *= (1.0 - (speed.abs() / l.speed_rad_s - 1.0) / 0.1).clamp(0.0, 1.0);
            in_force |= Limit::DriveSpeed.bit();
        }

        let most = l.drive_max * self.dt_s / l.full_drive_s;
        if (drive - last).abs() > most * (1.0 + 1e-9) {
            drive = last + most.copysign(drive - last);
            in_force |= Limit::DriveSlew.bit();
        }
        // Nothing above can make a finite command infinite; this is the last line all the same.
        if drive.is_finite() { (drive, in_force) } else { (0.0, in_force) }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::direction::Shaft;
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
}
