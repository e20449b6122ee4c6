//! The flow meter sits away from the propeller, and its zero or gain is off.

use super::memory::{FirstOrder, History};
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, flow_measured};
use crate::plant::{Sensed, Tick};
use crate::real::Real;

/// Longest delay of the meter, s.
const LONGEST_S: f64 = 1.0;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "flowmeter_offset_lag_location",
    path: Path::Sensor,
    what: "the flow meter sits downstream: it sees the water later, after the jet has contracted, and with its own zero",
    equation: "y = g L[vp(t - x/(|vp| + v0))] + b; L a first-order lag of mixing length l, time constant l/(|vp| + v0); \
               v0 the speed at which water drifts past the meter when the jet is weak; x, l [m], g [1], b, v0 [m/s]",
    signature: "flow alone is off: late by a time that falls as 1/vp (about 0.2 s at full, 0.6 s at a third), in \
                proportion, or by a constant also at rest",
    confused_with: &["inertia_added_mass_error", "duct_loss", "clock_skew"],
    separated_by: "steps to several speeds, flow correlated with thrust at each; a traverse of the meter",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their meter: 0.30 m downstream); dbeta 1.86 = 2/g^2 gives g = 1.04; mixing and drift are kort's form",
    commonness: 1.5,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[2], &[3], &[2, 3], &[0, 4], &[1, 4], &[0, 1, 4], &[0, 1, 2, 3, 4]],
    parameters,
    starts: |scale| {
        let full = scale.flow_m_s;
        [0.06, 0.15].iter().map(|s| vec![s * full, s * full, 0.02, 0.005 * full, 0.08 * full]).collect()
    },
    needs: flow_measured,
    build: both!(|values, context| {
        Box::new(FlowMeter {
            distance_m: values[0],
            mixing_m: values[1],
            gain_error: values[2],
            offset_m_s: values[3],
            drift_m_s: values[4],
            tick_s: context.tick_s,
            past: History::new(LONGEST_S, context.tick_s),
            mixed: FirstOrder::new(),
        })
    }),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.flow_m_s;
    vec![
        Spec::strength("distance_m", "m", 0.02 * full, 0.0, full).sigma(0.25 * full),
        Spec::strength("mixing_length_m", "m", 0.02 * full, 0.0, full).sigma(0.2 * full),
        Spec::strength("flow_gain_error", "1", 0.02, -0.7, 1.5).sigma(0.3),
        Spec::strength("flow_offset_m_s", "m/s", 0.005 * full, -0.3 * full, 0.3 * full).sigma(0.05 * full),
        Spec::shape("drift_speed_m_s", "m/s", 0.08 * full, 0.02 * full, 0.4 * full).sigma(0.08 * full),
    ]
}

struct FlowMeter<T> {
    distance_m: T,
    mixing_m: T,
    gain_error: T,
    offset_m_s: T,
    drift_m_s: T,
    tick_s: f64,
    past: History<T>,
    mixed: FirstOrder<T>,
}

impl<T: Real> Effect<T> for FlowMeter<T> {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed<T>) {
        let carried_m_s = sensed.flow_m_s.abs() + self.drift_m_s;
        self.past.push(sensed.flow_m_s);
        let arrived = self.past.ago((self.distance_m / carried_m_s).min(T::from(LONGEST_S)));
        let mixed = self.mixed.step(arrived, self.mixing_m / carried_m_s, self.tick_s);
        sensed.flow_m_s = mixed * (self.gain_error + 1.0) + self.offset_m_s;
    }
}
