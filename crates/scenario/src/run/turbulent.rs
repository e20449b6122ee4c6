//! The random part of the ambient flow.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::{ScenarioError, Turbulence};

/// Gauss-Markov noise, exact at any step.
pub(super) struct Turbulent {
    sigma_m_s: f64,
    time_constant_s: f64,
    now: f64,
    random: ChaCha8Rng,
}

impl Turbulent {
    pub(super) fn new(wanted: Turbulence, seed: u64) -> Result<Self, ScenarioError> {
        for (key, value) in [("sigma_m_s", wanted.sigma_m_s), ("time_constant_s", wanted.time_constant_s)] {
            if !(value.is_finite() && value > 0.0) {
                let (key, found) = (format!("turbulence.{key}"), value.to_string());
                return Err(ScenarioError::Value { key, found, allowed: "a finite number above 0".into() });
            }
        }
        let mut random = ChaCha8Rng::seed_from_u64(seed.wrapping_add(29));
        let draw: f64 = StandardNormal.sample(&mut random);
        let Turbulence { sigma_m_s, time_constant_s } = wanted;
        Ok(Self { sigma_m_s, time_constant_s, now: sigma_m_s * draw, random })
    }

    /// Values at the start and the end of the next step.
    pub(super) fn next(&mut self, dt: f64) -> (f64, f64) {
        let keep = (-dt / self.time_constant_s).exp();
        let draw: f64 = StandardNormal.sample(&mut self.random);
        let from = self.now;
        self.now = keep * from + self.sigma_m_s * (1.0 - keep * keep).sqrt() * draw;
        (from, self.now)
    }
}
