//! The water's own movement changes with time: waves, a wandering current.

use super::knots::{self, Knots};
use super::{Descriptor, Effect, Hooks, Path, Scale, Spec, one_start};
use crate::plant::{Balance, Local};
use crate::real::Real;

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
    commonness: 0.3,
    shifts_time: false,
    nonparametric: true,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs: super::ambient_axial_flow::needs,
    build: both!(|values, _| Box::new(AmbientFlowUnsteady { flow_m_s: Knots::new(values) })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.flow_m_s;
    knots::specs(scale, &knots::SPEED, "m/s", 0.03 * full, (-full, full), 0.1 * full)
}

struct AmbientFlowUnsteady<T> {
    flow_m_s: Knots<T>,
}

impl<T: Real> Effect<T> for AmbientFlowUnsteady<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.ambient_m_s += self.flow_m_s.at(at.time_s);
    }
}
