//! The duct takes its share: friction inside, and a force of its own on the stand.

use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Local};
use crate::real::Real;

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "duct_loss",
    path: Path::Flow,
    what: "friction and inlet loss in the duct take up momentum, and the duct itself pushes on the stand",
    equation: "T = m vp' + (dbeta + (kd + ka [vp < 0])/2) rho a vp|vp|; y = T + cd rho a vp|vp|; kd, ka, cd [1]; ka: the \
               flow parts from the lip where it enters astern. kd alone is an error of the flux coefficient and is taken \
               up by it where that has a tolerance",
    signature: "thrust and flow no longer agree in the steady momentum balance, by the same percentage at all speeds; \
                shaft speed hardly changes",
    confused_with: &[
        "forward_reverse_asymmetry",
        "thrust_bias_gain_hysteresis",
        "flowmeter_offset_lag_location",
        "thrust_deduction_interaction",
        "water_density",
    ],
    separated_by: "a profile of the flow across the duct; thrust and flow recorded together",
    reference: "control volume of the duct, equations (2)-(6); Carlton, Marine Propellers and Propulsion; Idelchik, Handbook of Hydraulic Resistance (inlets)",
    commonness: 0.7,
    shifts_time: false,
    nonparametric: false,
    same_as: &[],
    holds: &[],
    forms: &[&[0], &[1], &[2], &[0, 1], &[1, 2]],
    parameters,
    starts: one_start,
    needs: wet,
    build: both!(build),
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("wall_loss", "1", 0.1, -1.0, 4.0).sigma(0.4),
        Spec::strength("duct_thrust", "1", 0.04, -1.5, 1.5).sigma(0.15),
        // A sharp inlet loses half of its head, one that stands out into the water nearly all of it (Idelchik, Handbook of
        // Hydraulic Resistance, flow into tubes and conduits).
        Spec::strength("lip_loss_astern", "1", 0.1, -1.0, 4.0).sigma(0.75),
    ]
}

fn build<T: Real>(values: &[T], context: &Context<T>) -> Box<dyn Effect<T>> {
    let flux = context.parameters.get(P::DensityKgM3) * context.parameters.area_m2();
    Box::new(DuctLoss {
        loss_kg_m: values[0] * 0.5 * flux,
        stand_kg_m: values[1] * flux,
        astern_kg_m: values[2] * 0.5 * flux,
    })
}

struct DuctLoss<T> {
    loss_kg_m: T,
    stand_kg_m: T,
    astern_kg_m: T,
}

impl<T: Real> Effect<T> for DuctLoss<T> {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    /// The loss meets the water in the duct, so ambient flow does not enter.
    fn balance(&self, at: &Local<T>, _: &[T], balance: &mut Balance<T>, _: &mut [T]) {
        let square = at.axial_m_s * at.axial_m_s.abs();
        balance.momentum_n -= self.loss_kg_m * square;
        if at.axial_m_s < 0.0 {
            balance.momentum_n -= self.astern_kg_m * square;
        }
        balance.stand_n += self.stand_kg_m * square;
    }
}
