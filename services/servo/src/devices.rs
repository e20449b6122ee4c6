//! The drive and the sensor sources of one thruster, merged into what the guard sees at a tick.
//!
//! A reading shows up once, on the first tick after it came: the row of a recording then tells when a
//! value was sampled, and the guard how long ago. Where a sensor source gives a signal that the drive
//! gives too, the source is believed: who wires an encoder beside a drive means it.

use kort_proto::faults::Fault;
use kort_proto::signals::Signals;

use crate::drives::Drive;
use crate::sensors::{Sensor, place};

/// A tick of the loop, as devices see it.
#[derive(Clone, Copy, Debug)]
pub struct At {
    /// The tick's instant on CLOCK_MONOTONIC, ns.
    pub now_ns: u64,
    /// Periods since the last tick: one, and more after missed ones.
    pub ticks: u64,
}

/// What a device measured, and when.
#[derive(Clone, Copy, Debug)]
pub struct Reading {
    /// When it came, on CLOCK_MONOTONIC, ns.
    pub stamp_ns: u64,
    /// What it tells; NaN for the rest.
    pub signals: Signals,
}

/// What a device shows at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Shown {
    /// A reading that was not shown before.
    pub reading: Option<Reading>,
    /// Faults whose cause is there now, bits of [`Fault`].
    pub faults: u64,
}

/// Everything that all devices show at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Merged {
    /// Readings that are new at this tick; NaN for the rest.
    pub signals: Signals,
    /// Faults of the devices, bits of [`Fault`].
    pub faults: u64,
    /// How old the newest shaft speed is at this tick, ns.
    pub shaft_age_ns: u64,
}

/// One drive and any number of sensor sources.
pub struct Devices {
    drive: Box<dyn Drive>,
    sensors: Vec<Sensor>,
    /// Places in the signal table that a sensor source gives.
    taken: [bool; Signals::COUNT],
    drive_read_ns: u64,
    shaft_read_ns: u64,
}

impl Devices {
    /// Starts all devices: the drive last, for from the moment that it is confirmed it wants to hear of ticks, and an
    /// instrument may keep the start waiting.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had. A device that is not there is a fault, not an error.
    #[cfg(feature = "process")]
    pub fn start(
        drive: crate::drives::Chosen,
        sensors: Vec<crate::sensors::Chosen>,
        id: &str,
        priority: i32,
    ) -> std::io::Result<Self> {
        let sensors: std::io::Result<_> = sensors.into_iter().map(|s| s.start(id, priority)).collect();
        let (sensors, drive) = (sensors?, drive.start(id, priority)?);
        Ok(Self::new(drive, sensors, kort_proto::transport::monotonic_ns()))
    }

    /// Devices that have just been started.
    pub fn new(drive: Box<dyn Drive>, sensors: Vec<Sensor>, now_ns: u64) -> Self {
        let mut taken = [false; Signals::COUNT];
        for place in sensors.iter().flat_map(|sensor| sensor.gives.iter()) {
            if let Some(taken) = taken.get_mut(*place) {
                *taken = true;
            }
        }
        let sensors = sensors.into_iter().map(|sensor| Sensor { read_ns: now_ns, ..sensor }).collect();
        Self { drive, sensors, taken, drive_read_ns: now_ns, shaft_read_ns: now_ns }
    }

    /// How long a reading of current or shaft speed stands before its absence is a fault, ns; zero: one tick.
    pub fn reading_life_ns(&self) -> u64 {
        let shaft = place("shaft_speed_rad_s");
        let on_shaft = self.sensors.iter().filter(|sensor| sensor.gives.iter().any(|p| Some(*p) == shaft));
        on_shaft.map(|sensor| sensor.life_ns).fold(self.drive.reading_life_ns(), u64::max)
    }

    /// What all devices show at this tick. Neither waits nor allocates.
    pub fn show(&mut self, at: At) -> Merged {
        let shown = self.drive.show(at);
        let mut faults = shown.faults;
        let mut values = [f64::NAN; Signals::COUNT];
        let speed = |signals: &Signals| signals.shaft_speed_rad_s.is_finite();
        if let Some(reading) = shown.reading {
            self.drive_read_ns = reading.stamp_ns;
            for ((value, read), taken) in values.iter_mut().zip(reading.signals.values()).zip(self.taken) {
                if !taken {
                    *value = read;
                }
            }
            if speed(&Signals::from_values(values)) {
                self.shaft_read_ns = reading.stamp_ns;
            }
        }
        // One that answers and is not to be driven is not asked for readings: not lost.
        let unguarded = faults & Fault::DriveUnguarded.bit() != 0;
        if !unguarded && at.now_ns.saturating_sub(self.drive_read_ns) > self.drive.reading_life_ns() {
            faults |= Fault::DriveLost.bit();
        }
        for sensor in &mut self.sensors {
            let shown = sensor.source.show(at);
            faults |= shown.faults;
            if let Some(reading) = shown.reading {
                sensor.read_ns = reading.stamp_ns;
                let read = reading.signals.values();
                for place in &sensor.gives {
                    if let (Some(value), Some(read)) = (values.get_mut(*place), read.get(*place)) {
                        *value = *read;
                    }
                }
                if speed(&reading.signals) {
                    self.shaft_read_ns = reading.stamp_ns;
                }
            }
            if sensor.required && at.now_ns.saturating_sub(sensor.read_ns) > sensor.life_ns {
                faults |= Fault::SensorLost.bit();
            }
        }
        Merged {
            signals: Signals::from_values(values),
            faults,
            shaft_age_ns: at.now_ns.saturating_sub(self.shaft_read_ns),
        }
    }

    /// Sets the drive in its unit; `None` switches its output off.
    pub fn drive(&mut self, now_ns: u64, drive: Option<f64>) {
        self.drive.drive(now_ns, drive);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::Source;

    const MS: u64 = 1_000_000;

    /// A device that has a reading on every `every`-th millisecond until it falls silent.
    struct Telling {
        every_ms: u64,
        until_ms: u64,
        signals: Signals,
    }

    impl Telling {
        fn tell(&self, at: At) -> Shown {
            let now_ms = at.now_ns / MS;
            let due = now_ms.is_multiple_of(self.every_ms) && now_ms <= self.until_ms;
            let reading = Reading { stamp_ns: at.now_ns - MS / 2, signals: self.signals };
            Shown { reading: due.then_some(reading), faults: 0 }
        }
    }

    impl Drive for Telling {
        fn reading_life_ns(&self) -> u64 {
            20 * MS
        }
        fn show(&mut self, at: At) -> Shown {
            self.tell(at)
        }
        fn drive(&mut self, _: u64, _: Option<f64>) {}
    }

    impl Source for Telling {
        fn show(&mut self, at: At) -> Shown {
            self.tell(at)
        }
    }

    fn devices(drive_until_ms: u64, sensor_until_ms: u64, required: bool) -> Devices {
        let told = Signals { current_a: 1.0, shaft_speed_rad_s: 10.0, thrust_n: 7.0, ..Signals::UNKNOWN };
        let drive = Telling { every_ms: 5, until_ms: drive_until_ms, signals: told };
        let force = Signals { thrust_n: 8.0, ..Signals::UNKNOWN };
        let sensor = Sensor {
            source: Box::new(Telling { every_ms: 10, until_ms: sensor_until_ms, signals: force }),
            gives: vec![place("thrust_n").unwrap()],
            life_ns: 50 * MS,
            required,
            read_ns: 0,
        };
        Devices::new(Box::new(drive), vec![sensor], 100 * MS)
    }

    fn run(devices: &mut Devices, to_ms: u64) -> Vec<(u64, Merged)> {
        (100..to_ms).map(|ms| (ms, devices.show(At { now_ns: ms * MS, ticks: 1 }))).collect()
    }

    #[test]
    fn each_reading_shows_once_and_the_source_is_believed_over_the_drive() {
        for (ms, merged) in run(&mut devices(1000, 1000, true), 300) {
            assert_eq!(merged.faults, 0, "{ms}");
            let (drive, sensor) = (ms % 5 == 0, ms % 10 == 0);
            assert_eq!(merged.signals.current_a.is_finite(), drive, "{ms}");
            assert_eq!(
                merged.signals.thrust_n.is_finite(),
                sensor,
                "{ms}: the drive's own thrust is left out"
            );
            assert!(!sensor || merged.signals.thrust_n == 8.0);
            assert_eq!(merged.shaft_age_ns, ms % 5 * MS + MS / 2, "{ms}");
        }
    }

    #[test]
    fn silence_beyond_its_life_is_a_fault_of_that_device_alone() {
        let first = |shown: Vec<(u64, Merged)>, fault: Fault| {
            shown.into_iter().find(|(_, m)| m.faults != 0).map(|(ms, m)| {
                assert_eq!(m.faults, fault.bit());
                ms
            })
        };
        assert_eq!(first(run(&mut devices(200, 1000, true), 300), Fault::DriveLost), Some(220));
        assert_eq!(first(run(&mut devices(1000, 200, true), 300), Fault::SensorLost), Some(250));
        assert_eq!(first(run(&mut devices(1000, 200, false), 300), Fault::SensorLost), None);
    }
}
