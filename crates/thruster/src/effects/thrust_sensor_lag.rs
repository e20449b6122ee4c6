//! The force channel is slower than stated.

use super::memory::{FirstOrder, History};
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, thrust_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "thrust_sensor_lag",
    path: Path::Sensor,
    what: "the force channel has a filter slower than stated, or one that is not stated at all",
    equation: "(1 - s) t y'(t) = T(t - s t) - y, after the stated filter; t the mean delay [s], s the share of it that is dead \
               time [1]: 0 a first-order lag, 0.4 a running mean",
    signature: "thrust alone is late and rounded by a fixed time, at all amplitudes; shaft speed and flow fit",
    confused_with: &["unsteady_lift_lag", "clock_skew", "stand_resonance"],
    separated_by: "a tap on the stand with the motor off; a chirp at two mean speeds (lift lag shrinks with speed)",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their force filter: 163 Hz)",
    commonness: 2.0,
    shifts_time: false,
    nonparametric: false,
    forms: &[&[0], &[0, 1]],
    parameters,
    starts: |_| vec![vec![0.003, 0.0], vec![0.03, 0.0], vec![0.1, 0.0]],
    needs: thrust_measured,
    build: both!(|values, context| Box::new(ThrustSensorLag {
        dead_time_s: values[0] * values[1],
        past: History::new(0.5, context.tick_s),
        lag_s: values[0] * (-values[1] + 1.0),
        tick_s: context.tick_s,
        lag: FirstOrder::new()
    })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("thrust_lag_s", "s", 0.01, 0.0, 1.0).sigma(0.03),
        Spec::shape("dead_time_share", "1", 0.0, 0.0, 0.8).prior(0.0, 0.3),
    ]
}

struct ThrustSensorLag<T> {
    dead_time_s: T,
    past: History<T>,
    lag_s: T,
    tick_s: f64,
    lag: FirstOrder<T>,
}

impl<T: Real> Effect<T> for ThrustSensorLag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        self.past.push(sensed.thrust_n);
        sensed.thrust_n = self.lag.step(self.past.ago(self.dead_time_s), self.lag_s, self.tick_s);
    }
}
