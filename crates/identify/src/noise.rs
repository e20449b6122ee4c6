//! The noise that a hypothesis leaves, and what its residual costs under it.
//!
//! A tempered profile Whittle likelihood. Each band's noise level is what the residual leaves there, but
//! never below the *form error*: our equations are not exact, and a few percent of a signal, or of an
//! effect's own action, must not count against a good name. A band of one structural error holds many
//! lines and few facts: it counts as at most so many. The lowest bands may not explain a constant away:
//! noise rises towards low frequency no faster than its neighbour allows.
//!
//! Whittle 1953 (Ark. Mat. 2:423); tempering after Gruenwald & van Ommen 2017 (Bayesian Anal. 12:1069).

use serde::Deserialize;

use crate::spectrum::Band;

/// The criterion's few constants; see `constants.toml` for where each comes from.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Criterion {
    /// Error of our equations as a share of the signal at and below a frequency.
    pub form_error: f64,
    /// Error of an effect's equation as a share of what the effect itself does.
    pub own_form_error: f64,
    /// Most independent facts in a band.
    pub facts_a_band: f64,
    /// Standard deviation of time stamps, s.
    pub timing_s: f64,
}

/// How fast noise may rise towards low frequency: by this times the square of the frequencies' ratio.
const RISE: f64 = 3.0;
/// Variance below which nothing is told apart, in squares of the full scale: rounding of the computation.
const ROUNDING: f64 = 1e-14;

/// Least noise by band; belongs to one hypothesis.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor(Vec<f64>);

impl Floor {
    /// The floor under which no hypothesis is held to account: quantisation, form error, timing.
    pub fn of_signal(bands: &[Band], criterion: &Criterion) -> Self {
        let mut floor = Vec::with_capacity(bands.len());
        // Largest power times squared frequency of the bands below.
        let mut moving = 0.0_f64;
        let mut starts = true;
        for band in bands {
            if starts {
                moving = 0.0;
            }
            starts = !band.continues;
            moving = moving.max(band.signal * band.hz * band.hz);
            let form = criterion.form_error.powi(2) * moving / (band.hz * band.hz);
            let timing_s = criterion.timing_s.hypot(band.stale_s);
            let timing = (std::f64::consts::TAU * band.hz * timing_s).powi(2) * band.signal;
            floor.push(band.quantisation + form + timing + ROUNDING);
        }
        Self(floor)
    }

    /// With the doubt of what drives the model (mean square by band).
    pub fn with_doubt(&self, doubt: &[f64]) -> Self {
        Self(self.0.iter().zip(doubt).map(|(f, d)| f + d).collect())
    }

    /// With the form error of effects that do this to the response (mean squares by band, one list an effect).
    pub fn with_actions(&self, actions: &[Vec<f64>], criterion: &Criterion) -> Self {
        let mut floor = self.0.clone();
        for action in actions {
            for (f, power) in floor.iter_mut().zip(action) {
                *f += criterion.own_form_error.powi(2) * power;
            }
        }
        Self(floor)
    }
}

/// The noise that a residual shows: level and weight by band.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Variance by band, in squares of the full scale.
    pub level: Vec<f64>,
    /// What a squared line counts: facts a line over the variance.
    pub weight: Vec<f64>,
    /// Twice the tempered negative log-likelihood of the residual under it.
    pub misfit: f64,
}

impl Noise {
    /// Of a residual with these mean squares by band.
    pub fn of(bands: &[Band], powers: &[f64], floor: &Floor, criterion: &Criterion) -> Self {
        let mut level = vec![0.0; bands.len()];
        for b in (0..bands.len()).rev() {
            let least = floor.0[b];
            let mut seen = powers[b].max(least);
            if bands[b].continues {
                let ratio = bands[b + 1].hz / bands[b].hz;
                seen = seen.min(RISE * ratio * ratio * level[b + 1]).max(least);
            }
            level[b] = seen;
        }
        let mut misfit = 0.0;
        let weight = bands
            .iter()
            .zip(&level)
            .zip(powers)
            .map(|((band, level), power)| {
                let n = band.lines.len() as f64;
                let facts = n * criterion.facts_a_band / (n + criterion.facts_a_band);
                misfit += facts * (level.ln() + power / level - 1.0);
                facts / (n * level)
            })
            .collect();
        Self { level, weight, misfit }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CRITERION: Criterion =
        Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 30.0, timing_s: 0.001 };

    fn bands() -> Vec<Band> {
        (0..12)
            .map(|k| Band {
                lines: 10 * k..10 * k + 10,
                hz: 0.01 * 1.585_f64.powi(k as i32),
                signal: if k == 3 { 1.0 } else { 1e-12 },
                quantisation: 0.0,
                stale_s: 0.0,
                continues: k < 11,
            })
            .collect()
    }

    #[test]
    fn the_form_error_falls_with_the_square_of_frequency_above_the_signal_and_is_none_below() {
        let floor = Floor::of_signal(&bands(), &CRITERION);
        assert!(floor.0[2] < 1e-12, "{:?}", floor.0);
        assert!((floor.0[3] / 1e-4 - 1.0).abs() < 0.01);
        assert!((floor.0[5] / floor.0[3] * 1.585_f64.powi(4) - 1.0).abs() < 0.01);
    }

    #[test]
    fn a_constant_error_cannot_hide_in_its_own_noise() {
        let floor = Floor::of_signal(&bands(), &CRITERION);
        let mut powers = vec![1e-6; 12];
        let quiet = Noise::of(&bands(), &powers, &floor, &CRITERION).misfit;
        powers[0] = 1e-2;
        let biased = Noise::of(&bands(), &powers, &floor, &CRITERION);
        assert!(biased.level[0] < 1e-5, "{:?}", biased.level);
        assert!(biased.misfit > quiet + 1000.0);
    }

    #[test]
    fn many_lines_count_as_few_facts() {
        let mut wide = bands();
        wide.truncate(1);
        wide[0].continues = false;
        wide[0].lines = 0..100_000;
        let floor = Floor::of_signal(&wide, &CRITERION);
        let misfit = |power| Noise::of(&wide, &[power], &floor, &CRITERION).misfit;
        assert!((misfit(1e-2) - misfit(1e-4) - 30.0 * 100.0_f64.ln()).abs() < 0.1);
    }
}
