//! The water's own movement changes with time: waves, a wandering current.

use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start};
use crate::plant::{Balance, Local};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "ambient_flow_unsteady",
    path: Path::Flow,
    what: "ambient flow that changes with time: waves, a wandering current, large eddies in a tank",
    equation: "T = m vp' + dbeta rho a (vp - va(t))|vp|; va(t) straight between knots [m/s]",
    signature: "thrust, shaft speed and flow move together without a command, at 0.05 to 0.3 Hz",
    confused_with: &["ambient_axial_flow", "tank_recirculation", "supply_sag", "thermal_drift_kt"],
    separated_by: "the flow meter with the motor off; coherence of thrust, speed and flow at low frequency",
    reference: "equation (6a), from (4); straight pieces are kort's form",
    parameters,
    starts: one_start,
    needs: super::ambient_axial_flow::needs,
    build: |values, _| Box::new(AmbientFlowUnsteady { spacing_s: values[0], knots_m_s: values[1..].to_vec() }),
};

/// Names of the knots, as many as a recording may need.
const KNOTS: [&str; 42] = [
    "knot_1_m_s", "knot_2_m_s", "knot_3_m_s", "knot_4_m_s", "knot_5_m_s", "knot_6_m_s", "knot_7_m_s",
    "knot_8_m_s", "knot_9_m_s", "knot_10_m_s", "knot_11_m_s", "knot_12_m_s", "knot_13_m_s", "knot_14_m_s",
    "knot_15_m_s", "knot_16_m_s", "knot_17_m_s", "knot_18_m_s", "knot_19_m_s", "knot_20_m_s", "knot_21_m_s",
    "knot_22_m_s", "knot_23_m_s", "knot_24_m_s", "knot_25_m_s", "knot_26_m_s", "knot_27_m_s", "knot_28_m_s",
    "knot_29_m_s", "knot_30_m_s", "knot_31_m_s", "knot_32_m_s", "knot_33_m_s", "knot_34_m_s", "knot_35_m_s",
    "knot_36_m_s", "knot_37_m_s", "knot_38_m_s", "knot_39_m_s", "knot_40_m_s", "knot_41_m_s", "knot_42_m_s",
];

/// A knot every 1.5 s or every fortieth of the recording, whichever is longer.
fn parameters(scale: &Scale) -> Vec<Spec> {
    let spacing_s = (scale.duration_s / 40.0).max(1.5);
    let count = ((scale.duration_s / spacing_s).ceil() as usize + 1).clamp(2, KNOTS.len());
    let full = scale.flow_m_s;
    let knots = KNOTS[..count].iter().map(|name| Spec::strength(name, "m/s", 0.03 * full, -full, full));
    std::iter::once(Spec::held("knot_spacing_s", "s", spacing_s, spacing_s, spacing_s)).chain(knots).collect()
}

struct AmbientFlowUnsteady {
    spacing_s: f64,
    knots_m_s: Vec<f64>,
}

impl Effect for AmbientFlowUnsteady {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    /// The knots repeat past the last one, so a recording may begin at any time.
    fn balance(&self, at: &Local, _: &[f64], balance: &mut Balance, _: &mut [f64]) {
        let count = self.knots_m_s.len();
        let place = (at.time_s / self.spacing_s).rem_euclid(count as f64);
        let (knot, part) = (place as usize % count, place.fract());
        let (from, to) = (self.knots_m_s[knot], self.knots_m_s[(knot + 1) % count]);
        balance.ambient_m_s += from + (to - from) * part;
    }
}
