//! The duct takes its share: friction inside, and a force of its own on the stand.

use super::{Context, Descriptor, Effect, Hooks, Path, Scale, Spec, one_start, wet};
use crate::parameters::Parameter as P;
use crate::plant::{Balance, Local};

/// Catalogue entry.
pub const DESCRIPTOR: Descriptor = Descriptor {
    id: "duct_loss",
    path: Path::Flow,
    what: "friction and inlet loss in the duct take up momentum, and the duct itself pushes on the stand",
    equation: "T = m vp' + (dbeta + kd/2) rho a vp|vp|; y = T + cd rho a vp|vp|; kd, cd [1]. kd alone is an error of \
               the flux coefficient and is taken up by it where that has a tolerance",
    signature: "thrust and flow no longer agree in the steady momentum balance, by the same percentage at all speeds; \
                shaft speed hardly changes",
    confused_with: &["thrust_bias_gain_hysteresis", "flowmeter_offset_lag_location", "thrust_deduction_interaction", "water_density"],
    separated_by: "a profile of the flow across the duct; thrust and flow recorded together",
    reference: "control volume of the duct, equations (2)-(6); Carlton, Marine Propellers and Propulsion",
    parameters,
    starts: one_start,
    needs: wet,
    build,
};

fn parameters(_: &Scale) -> Vec<Spec> {
    vec![
        Spec::strength("wall_loss", "1", 0.1, -1.0, 4.0),
        Spec::strength("duct_thrust", "1", 0.04, -1.5, 1.5),
    ]
}

fn build(values: &[f64], context: &Context) -> Box<dyn Effect> {
    let flux = context.parameters.get(P::DensityKgM3) * context.parameters.area_m2();
    Box::new(DuctLoss { loss_kg_m: 0.5 * values[0] * flux, stand_kg_m: values[1] * flux })
}

struct DuctLoss {
    loss_kg_m: f64,
    stand_kg_m: f64,
}

impl Effect for DuctLoss {
    fn hooks(&self) -> Hooks {
        Hooks::BALANCE
    }

    /// The loss meets the water in the duct, so ambient flow does not enter.
    fn balance(&self, at: &Local, _: &[f64], balance: &mut Balance, _: &mut [f64]) {
        let square = at.axial_m_s * at.axial_m_s.abs();
        balance.momentum_n -= self.loss_kg_m * square;
        balance.stand_n += self.stand_kg_m * square;
    }
}
