//! The force channel is slower than stated.

use super::memory::FirstOrder;
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, thrust_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "thrust_sensor_lag",
    path: Path::Sensor,
    what: "the force channel has a filter slower than stated, or one that is not stated at all",
    equation: "t1 y' = T - y, after the stated filter; t1 [s]",
    signature: "thrust alone is late and rounded by a fixed time, at all amplitudes; shaft speed and flow fit",
    confused_with: &["unsteady_lift_lag", "clock_skew", "stand_resonance"],
    separated_by: "a tap on the stand with the motor off; a chirp at two mean speeds (lift lag shrinks with speed)",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their force filter: 163 Hz)",
    commonness: 2.0,
    shifts_time: false,
    nonparametric: false,
    forms: &[],
    parameters,
    starts: |_| vec![vec![0.003], vec![0.03], vec![0.1]],
    needs: thrust_measured,
    build: both!(|values, context| Box::new(ThrustSensorLag {
        lag_s: values[0],
        tick_s: context.tick_s,
        lag: FirstOrder::new()
    })),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![Spec::strength("thrust_lag_s", "s", 0.01, 0.0, 1.0).sigma(0.03)]
}

struct ThrustSensorLag<T> {
    lag_s: T,
    tick_s: f64,
    lag: FirstOrder<T>,
}

impl<T: Real> Effect<T> for ThrustSensorLag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        sensed.thrust_n = self.lag.step(sensed.thrust_n, self.lag_s, self.tick_s);
    }
}
