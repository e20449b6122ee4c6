//! Errors of the force sensor: zero, gain, drift, hysteresis.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, thrust_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "thrust_bias_gain_hysteresis",
    path: Path::Sensor,
    what: "the force sensor's zero, gain or hysteresis is off",
    equation: "y = g T + b + h sat(play(T)); g [1], b, h [N]",
    signature: "thrust alone is off, in proportion (gain), by a constant also at rest (bias), or by a loop between rising \
                and falling load (hysteresis); shaft speed and flow fit",
    confused_with: &[
        "forward_reverse_asymmetry",
        "ambient_axial_flow",
        "duct_loss",
        "water_density",
        "thrust_deduction_interaction",
    ],
    separated_by: "known static loads; the zero before and after the run",
    reference: "Doebelin, Measurement Systems; a play operator for the loop",
    commonness: 3.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[1], &[0], &[0, 1], &[2, 3], &[0, 1, 2, 3]],
    parameters,
    starts: one_start,
    needs: thrust_measured,
    build: both!(|values, _| Box::new(ThrustSensor {
        gain_error: values[0],
        bias_n: values[1],
        loop_n: values[2],
        width_n: values[3],
        anchor_n: Real::ZERO
    })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let t = scale.thrust_n;
    vec![
        Spec::strength("gain_error", "1", 0.03, -0.5, 0.5).sigma(0.05),
        Spec::strength("bias_n", "N", 0.01 * t, -0.3 * t, 0.3 * t).sigma(0.03 * t),
        Spec::strength("hysteresis_n", "N", 0.005 * t, 0.0, 0.2 * t).sigma(0.01 * t),
        Spec::shape("hysteresis_width_n", "N", 0.1 * t, 0.01 * t, 0.5 * t).sigma(0.15 * t),
    ]
}

struct ThrustSensor<T> {
    gain_error: T,
    bias_n: T,
    loop_n: T,
    width_n: T,
    anchor_n: T,
}

impl<T: Real> Effect<T> for ThrustSensor<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    /// A play operator of half-width `width_n` carries the memory of the loop.
    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let t = sensed.thrust_n;
        // Not `clamp`, which panics on the NaN of a simulation that broke down.
        self.anchor_n = self.anchor_n.max(t - self.width_n).min(t + self.width_n);
        sensed.thrust_n =
            t * (self.gain_error + 1.0) + self.bias_n + self.loop_n * (self.anchor_n - t) / self.width_n;
    }
}
