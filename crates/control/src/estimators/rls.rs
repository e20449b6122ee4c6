//! Recursive least squares with forgetting.
//!
//! Reference: Astrom & Wittenmark, Adaptive Control, ch. 2; docs/control.md D9. Exponential forgetting
//! over `memory_s`, capped covariance (no wind-up while little is learnt), dead zone, box, freeze.
//!
//! Assumes: the equations of [`super::regression`]. Needs measured: shaft speed, current, thrust.
//! Fails: bias of the force sensor or the torque constant is learnt as lift and drag. Standard
//! errors count the residual as white; the filtered residual is not, so that they are optimistic
//! by up to the filter's correlation, for which they are widened.

use nalgebra::{Matrix3, Vector3};

use super::{AdaptationOptions, Adapted, EstimatorInput, Regression, beyond};
use crate::model::ControlModel;

/// Largest variance of a coefficient's multiple.
const CAP: f64 = 1.0;
/// Samples that one correlation time of the filter holds.
const CORRELATED: f64 = 20.0;

/// A running least squares.
#[derive(Clone, Copy, Debug)]
pub struct Rls {
    regression: Regression,
    options: AdaptationOptions,
    adapted: Adapted,
    p: Matrix3<f64>,
    residual_var: f64,
    elapsed_s: f64,
}

impl Rls {
    /// At the stated values.
    pub fn new(model: &ControlModel, options: &AdaptationOptions) -> Self {
        Self {
            regression: Regression::new(model, options),
            options: *options,
            adapted: Adapted::default(),
            p: Matrix3::identity() * CAP,
            residual_var: 1e-4,
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
                let forget = (-dt / self.options.memory_s.max(0.5)).exp().clamp(0.9, 0.9999);
                self.p /= forget;
                for e in equations.iter().filter(|e| e.valid) {
                    let phi = Vector3::from(e.phi);
                    let theta = Vector3::from(self.adapted.ratio);
                    let residual = e.y - phi.dot(&theta);
                    self.residual_var += 0.01 * (residual * residual - self.residual_var);
                    // Weight 1 stands for a residual of one percent of full scale.
                    let noise = 1e-2;
                    let shown = phi * e.shows;
                    let ph = self.p * shown;
                    let gain = ph / (noise + shown.dot(&ph));
                    let theta = theta + gain * beyond(residual, self.options.dead_zone);
                    self.p -= gain * ph.transpose();
                    self.adapted.ratio = theta.into();
                }
                self.cap();
                self.adapted.project(self.options.box_factor);
                for i in 0..3 {
                    let var = self.p[(i, i)] * self.residual_var / 1e-2 * CORRELATED;
                    let seen = i < 2 || equations[2].valid;
                    self.adapted.std_error[i] = if seen { var.max(0.0).sqrt() } else { f64::INFINITY };
                }
            }
        }
        Some(self.adapted)
    }

    fn cap(&mut self) {
        self.p = 0.5 * (self.p + self.p.transpose());
        if !self.p.iter().all(|x| x.is_finite()) {
            self.p = Matrix3::identity() * CAP;
        }
        for i in 0..3 {
            let d = self.p[(i, i)];
            if d > CAP {
                let scale = (CAP / d).sqrt();
                for j in 0..3 {
                    self.p[(i, j)] *= scale;
                    self.p[(j, i)] *= scale;
                }
            } else if d < 1e-9 {
                self.p[(i, i)] = 1e-9;
            }
        }
    }
}
