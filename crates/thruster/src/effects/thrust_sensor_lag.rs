//! The force channel is slower than stated.

use super::memory::MeanAndLag;
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, thrust_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Longest delay, s.
const LONGEST_S: f64 = 1.0;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "thrust_sensor_lag",
    path: Path::Sensor,
    what: "the force channel has a filter slower than stated, or one that is not stated at all",
    equation: "(1 - s) t y' = mean(T over the last 2 s t) - y, after the stated filter; t the mean delay [s], s the share of it \
               that a running mean makes [1]: 0 a first-order lag, 0.3 a filter of second order, 1 a running mean",
    signature: "thrust alone is late and rounded by a fixed time, at all amplitudes; shaft speed and flow fit",
    confused_with: &["unsteady_lift_lag", "clock_skew", "stand_resonance"],
    separated_by: "a tap on the stand with the motor off; a chirp at two mean speeds (lift lag shrinks with speed)",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their force filter: 163 Hz)",
    commonness: 2.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[0, 1]],
    parameters,
    starts: |_| vec![vec![0.003, 0.0], vec![0.03, 0.0], vec![0.1, 0.0]],
    needs: thrust_measured,
    build: both!(|values, context| {
        Box::new(ThrustSensorLag { delay: MeanAndLag::new(values[0], values[1], LONGEST_S, context.tick_s) })
    }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("thrust_lag_s", "s", 0.01, 0.0, LONGEST_S).sigma(0.03),
        Spec::shape("running_mean_share", "1", 0.0, 0.0, 1.0).prior(0.5, 0.3),
    ]
}

struct ThrustSensorLag<T> {
    delay: MeanAndLag<T>,
}

impl<T: Real> Effect<T> for ThrustSensorLag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        sensed.thrust_n = self.delay.step(sensed.thrust_n);
    }
}
