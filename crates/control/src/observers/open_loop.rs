//! Open-loop flow: the momentum balance driven by the measured speed.
//!
//! Reference: physics.md D4, `m vp' = T(Om, v^) - dbeta rho a (v^ - va)|v^|`; it contracts by itself
//! (38 ms at 60 rad/s on the stand), so it needs no correction while the model holds.
//!
//! Assumes: still water, unless the ambient flow is measured. Needs measured: shaft speed.
//! Fails: an unknown ambient flow or a wrong coefficient stays in `v^` for good. Knows no doubt:
//! its standard errors are infinite.

use super::{ObserverInput, Water};
use crate::signals::Estimate;

/// A running prediction.
#[derive(Clone, Copy, Debug, Default)]
pub struct OpenLoop {
    water: Water,
}

impl OpenLoop {
    /// One step.
    pub fn tick(&mut self, input: &ObserverInput) -> Estimate {
        let model = input.model;
        let motor = model.torque_constant_nm_a * input.current_a;
        let before = self.water;
        self.water = self.water.step(model, motor, input.dt_s);
        if let Some(speed) = input.measured.shaft_speed_rad_s {
            // The measured speed drives the water; the model's is for when there is none.
            let mean = Water { speed_rad_s: speed, ..before };
            self.water =
                mean.step(model, model.load(speed, before.flow_m_s, before.swirl_m_s).torque_n_m, input.dt_s);
            self.water.speed_rad_s = speed;
        }
        self.water.ambient_m_s = input.measured.ambient_m_s.unwrap_or(0.0);
        self.water = self.water.boxed(model);
        self.water.estimate(model)
    }
}
