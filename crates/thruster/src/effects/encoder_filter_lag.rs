//! The speed signal is filtered more than stated.

use super::memory::FirstOrder;
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, speed_measured};
use crate::plant::{Sensed, Tick};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "encoder_filter_lag",
    path: Path::Sensor,
    what: "measured shaft speed has a filter slower than stated, or one that is not stated at all",
    equation: "t2 y' = Om - y, after the stated filter; t2 [s]",
    signature: "shaft speed alone is late and rounded by a fixed time, at all amplitudes; thrust and flow fit",
    confused_with: &["clock_skew", "amplifier_lag", "transport_delay", "entrained_water_inertia", "rotor_inertia_error"],
    separated_by: "the raw shaft angle, differenced",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their speed filter: 10 ms)",
    parameters,
    starts: |_| vec![vec![0.03], vec![0.1]],
    needs: speed_measured,
    build: |values, context| Box::new(EncoderFilterLag { lag_s: values[0], tick_s: context.tick_s, lag: FirstOrder::default() }),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![Spec::strength("speed_lag_s", "s", 0.01, 0.0, 1.0)]
}

struct EncoderFilterLag {
    lag_s: f64,
    tick_s: f64,
    lag: FirstOrder,
}

impl Effect for EncoderFilterLag {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed) {
        sensed.shaft_speed_rad_s = self.lag.step(sensed.shaft_speed_rad_s, self.lag_s, self.tick_s);
    }
}
