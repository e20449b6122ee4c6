//! Faults of the shaft sensor, for the simulated drive: what a broken cable or a dead encoder shows.

use kort_proto::signals::Signals;
use serde::Deserialize;

/// What the shaft sensor does wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SensorFault {
    /// It shows its last value for ever.
    Frozen,
    /// It jumps by 500 rad/s on every 20th tick.
    Spikes,
    /// It counts the other way round.
    Reversed,
    /// It shows no number.
    NotANumber,
}

/// A shaft sensor that lies from some time on.
#[derive(Clone, Copy, Debug)]
pub struct Lying {
    fault: SensorFault,
    after_s: f64,
    last: Option<(f64, f64)>,
    ticks: u32,
}

impl Lying {
    /// Lies from `after_s` after the start on.
    pub fn new(fault: SensorFault, after_s: f64) -> Self {
        Self { fault, after_s, last: None, ticks: 0 }
    }

    /// Turns what the sensor reads into what it shows.
    pub fn distort(&mut self, time_s: f64, shown: &mut Signals) {
        if time_s < self.after_s {
            return;
        }
        self.ticks = self.ticks.wrapping_add(1);
        let (angle_rad, speed_rad_s) = (&mut shown.shaft_angle_rad, &mut shown.shaft_speed_rad_s);
        match self.fault {
            SensorFault::Frozen => {
                (*angle_rad, *speed_rad_s) = *self.last.get_or_insert((*angle_rad, *speed_rad_s));
            }
            SensorFault::Spikes if self.ticks.is_multiple_of(20) => *speed_rad_s += 500.0,
            SensorFault::Spikes => (),
            SensorFault::Reversed => (*angle_rad, *speed_rad_s) = (-*angle_rad, -*speed_rad_s),
            SensorFault::NotANumber => (*angle_rad, *speed_rad_s) = (f64::NAN, f64::NAN),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn honest_before_its_time_and_frozen_after() {
        let mut sensor = Lying::new(SensorFault::Frozen, 1.0);
        for n in 0..40 {
            let time_s = f64::from(n) * 0.1;
            let mut shown = Signals { shaft_angle_rad: time_s, shaft_speed_rad_s: 1.0, ..Signals::UNKNOWN };
            sensor.distort(time_s, &mut shown);
            assert!((shown.shaft_angle_rad - time_s.min(1.0)).abs() < 1e-9, "{time_s}");
        }
    }
}
