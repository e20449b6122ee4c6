//! Normalised gradient.
//!
//! Reference: Ioannou & Sun, Robust Adaptive Control, ch. 4; docs/control.md D9:
//! `theta' = Proj(G phi e / (1 + phi' phi))`, with dead zone, box and freeze.
//!
//! Assumes: the equations of [`super::regression`]. Needs measured: shaft speed, current, thrust.
//! Fails: as the equations do; slow along directions that are weakly excited; gives no standard
//! error. Converges only under persistent excitation, but never leaves its box.

use super::{AdaptationOptions, Adapted, COEFFICIENTS, EstimatorInput, Regression, beyond};
use crate::model::ControlModel;

/// A running gradient.
#[derive(Clone, Copy, Debug)]
pub struct Gradient {
    regression: Regression,
    options: AdaptationOptions,
    adapted: Adapted,
    elapsed_s: f64,
}

impl Gradient {
    /// At the stated values.
    pub fn new(model: &ControlModel, options: &AdaptationOptions) -> Self {
        Self {
            regression: Regression::new(model, options),
            options: *options,
            adapted: Adapted::default(),
            elapsed_s: 0.0,
        }
    }

    /// One step.
    pub fn tick(&mut self, input: &EstimatorInput) -> Option<Adapted> {
        self.elapsed_s += input.dt_s;
        let outcome = self.regression.tick(input, self.adapted.ratio[2])?;
        let dt = std::mem::take(&mut self.elapsed_s);
        match outcome {
            Err(why) => self.adapted.frozen = Some(why),
            Ok(equations) => {
                self.adapted.frozen = None;
                for e in equations.iter().filter(|e| e.valid) {
                    let predicted: f64 = (0..COEFFICIENTS).map(|i| e.phi[i] * self.adapted.ratio[i]).sum();
                    let error = beyond(e.y - predicted, self.options.dead_zone);
                    let size: f64 = e.phi.iter().map(|p| p * p).sum();
                    // Normalised to the level of operation, so that low thrust learns as fast.
                    let step = (self.options.gain_per_s * dt).min(0.5) * error / (1e-3 + size);
                    for i in 0..COEFFICIENTS {
                        self.adapted.ratio[i] += step * e.phi[i];
                    }
                }
                self.adapted.project(self.options.box_factor);
            }
        }
        Some(self.adapted)
    }
}
