//! The speed signal is filtered more than stated.

use super::memory::MeanAndLag;
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, speed_measured};
use crate::parameters::Parameter as P;
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Longest second delay, s.
const LONGEST_S: f64 = 1.0;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "encoder_filter_lag",
    path: Path::Sensor,
    what: "measured shaft speed has a filter slower than stated, or one that is not stated at all",
    equation: "(t1 + dt) y1' = Om - y1 in place of the stated t1, then (1 - s) t2 y' = mean(y1 over the last 2 s t2) - y; dt, t2 \
               [s], s the share of t2 that a running mean makes [1]",
    signature: "shaft speed alone is late and rounded by a fixed time, at all amplitudes; thrust and flow fit",
    confused_with: &[
        "clock_skew",
        "amplifier_lag",
        "transport_delay",
        "entrained_water_inertia",
        "rotor_inertia_error",
    ],
    separated_by: "the raw shaft angle, differenced",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their speed filter: 10 ms)",
    commonness: 2.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[0, 1], &[1, 2]],
    parameters,
    starts: |_| vec![vec![0.03, 0.03, 0.0], vec![0.1, 0.1, 0.0]],
    needs: speed_measured,
    build: both!(|values, context| {
        let tick_s = context.tick_s;
        let stated_s = context.parameters.get(P::SpeedFilterTimeConstantS);
        Box::new(EncoderFilterLag {
            stated: decay(stated_s, tick_s),
            slower: decay(values[0] + stated_s, tick_s),
            memory: None,
            delay: MeanAndLag::new(values[1], values[2], LONGEST_S, tick_s),
        })
    }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("filter_excess_s", "s", 0.01, 0.0, 1.0).sigma(0.02),
        Spec::strength("second_lag_s", "s", 0.01, 0.0, LONGEST_S).sigma(0.02),
        Spec::shape("running_mean_share", "1", 0.0, 0.0, 1.0).prior(0.5, 0.3),
    ]
}

/// Decay of a filter over a tick.
fn decay<T: Real>(time_constant_s: T, tick_s: f64) -> T {
    if time_constant_s > 0.0 { (T::from(-tick_s) / time_constant_s).exp() } else { T::ZERO }
}

struct EncoderFilterLag<T> {
    /// Decay over a tick of the filter as stated, and as it is.
    stated: T,
    slower: T,
    /// Last output of the stated filter, and of the one in its place.
    memory: Option<(T, T)>,
    delay: MeanAndLag<T>,
}

impl<T: Real> Effect<T> for EncoderFilterLag<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let seen = sensed.shaft_speed_rad_s;
        let (before, last) = self.memory.unwrap_or((seen, seen));
        // The stated filter undone, and the slower one in its place.
        let raw = (seen - before * self.stated) / (T::ONE - self.stated);
        let slow = self.slower * last + (T::ONE - self.slower) * raw;
        self.memory = Some((seen, slow));
        sensed.shaft_speed_rad_s = self.delay.step(slow);
        // What comes out of a filter is no bare difference of counts.
        sensed.since_mean_rad_s2 = None;
    }
}
