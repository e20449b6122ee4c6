//! The random part of the ambient flow.

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::Turbulence;

/// Gauss-Markov noise, exact at any step.
pub(super) struct Turbulent {
    sigma_m_s: f64,
    time_constant_s: f64,
    now: f64,
    random: ChaCha8Rng,
}

impl Turbulent {
    /// Of values that were checked.
    pub(super) fn new(wanted: Turbulence, seed: u64) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(seed.wrapping_add(29));
        let draw: f64 = StandardNormal.sample(&mut random);
        let Turbulence { sigma_m_s, time_constant_s } = wanted;
        Self { sigma_m_s, time_constant_s, now: sigma_m_s * draw, random }
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
