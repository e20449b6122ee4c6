//! The flow meter sits away from the propeller, and its zero or gain is off.

use super::memory::History;
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, flow_measured};
use crate::plant::{Sensed, Tick};

/// Longest lag of the meter, s: where the water hardly moves, the model's one stream says nothing.
const LONGEST_S: f64 = 1.0;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "flowmeter_offset_lag_location",
    path: Path::Sensor,
    what: "the flow meter sits downstream: it sees the water later, after the jet has contracted, and with its own zero",
    equation: "y = g vp(t - x/|vp|) + b, x/|vp| at most about 1 s; x [m], g [1], b [m/s]",
    signature: "flow alone is off: late by a time that falls as 1/vp (about 0.2 s at full, 0.6 s at a third), in \
                proportion, or by a constant also at rest",
    confused_with: &["inertia_added_mass_error", "duct_loss", "clock_skew"],
    separated_by: "steps to several speeds, flow correlated with thrust at each; a traverse of the meter",
    reference: "Whitcomb & Yoerger, Comparative Experiments in the Dynamics and Model-Based Control of Marine Thrusters (their meter: 0.30 m downstream); dbeta 1.86 = 2/g^2 gives g = 1.04",
    parameters,
    starts: |scale| [0.15, 0.35].iter().map(|share| vec![share * scale.flow_m_s, 0.02, 0.005 * scale.flow_m_s]).collect(),
    needs: flow_measured,
    build: |values, context| {
        Box::new(FlowMeter { distance_m: values[0], gain_error: values[1], offset_m_s: values[2], past: History::new(LONGEST_S, context.tick_s) })
    },
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.flow_m_s;
    vec![
        Spec::strength("distance_m", "m", 0.05 * full, 0.0, full),
        Spec::strength("flow_gain_error", "1", 0.02, -0.7, 1.5),
        Spec::strength("flow_offset_m_s", "m/s", 0.005 * full, -0.3 * full, 0.3 * full),
    ]
}

struct FlowMeter {
    distance_m: f64,
    gain_error: f64,
    offset_m_s: f64,
    past: History,
}

impl Effect for FlowMeter {
    fn hooks(&self) -> Hooks {
        Hooks::SENSE
    }

    fn sense(&mut self, _: &Tick, sensed: &mut Sensed) {
        self.past.push(sensed.flow_m_s);
        if self.distance_m > 0.0 {
            let lag = self.distance_m / (sensed.flow_m_s.abs() + self.distance_m / LONGEST_S);
            sensed.flow_m_s = self.past.ago(lag);
        }
        sensed.flow_m_s = sensed.flow_m_s * (1.0 + self.gain_error) + self.offset_m_s;
    }
}
