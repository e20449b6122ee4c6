//! Ambient flow, depth and supply over time, from a seed.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scenario::{Ambient, Depth, Sag, is_on};

/// Sinusoids that make a sea.
const COMPONENTS: usize = 9;
/// How often the sea is worked out, s; straight in between.
pub const STEP_S: f64 = 0.02;

/// Sea and supply.
pub struct Sea<'a> {
    ambient: &'a Ambient,
    depth: Option<Depth>,
    sags: &'a [Sag],
    supply_v: Option<f64>,
    /// Angular frequency, phase and share of the amplitude of each component.
    components: [(f64, f64, f64); COMPONENTS],
    wander_m_s: f64,
    random: ChaCha8Rng,
}

/// The sea at one instant.
#[derive(Clone, Copy, Debug, Default)]
pub struct Now {
    /// Ambient axial flow, m/s.
    pub ambient_m_s: f64,
    /// Depth of the shaft, m.
    pub depth_m: Option<f64>,
    /// Supply, V.
    pub supply_v: Option<f64>,
}

impl<'a> Sea<'a> {
    /// A sea with its own phases.
    pub fn new(
        ambient: &'a Ambient,
        depth: Option<Depth>,
        sags: &'a [Sag],
        supply_v: Option<f64>,
        mut random: ChaCha8Rng,
    ) -> Self {
        let peak = std::f64::consts::TAU / ambient.wave_period_s.max(0.1);
        let mut components = [(0.0, 0.0, 0.0); COMPONENTS];
        let mut power = 0.0;
        for (k, c) in components.iter_mut().enumerate() {
            // A narrow spectrum about its peak, frequencies drawn so that it never repeats.
            let ratio = 0.7 + 0.75 * (k as f64 + random.random_range(0.0..1.0)) / COMPONENTS as f64;
            let spectrum = ratio.powi(-5) * (-1.25 * ratio.powi(-4)).exp();
            *c = (peak * ratio, random.random_range(0.0..std::f64::consts::TAU), spectrum.sqrt());
            power += 0.5 * spectrum;
        }
        for c in &mut components {
            c.2 /= power.sqrt();
        }
        Self { ambient, depth, sags, supply_v, components, wander_m_s: 0.0, random }
    }

    /// The sea at a time; call once a [`STEP_S`].
    pub fn at(&mut self, time_s: f64) -> Now {
        let a = self.ambient;
        let (mut along, mut up) = (0.0, 0.0);
        let waves = a.wave_std_m_s > 0.0 || self.depth.is_some_and(|d| d.wave_std_m > 0.0);
        if waves {
            for (w, phase, share) in self.components {
                let (s, c) = (w * time_s + phase).sin_cos();
                along += share * c;
                up += share * s;
            }
        }
        if a.wander_std_m_s > 0.0 {
            let keep = (-STEP_S / a.wander_time_s).exp();
            let white: f64 = StandardNormal.sample(&mut self.random);
            self.wander_m_s = keep * self.wander_m_s + a.wander_std_m_s * (1.0 - keep * keep).sqrt() * white;
        }
        let sag = self.sags.iter().filter(|s| is_on(s.at_s, s.for_s, s.every_s, time_s)).map(|s| s.to);
        Now {
            ambient_m_s: a.mean_m_s + program(&a.program, time_s) + a.wave_std_m_s * along + self.wander_m_s,
            depth_m: self.depth.map(|d| d.mean_m + d.wave_std_m * up),
            supply_v: self.supply_v.map(|v| v * sag.fold(1.0, f64::min)),
        }
    }
}

/// Straight lines between the pairs, again from the start when through.
fn program(pairs: &[(f64, f64)], time_s: f64) -> f64 {
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else { return 0.0 };
    let time = if last.0 > 0.0 { time_s % last.0 } else { 0.0 };
    if time <= first.0 {
        return first.1;
    }
    pairs
        .windows(2)
        .find(|w| time <= w[1].0)
        .map_or(last.1, |w| w[0].1 + (w[1].1 - w[0].1) * (time - w[0].0) / (w[1].0 - w[0].0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    #[test]
    fn waves_have_the_asked_spread() {
        let ambient = Ambient { wave_std_m_s: 0.3, wave_period_s: 6.0, mean_m_s: 0.1, ..Ambient::default() };
        let mut sea = Sea::new(&ambient, None, &[], None, ChaCha8Rng::seed_from_u64(1));
        let values: Vec<f64> = (0..200_000).map(|k| sea.at(k as f64 * 0.1).ambient_m_s).collect();
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / values.len() as f64).sqrt();
        assert!((mean - 0.1).abs() < 0.01 && (std - 0.3).abs() < 0.01, "{mean} {std}");
    }

    #[test]
    fn a_program_runs_straight_and_repeats() {
        let pairs = [(0.0, 0.0), (10.0, 1.0), (20.0, 0.0)];
        assert_eq!((program(&pairs, 5.0), program(&pairs, 15.0), program(&pairs, 25.0)), (0.5, 0.5, 0.5));
    }
}
