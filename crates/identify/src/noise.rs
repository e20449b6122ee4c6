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

#[cfg(test)]
mod tests;

use std::ops::Range;

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
    /// Independent facts in a band: its share of those about its frequency in all recordings. What a sensor reads at rest
    /// is as many as that for all its recordings, though only their mean is a line.
    fn facts(&self, band: &Band) -> f64 {
        if band.rest {
            return self.facts_a_band / band.alike.max(1) as f64;
        }
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
    for channel in channels(bands) {
        let walk = |b: usize| bands[b].hz.powi(-2);
        let mut pools: Vec<Pool> = Vec::new();
        for b in channel.clone() {
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
        out.extend(levels.zip(channel).map(|(level, b)| level * walk(b) + floor.own[b]));
    }
    out
}

/// Variance below which nothing is told apart, in squares of the full scale: rounding of the computation.
const ROUNDING: f64 = 1e-14;

/// What no hypothesis is held to account for, by band.
#[derive(Clone, Debug, PartialEq)]
pub struct Floor {
    /// Variance of quantisation, form error of the model, timing, and the doubt of what drives.
    levels: Vec<f64>,
    /// That doubt alone.
    doubt: Vec<f64>,
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
                floor.push(band.quantisation / criterion.facts(band) + ROUNDING);
                continue;
            }
            moving = moving.max(band.signal * band.hz * band.hz);
            let form = criterion.form_error.powi(2) * moving / (band.hz * band.hz);
            // Rows stand in order: their stamps are off by less than an instant anywhere in a row would be.
            let timing_s = criterion.timing_s.min(band.row_s / 12.0_f64.sqrt()).hypot(band.stale_s);
            let timing = (std::f64::consts::TAU * band.hz * timing_s).powi(2) * band.signal;
            floor.push(band.quantisation + form + timing + ROUNDING);
        }
        let none = || vec![0.0; floor.len()];
        Self { white: none(), own: none(), doubt: none(), levels: floor }
    }

    /// Variance by band, in squares of the full scale.
    pub fn levels(&self) -> Vec<f64> {
        self.levels.iter().zip(&self.own).map(|(floor, own)| floor + own).collect()
    }

    /// With the doubt of what drives the model (mean square by band).
    pub fn with_doubt(&self, doubt: &[f64]) -> Self {
        let levels = self.levels.iter().zip(doubt).map(|(f, d)| f + d).collect();
        Self { levels, doubt: doubt.to_vec(), ..self.clone() }
    }

    /// Doubt of what drives the model, variance by band.
    pub fn doubt(&self) -> &[f64] {
        &self.doubt
    }

    /// Share of the doubt that what is left has room for (mean square by band). What drives may be smoother between its
    /// samples than the two courses that were simulated: their difference has the shape of the doubt and is no measure
    /// of its size. All channels were driven alike, so the one tells that has the least left.
    fn share_of_doubt(&self, bands: &[Band], left: &[f64], criterion: &Criterion) -> f64 {
        let tells = |b: &usize| !bands[*b].rest && 2.0 * self.doubt[*b] > self.levels[*b];
        let of_channel = |channel: Range<usize>| {
            let (sum, facts) = channel.filter(tells).fold((0.0, 0.0), |(sum, n), b| {
                let facts = criterion.facts(&bands[b]);
                (sum + facts * (left[b] / self.doubt[b]).min(1.0), n + facts)
            });
            // By two standard deviations more: residual and doubt are one draw each, and the least of several is rather
            // too small.
            if facts > 0.0 { sum / facts * (1.0 + 2.0 * (4.0 / facts).sqrt()) } else { 1.0 }
        };
        channels(bands).map(of_channel).fold(1.0, f64::min)
    }

    /// With the form error of what is to explain a mismatch (mean square by band): its equations are as good as a share
    /// of it. No more than the signal is to be explained: a model that runs away leaves more than none at all. What
    /// drives is in doubt no further than the mismatch shows.
    pub fn explaining(&self, bands: &[Band], mismatch: &[f64], criterion: &Criterion) -> Self {
        let share = criterion.own_form_error.powi(2);
        let of_band = |(band, left): (&Band, &f64)| share * left.min(band.signal);
        let kept = self.share_of_doubt(bands, mismatch, criterion);
        let less = |(level, doubt): (&f64, &f64)| level - (1.0 - kept) * doubt;
        Self {
            levels: self.levels.iter().zip(&self.doubt).map(less).collect(),
            doubt: self.doubt.iter().map(|doubt| kept * doubt).collect(),
            own: bands.iter().zip(mismatch).map(of_band).collect(),
            white: white(bands, mismatch),
        }
    }

    /// The same with a share of the form error of what explains the mismatch.
    pub fn excusing_less(&self, share: f64) -> Self {
        Self { own: self.own.iter().map(|own| own * share * share).collect(), ..self.clone() }
    }

    /// The lower of two, band by band.
    pub fn or_lower(&self, other: &Self) -> Self {
        let lower = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a.min(*b)).collect();
        Self {
            levels: lower(&self.levels, &other.levels),
            doubt: lower(&self.doubt, &other.doubt),
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
    for channel in channels(bands) {
        let many = channel.clone().filter(|b| bands[*b].lines.len() >= MANY);
        let lowest = many.map(|b| powers[b]).fold(f64::INFINITY, f64::min);
        out.resize(channel.end, if lowest.is_finite() { lowest } else { 0.0 });
    }
    out
}

/// Bands of each channel of each recording.
fn channels(bands: &[Band]) -> impl Iterator<Item = Range<usize>> {
    let mut first = 0;
    std::iter::from_fn(move || {
        let from = (first < bands.len()).then_some(first)?;
        first = (from..bands.len()).find(|b| !bands[*b].continues).map_or(bands.len(), |last| last + 1);
        Some(from..first)
    })
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
            if band.rest {
                // Noise of a reading about nothing: its scatter is known and its mean is what is asked, so the likeliest
                // variance is theirs together (the profile likelihood of a mean, Student's).
                let variance = floor.levels[b] + floor.own[b] + gathered * powers[b];
                misfit += facts[b] * variance.ln();
                weight.push(1.0 / variance);
                continue;
            }
            let structure = (level[b] - white).max(floor.levels[b] + floor.own[b]);
            let variance = white + gathered * structure;
            misfit += facts[b] * (variance.ln() + (white + gathered * (powers[b] - white)) / variance - 1.0);
            weight.push(1.0 / variance);
        }
        Self { level, weight, misfit }
    }
}
