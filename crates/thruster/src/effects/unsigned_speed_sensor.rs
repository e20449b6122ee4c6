//! The speed sensor does not know the direction.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Sensing, Spec, one_start, speed_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "unsigned_speed_sensor",
    path: Path::Sensor,
    what: "a tachometer with a single channel, or a hall sensor, shows the size of the shaft speed and not its sign",
    equation: "y = |Om|; there (1) or not (0), nothing to fit",
    signature: "measured speed is never negative, and has a cusp at zero where the model crosses it; thrust and current do \
                change sign",
    confused_with: &["forward_reverse_asymmetry", "torque_channel_bias"],
    separated_by: "the crossings of zero: the sign is the model's",
    reference: "Doebelin, Measurement Systems (tachometers)",
    commonness: 0.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters: |_: &Scale| vec![Spec::switch("unsigned")],
    starts: one_start,
    needs,
    build: both!(|values, _| Box::new(UnsignedSpeed { share: values[0] })),
};

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    speed_measured(rig, available)?;
    if available.speed_unsigned {
        Ok(())
    } else {
        Err("the recorded shaft speed has its sign, or the drive never reverses")
    }
}

struct UnsignedSpeed<T> {
    share: T,
}

impl<T: Real> Effect<T> for UnsignedSpeed<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sensing(&self) -> Sensing {
        Sensing::Counting
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let signed = sensed.shaft_speed_rad_s;
        sensed.shaft_speed_rad_s = signed + self.share * (signed.abs() - signed);
        if signed < 0.0 {
            // Astern what is shown goes the other way.
            sensed.since_mean_rad_s2 = sensed.since_mean_rad_s2.map(|rate| rate - self.share * rate * 2.0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn astern_speed_and_its_rate_are_shown_the_other_way() {
        for (speed, shown, rate) in [(3.0, 3.0, 40.0), (-3.0, 3.0, -40.0)] {
            let mut sensed = Sensed {
                shaft_speed_rad_s: speed,
                since_mean_rad_s2: Some(40.0),
                ..Sensed::<f64>::default()
            };
            UnsignedSpeed { share: 1.0 }.sense(&Tick::default(), &mut sensed);
            assert_eq!((sensed.shaft_speed_rad_s, sensed.since_mean_rad_s2), (shown, Some(rate)));
        }
    }
}
