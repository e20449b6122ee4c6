//! The noise that a hypothesis leaves, and what its residual costs under it.
//!
//! A tempered profile Whittle likelihood. Each band's noise level is what the residual leaves there, but
//! never below the *form error*: our equations are not exact, and a few percent of a signal, or a share of
//! the mismatch that is to be explained, must not count against a good name. The lowest bands may not explain a constant
//! away: noise rises towards low frequency no faster than a random walk does.
//!
//! A band of one structural error holds many lines and few facts, in however many recordings: all its variance may lie in
//! at most so many coordinates of the band, while the sensor's white noise lies in all of them alike. So white noise of
//! level `N` hides no more than `N` in each of the coordinates of a structural error of level `T`, which has
//! `T n / facts` there: an error well below the noise of single samples shows, as far as it is larger than the form error.
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
    /// Error of the equations that explain a mismatch, as a share of it.
    pub own_form_error: f64,
    /// Most independent facts about a frequency of a channel, in all recordings.
    pub facts_a_band: f64,
    /// Standard deviation of time stamps at most, s.
    pub timing_s: f64,
}

impl Criterion {
    /// Independent facts in a band: its share of those about its frequency in all recordings.
    fn facts(&self, band: &Band) -> f64 {
        band.lines.len() as f64 * self.facts_a_band / (band.alike as f64 + self.facts_a_band)
    }
}

/// Neighbouring bands of one level, over the walk's own course.
struct Pool {
    bands: usize,
    facts: f64,
    /// Mean of what is noise in them.
    noise: f64,
    /// Their highest floor.
    least: f64,
}

impl Pool {
    fn level(&self) -> f64 {
        self.noise.max(self.least)
    }

    fn with(&self, lower: &Self) -> Self {
        let facts = self.facts + lower.facts;
        Self {
            bands: self.bands + lower.bands,
            facts,
            noise: (self.facts * self.noise + lower.facts * lower.noise) / facts,
            least: self.least.max(lower.least),
        }
    }
}

/// The likeliest levels that rise towards low frequency no faster than a random walk's, `1/f^2`, and are no lower than the
/// floor. Over the walk's own course levels may only fall with falling frequency. Pooling neighbours that violate it,
/// each pool at its likeliest level above its floors, solves both limits at once (Barlow et al. 1972, Statistical Inference
/// under Order Restrictions, 1.2; convex in the logarithm of a level).
fn likeliest(bands: &[Band], powers: &[f64], floor: &Floor, facts: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(bands.len());
    let mut first = 0;
    while first < bands.len() {
        let last = (first..bands.len()).find(|b| !bands[*b].continues).unwrap_or(bands.len() - 1);
        let walk = |b: usize| bands[b].hz.powi(-2);
        let mut pools: Vec<Pool> = Vec::new();
        for b in first..=last {
            // What is excused need not be there: a quiet band says that there is no walk.
            let noise = (powers[b] - floor.own[b]).max(powers[b].min(floor.levels[b]));
            let least = floor.levels[b] / walk(b);
            let mut pool = Pool { bands: 1, facts: facts[b], noise: noise / walk(b), least };
            while let Some(lower) = pools.pop_if(|lower| lower.level() > pool.level()) {
                pool = pool.with(&lower);
            }
            pools.push(pool);
        }
        let levels = pools.iter().flat_map(|p| std::iter::repeat_n(p.level(), p.bands));
        out.extend(levels.zip(first..).map(|(level, b)| level * walk(b) + floor.own[b]));
        first = last + 1;
    }
    out
}

/// Variance below which nothing is told apart, in squares of the full scale: rounding of the computation.
const ROUNDING: f64 = 1e-14;

/// What no hypothesis is held to account for, by band.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Variance of quantisation, form error of the model and timing.
    levels: Vec<f64>,
    /// Form error of what explains the mismatch, on top of it. It is no noise: it says nothing about frequencies beside
    /// it.
    own: Vec<f64>,
    /// Variance of the sensor's white noise.
    white: Vec<f64>,
}

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
            if band.rest {
                // No equation errs where nothing moves; what a reading scatters by says how well its mean is known.
                floor.push(band.quantisation / criterion.facts_a_band + ROUNDING);
                continue;
            }
            moving = moving.max(band.signal * band.hz * band.hz);
            let form = criterion.form_error.powi(2) * moving / (band.hz * band.hz);
            // Rows stand in order: their stamps are off by less than an instant anywhere in a row would be.
            let timing_s = criterion.timing_s.min(band.row_s / 12.0_f64.sqrt()).hypot(band.stale_s);
            let timing = (std::f64::consts::TAU * band.hz * timing_s).powi(2) * band.signal;
            floor.push(band.quantisation + form + timing + ROUNDING);
        }
        Self { white: vec![0.0; floor.len()], own: vec![0.0; floor.len()], levels: floor }
    }

    /// Variance by band, in squares of the full scale.
    pub fn levels(&self) -> Vec<f64> {
        self.levels.iter().zip(&self.own).map(|(floor, own)| floor + own).collect()
    }

    /// With the doubt of what drives the model (mean square by band).
    pub fn with_doubt(&self, doubt: &[f64]) -> Self {
        Self { levels: self.levels.iter().zip(doubt).map(|(f, d)| f + d).collect(), ..self.clone() }
    }

    /// With the form error of what is to explain a mismatch (mean square by band): its equations are as good as a share
    /// of it. No more than the signal is to be explained: a model that runs away leaves more than none at all.
    pub fn explaining(&self, bands: &[Band], mismatch: &[f64], criterion: &Criterion) -> Self {
        let share = criterion.own_form_error.powi(2);
        let of_band = |(band, left): (&Band, &f64)| share * left.min(band.signal);
        Self {
            levels: self.levels.clone(),
            own: bands.iter().zip(mismatch).map(of_band).collect(),
            white: white(bands, mismatch),
        }
    }

    /// The lower of two, band by band.
    pub fn or_lower(&self, other: &Self) -> Self {
        let lower = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a.min(*b)).collect();
        Self {
            levels: lower(&self.levels, &other.levels),
            own: lower(&self.own, &other.own),
            white: lower(&self.white, &other.white),
        }
    }
}

/// Fewest lines of a band whose level is known well enough, to a seventh, to be taken for the sensor's noise.
const MANY: usize = 100;

/// Variance of each channel's white noise by band: the lowest level to which a residual falls anywhere in frequency.
/// Nothing is white noise in a channel that has no band of many lines.
fn white(bands: &[Band], powers: &[f64]) -> Vec<f64> {
    let mut out = Vec::with_capacity(bands.len());
    while out.len() < bands.len() {
        let first = out.len();
        let last = (first..bands.len()).find(|b| !bands[*b].continues).unwrap_or(bands.len() - 1);
        let many = (first..=last).filter(|b| bands[*b].lines.len() >= MANY);
        let lowest = many.map(|b| powers[b]).fold(f64::INFINITY, f64::min);
        let level = if lowest.is_finite() { lowest } else { 0.0 };
        out.resize(last + 1, level);
    }
    out
}

/// The noise that a residual shows: level and weight by band.
#[derive(Clone, Debug, PartialEq)]
pub struct Noise {
    /// Variance by band, in squares of the full scale.
    pub level: Vec<f64>,
    /// What a squared line counts: one over the variance of a coordinate that a structural error may lie in.
    pub weight: Vec<f64>,
    /// Twice the tempered negative log-likelihood of the residual under it.
    pub misfit: f64,
}

impl Noise {
    /// Of a residual with these mean squares by band.
    pub fn of(bands: &[Band], powers: &[f64], floor: &Floor, criterion: &Criterion) -> Self {
        let facts: Vec<f64> = bands.iter().map(|band| criterion.facts(band)).collect();
        let level = likeliest(bands, powers, floor, &facts);
        let mut misfit = 0.0;
        let mut weight = Vec::with_capacity(bands.len());
        for (b, band) in bands.iter().enumerate() {
            let (white, lines) = (floor.white[b], band.lines.len() as f64);
            let gathered = lines / facts[b];
            let structure = (level[b] - white).max(floor.levels[b] + floor.own[b]);
            let variance = white + gathered * structure;
            misfit += facts[b] * (variance.ln() + (white + gathered * (powers[b] - white)) / variance - 1.0);
            weight.push(1.0 / variance);
        }
        Self { level, weight, misfit }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const CRITERION: Criterion =
        Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 30.0, timing_s: 0.001 };

    fn bands() -> Vec<Band> {
        (0..12)
            .map(|k| Band {
                lines: 10 * k..10 * k + 10,
                hz: 0.01 * 1.585_f64.powi(k as i32),
                alike: 10,
                signal: if k == 3 { 1.0 } else { 1e-12 },
                quantisation: 0.0,
                row_s: 0.01,
                stale_s: 0.0,
                continues: k < 11,
                rest: false,
            })
            .collect()
    }

    #[test]
    fn the_form_error_falls_with_the_square_of_frequency_above_the_signal_and_is_none_below() {
        let floor = Floor::of_signal(&bands(), &CRITERION);
        assert!(floor.levels()[2] < 1e-12, "{:?}", floor.levels());
        assert!((floor.levels()[3] / 1e-4 - 1.0).abs() < 0.01);
        assert!((floor.levels()[5] / floor.levels()[3] * 1.585_f64.powi(4) - 1.0).abs() < 0.01);
    }

    #[test]
    fn stamps_of_a_fast_log_are_doubted_by_no_more_than_a_row() {
        let level = |row_s: f64| {
            let bands: Vec<Band> = bands().into_iter().map(|b| Band { signal: 1.0, row_s, ..b }).collect();
            Floor::of_signal(&bands, &Criterion { form_error: 0.0, ..CRITERION }).levels[11]
        };
        assert!((level(0.1) / level(0.01) - 1.0).abs() < 1e-9, "a slow log: what the criterion says");
        assert!(
            (level(0.01) / level(1e-4) / 1200.0 - 1.0).abs() < 1e-6,
            "a fast one: a row over the root of twelve"
        );
    }

    #[test]
    fn what_is_left_of_a_mismatch_below_a_share_hardly_counts_and_the_rest_does() {
        let mut bands = bands();
        bands[5].signal = 1.0;
        let (mut mismatch, facts) = (vec![1e-6; 12], CRITERION.facts(&bands[5]));
        mismatch[5] = 1.0;
        let floor = Floor::of_signal(&bands, &CRITERION).explaining(&bands, &mismatch, &CRITERION);
        let misfit = |left: f64| {
            let mut powers = vec![1e-6; 12];
            powers[5] = left;
            Noise::of(&bands, &powers, &floor, &CRITERION).misfit
        };
        let share = CRITERION.own_form_error.powi(2);
        assert!(misfit(1.0) - misfit(share) > facts * (0.9 / share).ln());
        assert!(misfit(share) - misfit(0.01 * share) < 1.01 * facts);
        assert!(misfit(0.01 * share) < misfit(share), "less error never costs more");
        let away = vec![1e3; 12];
        let most = Floor::of_signal(&bands, &CRITERION).explaining(&bands, &away, &CRITERION);
        assert!(
            (most.levels()[5] - floor.levels()[5]).abs() < 1e-12,
            "no more than the signal is to be explained"
        );
    }

    #[test]
    fn the_lower_of_two_floors_holds_band_by_band() {
        let signal: Vec<Band> = bands().into_iter().map(|band| Band { signal: 1.0, ..band }).collect();
        let floor = Floor::of_signal(&signal, &CRITERION);
        let (low, high): (Vec<f64>, Vec<f64>) =
            (0..12).map(|k| if k < 6 { (0.0, 1.0) } else { (1.0, 0.0) }).unzip();
        let held = |mismatch: &[f64]| floor.explaining(&signal, mismatch, &CRITERION);
        assert_eq!(held(&low).or_lower(&held(&high)), floor);
    }

    #[test]
    fn a_constant_error_hides_in_noise_only_as_far_as_a_random_walk_goes() {
        let floor = Floor::of_signal(&bands(), &CRITERION);
        let mut powers = vec![1e-6; 12];
        let quiet = Noise::of(&bands(), &powers, &floor, &CRITERION);
        powers[0] = 1e-2;
        let biased = Noise::of(&bands(), &powers, &floor, &CRITERION);
        for pair in biased.level.windows(2) {
            assert!(pair[0] < pair[1] * 1.585_f64.powi(2) * 1.001, "{:?}", biased.level);
        }
        // Free, the band's own level would cost 7.5 ln 1e4 = 69.
        assert!(biased.misfit > quiet.misfit + 2.0 * 69.0, "{} after {}", biased.misfit, quiet.misfit);
    }

    #[test]
    fn a_walk_costs_no_more_than_white_noise_of_its_own_level() {
        let floor = Floor::of_signal(&bands(), &CRITERION);
        let powers: Vec<f64> = bands().iter().map(|b| 1e-6 / (b.hz * b.hz)).collect();
        let walk = Noise::of(&bands(), &powers, &floor, &CRITERION);
        for (level, power) in walk.level.iter().zip(&powers) {
            assert!((level / power - 1.0).abs() < 1e-3, "{level} for {power}");
        }
    }

    proptest! {
        #[test]
        fn less_error_never_costs_more(
            decades in prop::collection::vec(-9.0..-3.0_f64, 12),
            floors in prop::collection::vec(-9.0..-3.0_f64, 12),
            less in 0.0..1.0_f64,
            k in 0..12_usize,
        ) {
            let levels = floors.iter().map(|d| 10.0_f64.powf(*d)).collect();
            let floor = Floor { levels, own: vec![0.0; 12], white: vec![0.0; 12] };
            let mut powers: Vec<f64> = decades.iter().map(|d| 10.0_f64.powf(*d)).collect();
            let before = Noise::of(&bands(), &powers, &floor, &CRITERION).misfit;
            powers[k] *= less;
            let after = Noise::of(&bands(), &powers, &floor, &CRITERION).misfit;
            prop_assert!(after <= before + 1e-9, "band {}: {} after {}", k, after, before);
        }
    }

    #[test]
    fn an_error_below_white_noise_shows_by_what_many_lines_tell() {
        let mut wide = bands();
        for (k, band) in wide.iter_mut().enumerate() {
            (band.lines, band.alike) = (1000 * k..1000 * k + 1000, 1000);
        }
        let exact = Criterion { form_error: 0.0, timing_s: 0.0, ..CRITERION };
        let plain = Floor::of_signal(&wide, &exact);
        let noise = vec![1e-6; 12];
        let white = plain.explaining(&wide, &noise, &exact);
        let mut powers = noise.clone();
        powers[8] = 1.5e-6;
        let told = |floor: &Floor| {
            let misfit = |powers: &[f64]| Noise::of(&wide, powers, floor, &exact).misfit;
            misfit(&powers) - misfit(&noise)
        };
        let facts = exact.facts(&wide[8]);
        assert!(
            (told(&plain) / facts - 1.5_f64.ln()).abs() < 0.02,
            "no noise known: as much as a structural error"
        );
        assert!(
            (told(&white) / facts - (1.0 + 0.5 * 1000.0 / facts).ln()).abs() < 0.3,
            "{}",
            told(&white) / facts
        );
    }

    #[test]
    fn what_is_excused_at_a_frequency_is_no_noise_beside_it() {
        let loud: Vec<Band> = bands().into_iter().map(|band| Band { signal: 1e-2, ..band }).collect();
        let mut mismatch = vec![1e-9; 12];
        mismatch[0] = 1e-2;
        let exact = Criterion { form_error: 0.0, timing_s: 0.0, ..CRITERION };
        let floor = Floor::of_signal(&loud, &exact).explaining(&loud, &mismatch, &exact);
        let levels = |constant: f64| {
            let mut powers = vec![1e-9; 12];
            powers[0] = constant;
            Noise::of(&loud, &powers, &floor, &exact).level
        };
        assert!(levels(1e-5)[1] < 1.1e-9, "within the share of the mismatch that its name may leave");
        assert!(levels(1e-2)[1] > 1e-4, "beyond it: a walk");
    }

    #[test]
    fn many_lines_count_as_few_facts_in_however_many_recordings() {
        let mut wide = bands();
        wide.truncate(1);
        wide[0] = Band { continues: false, lines: 0..100_000, alike: 100_000, ..wide[0].clone() };
        let told = |bands: &[Band]| {
            let floor = Floor::of_signal(bands, &CRITERION);
            let misfit = |power| Noise::of(bands, &vec![power; bands.len()], &floor, &CRITERION).misfit;
            misfit(1e-2) - misfit(1e-4)
        };
        assert!((told(&wide) - 30.0 * 100.0_f64.ln()).abs() < 0.1);
        let one_of_four = Band { alike: 400_000, ..wide[0].clone() };
        assert!((told(&vec![one_of_four; 4]) - told(&wide)).abs() < 0.1);
    }
}
