//! The stand swings and the force sensor sees it.

use super::memory::SecondOrder;
use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, thrust_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "stand_resonance",
    path: Path::Sensor,
    what: "the stand and the force sensor swing at a natural frequency",
    equation: "y = T + g (x - T), x''/wn^2 + 2 z x'/wn + x = T, wn = 2 pi fn; g, z [1], fn [Hz]; g = 1 if all thrust passes \
               through the swinging mass",
    signature: "thrust rings at a fixed frequency after steps, shaft speed does not; larger where the blades' passing meets \
                the frequency",
    confused_with: &["thrust_sensor_lag", "rotational_flow", "nonsinusoidal_lift_drag"],
    separated_by: "a tap on the stand with the motor off; a chirp",
    reference: "Doebelin, Measurement Systems (second-order instrument)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts,
    needs: thrust_measured,
    build: both!(build),
};

/// A stand gives way to thrust: the share is not negative. It rings: structures are damped by a few hundredths, and at the bound a
/// step still overshoots by a quarter; a sensor that hardly overshoots is one with a filter ([`super::thrust_sensor_lag`]).
fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("swinging_share", "1", 0.5, 0.0, 1.5).sigma(0.7),
        Spec::shape("natural_frequency_hz", "Hz", 20.0, 2.0, 200.0).sigma(25.0),
        Spec::shape("damping_ratio", "1", 0.03, 0.001, 0.4).sigma(0.1),
    ]
}

/// Close enough that a stand rings in step with one of them for a few periods.
fn starts(_: &Scale) -> Vec<Vec<f64>> {
    [5.0, 6.0, 7.2, 8.6, 10.3, 12.4, 14.8, 17.8, 21.4, 25.6, 30.7, 40.0, 56.0, 80.0]
        .iter()
        .map(|hz| vec![0.5, *hz, 0.1])
        .collect()
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    let natural_rad_s = values[1] * std::f64::consts::TAU;
    Box::new(StandResonance {
        share: values[0],
        swing: SecondOrder::new(T::ONE / natural_rad_s, values[2], context.tick_s),
    })
}

struct StandResonance<T> {
    share: T,
    /// The swinging mass's position, as thrust in N.
    swing: SecondOrder<T>,
}

impl<T: Real> Effect<T> for StandResonance<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let thrust = sensed.thrust_n;
        let [position, _] = self.swing.step(thrust);
        sensed.thrust_n = thrust + self.share * (position - thrust);
    }
}
