//! What stands between any command and the drive: limits, which only hold back, and trips, which
//! latch a fault.

use kort_proto::faults::Fault;
use kort_proto::limits::Limit;
use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;

use crate::direction::Direction;
use crate::settings::Limits;
use crate::still::Stillness;
use crate::water::Agreement;

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
    agreement: Agreement,
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
            agreement: Agreement::default(),
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
        let still_s = self.still.while_pulled(measured, pulls, l.frozen_s, l.water.speed_full_rad_s, dt);
        // One that is told to turn, while its angle stands, is no shaft under any drive: old values, or a dead sensor.
        trip(Fault::SensorFrozen, still_s > l.frozen_s || self.still.denied_s() > l.frozen_s);
        // A jump that is left out above says nothing of the direction either.
        let shown = if jump { f64::NAN } else { speed };
        let current = if self.current_told { self.held_current_a } else { f64::NAN };
        trip(Fault::SensorReversed, self.direction.is_reversed(&l, shown, current, drive, dt));
        // Torque, speed and thrust that no water brings together.
        let (held, thrust) = (self.held_speed_rad_s, measured.thrust_n);
        trip(Fault::ShaftSlow, self.agreement.is_slow(&l, held, current, dt));
        trip(Fault::SensorImplausible, self.agreement.is_implausible(&l, held, current, thrust, dt));
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
pub(crate) mod tests;
