//! The water already moves: current, towing, vehicle speed.

use super::{Available, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::plant::{Balance, Local};
use crate::real::Real;
use crate::rig::Rig;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "ambient_axial_flow",
    path: Path::Flow,
    what: "a steady current, towing or vehicle speed along the axis that the model takes as still water",
    equation: "T = m vp' + dbeta rho a (vp - va)|vp|; va [m/s], positive when it feeds the propeller ahead",
    signature: "thrust at a given speed is low one way and high the other, the more the lower the thrust: the deviation \
                falls as 1/Om, while an asymmetry of the blades is a constant percentage",
    confused_with: &[
        "forward_reverse_asymmetry",
        "torque_channel_bias",
        "thrust_bias_gain_hysteresis",
        "tank_recirculation",
    ],
    separated_by: "a staircase in both directions; a towed run; a force bias leaves shaft speed alone",
    reference: "equation (6a), from (4); Blanke, Lindegaard, Fossen 2000 (nonzero advance speed)",
    commonness: 1.0,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[],
    parameters,
    starts: one_start,
    needs,
    build: both!(|values, _| Box::new(AmbientAxialFlow { ambient_m_s: values[0] })),
};

fn parameters(scale: &Scale) -> Vec<Spec> {
    let full = scale.flow_m_s;
    vec![Spec::strength("ambient_m_s", "m/s", 0.03 * full, -1.5 * full, 1.5 * full).sigma(0.3 * full)]
}

pub(super) fn needs(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    wet(rig, available)?;
    if available.has("ambient_m_s") {
        Err("the ambient flow is recorded and already drives the model")
    } else {
        Ok(())
    }
}

struct AmbientAxialFlow<T> {
    ambient_m_s: T,
}

impl<T: Real> Effect<T> for AmbientAxialFlow<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    fn balance(&self, _: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        balance.ambient_m_s += self.ambient_m_s;
    }
}
