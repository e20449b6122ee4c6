//! The stand swings and the force sensor sees it.

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
    let (wn, z, dt) = (values[1] * std::f64::consts::TAU, values[2], context.tick_s);
    let (decay, damped) = (z * wn, wn * (T::ONE - z * z).sqrt());
    let ((sin, cos), fall) = ((damped * dt).sin_cos(), (-decay * dt).exp());
    Box::new(StandResonance {
        share: values[0],
        behind_s: z * 2.0 / wn,
        tick_s: dt,
        // Free swing over one tick: e(t), e'(t) from e, e' at its start.
        free: [
            [fall * (cos + decay / damped * sin), fall * sin / damped],
            [-fall * wn * wn / damped * sin, fall * (cos - decay / damped * sin)],
        ],
        thrust_n: T::ZERO,
        swing: None,
    })
}

struct StandResonance<T> {
    share: T,
    behind_s: T,
    tick_s: f64,
    free: [[T; 2]; 2],
    thrust_n: T,
    /// Position (as thrust, N) and its rate.
    swing: Option<[T; 2]>,
}

impl<T: Real> Effect<T> for StandResonance<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    /// Exact for a thrust that runs straight over the tick: the swing about the forced answer to
    /// a ramp, which trails the ramp by `2 z/wn`.
    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let thrust = sensed.thrust_n;
        let [position, rate] = self.swing.unwrap_or([thrust, T::ZERO]);
        let slope = if self.swing.is_some() { (thrust - self.thrust_n) / self.tick_s } else { T::ZERO };
        let before = if self.swing.is_some() { self.thrust_n } else { thrust };
        let (e, de) = (position - (before - self.behind_s * slope), rate - slope);
        let [[a, b], [c, d]] = self.free;
        let position = thrust - self.behind_s * slope + a * e + b * de;
        self.swing = Some([position, slope + c * e + d * de]);
        self.thrust_n = thrust;
        sensed.thrust_n = thrust + self.share * (position - thrust);
    }
}
