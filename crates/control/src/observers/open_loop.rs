//! Open-loop flow: the momentum balance driven by the measured speed.
//!
//! Reference: docs/control.md D4, `m vp' = T(Om, v^) - dbeta rho a (v^ - va)|v^|`; it contracts by itself
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
    pub(super) fn start_in(&mut self, water: Water) {
        self.water = water;
    }

    /// One step.
    pub fn tick(&mut self, input: &ObserverInput) -> Estimate {
        let model = input.model;
        self.water = match input.measured.shaft_speed_rad_s {
            // The measured speed drives the water.
            Some(speed) => Water { speed_rad_s: speed, ..self.water }.step_at_speed(model, input.dt_s),
            // The model's own speed is for when there is none.
            None => self.water.step(model, model.torque_constant_nm_a * input.current_a, input.dt_s),
        };
        // Within the box that a step leaves the rest in.
        self.water.ambient_m_s =
            input.measured.ambient_m_s.unwrap_or(model.ambient_mean_m_s).clamp(-4.0, 4.0);
        self.water.estimate(model)
    }
}
