//! The encoder's disc sits off centre.

use super::memory::FirstOrder;
use super::{
    Available, Descriptor, Effect, Hooks, Path, Scale, Spec, angle_recorded, one_start, speed_measured,
};
use crate::plant::{Sensed, Tick};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "encoder_eccentricity",
    path: Path::Sensor,
    what: "the encoder's disc sits off centre, or a resolver's two windings differ: measured speed varies once or twice a turn",
    equation: "y = Om (1 + sum_k ak sin kq + bk cos kq), k = 1, 2, through the stated filter; a, b [1], q shaft angle [rad]",
    signature: "lines at orders 1 and 2 of shaft angle in speed, in proportion to speed; none in thrust",
    confused_with: &["torque_ripple_cogging"],
    separated_by: "a slow creep over full turns, averaged over angle, speed against thrust",
    reference: "Doebelin, Measurement Systems (angle encoders)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    forms: &[&[0, 1], &[2, 3], &[0, 1, 2, 3]],
    parameters,
    starts: one_start,
    needs,
    build: both!(|values, context| {
        Box::new(Eccentricity {
            first: [values[0], values[1]],
            second: [values[2], values[3]],
            filter_s: context.rig.sensors.speed_filter_time_constant_s.unwrap_or(0.0),
            tick_s: context.tick_s,
            filter: FirstOrder::new(),
        })
    }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    let part = |name| Spec::strength(name, "1", 0.01, -0.5, 0.5).sigma(0.02);
    vec![part("once_sin"), part("once_cos"), part("twice_sin"), part("twice_cos")]
}

fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    speed_measured(rig, available)?;
    angle_recorded(rig, available)
}

struct Eccentricity<T> {
    first: [T; 2],
    second: [T; 2],
    filter_s: f64,
    tick_s: f64,
    filter: FirstOrder<T>,
}

impl<T: Real> Effect<T> for Eccentricity<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, tick: &Tick, sensed: &mut Sensed<T>) {
        let angle = tick.shaft_angle_rad.map_or(sensed.shaft_angle_rad, |(_, end)| T::from(end));
        let (sin, cos) = angle.sin_cos();
        let (sin_2, cos_2) = (sin * 2.0 * cos, T::ONE - sin * 2.0 * sin);
        let wave =
            self.first[0] * sin + self.first[1] * cos + self.second[0] * sin_2 + self.second[1] * cos_2;
        sensed.shaft_speed_rad_s +=
            self.filter.step(sensed.true_speed_rad_s * wave, T::from(self.filter_s), self.tick_s);
    }
}
