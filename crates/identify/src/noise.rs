//! What the residual of a good model looks like: coloured, and larger when the propeller turns.
//!
//! Turbulence of the inflow and drift of the force sensor make residuals that white-noise
//! statistics would take for physics. Each channel's residual is divided by a level that grows
//! with shaft speed, and by the root of its smoothed spectrum; what is left is white with unit
//! variance, and so are sums of squares chi-squared.

use std::sync::Arc;

use realfft::num_complex::Complex;
use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};

use crate::data::Response;
use crate::fit::{Fit, Hypothesis, Problem};

/// Whitens one channel of one recording.
#[derive(Clone)]
pub struct Whitener {
    level: Vec<f64>,
    shape: Option<Shape>,
}

/// A spectrum to divide by.
#[derive(Clone)]
struct Shape {
    /// Square root of the inverse spectrum, one value a frequency of the padded transform.
    gain: Vec<f64>,
    forward: Arc<dyn RealToComplex<f64>>,
    inverse: Arc<dyn ComplexToReal<f64>>,
}

/// Frequencies per smoothing band grow by this ratio.
const BAND_RATIO: f64 = 1.4;
const FEWEST_IN_BAND: usize = 4;
/// Mean of the logarithm of noise power lies this much below the logarithm of its mean. The mean
/// of logarithms is used because a misfit that stands out of its band (an offset, a line) must not
/// pass for noise.
const EULER: f64 = 0.577;

impl Whitener {
    /// A whitener that only scales by one level.
    pub fn flat(level: f64, samples: usize) -> Self {
        Self { level: vec![level; samples], shape: None }
    }

    /// Learns level and spectrum from a residual; `activity` (0 to 1) says how hard the propeller
    /// works at each sample, `floor` is the least level (the quantum of the sensor).
    pub fn learn(residual: &[f64], activity: &[f64], floor: f64) -> Self {
        let level = levels(residual, activity, floor);
        let scaled: Vec<f64> = residual.iter().zip(&level).map(|(r, l)| r / l).collect();
        let n = scaled.len();
        let size = (n + n / 8 + 16).next_power_of_two();
        let mut planner = RealFftPlanner::<f64>::new();
        let (forward, inverse) = (planner.plan_fft_forward(size), planner.plan_fft_inverse(size));
        let spectrum = transform(&scaled, forward.as_ref());
        let power: Vec<f64> = spectrum.iter().map(|c| c.norm_sqr() / n as f64).collect();
        let gain = smoothed(&power).into_iter().map(|s| 1.0 / s.max(1e-12).sqrt()).collect();
        Self { level, shape: Some(Shape { gain, forward, inverse }) }
    }

    /// The whitened samples.
    pub fn apply(&self, residual: &[f64]) -> Vec<f64> {
        let scaled: Vec<f64> = residual.iter().zip(&self.level).map(|(r, l)| r / l).collect();
        let Some(shape) = &self.shape else { return scaled };
        let mut spectrum = transform(&scaled, shape.forward.as_ref());
        for (c, g) in spectrum.iter_mut().zip(&shape.gain) {
            *c *= *g;
        }
        let last = spectrum.len() - 1;
        spectrum[0].im = 0.0;
        spectrum[last].im = 0.0;
        let mut out = shape.inverse.make_output_vec();
        // The planner made the lengths, so this cannot fail.
        let _ = shape.inverse.process(&mut spectrum, &mut out);
        let scale = 1.0 / out.len() as f64;
        out.truncate(scaled.len());
        out.iter_mut().for_each(|v| *v *= scale);
        out
    }

    /// Twice the logarithm of the size of the noise, summed over the samples: what a whitener learned
    /// from a fit's own residual says of how little that fit leaves.
    pub fn log_size(&self) -> f64 {
        let level: f64 = self.level.iter().map(|l| l.ln()).sum();
        let colour = self.shape.as_ref().map_or(0.0, |s| {
            s.gain.iter().map(|g| g.ln()).sum::<f64>() / s.gain.len() as f64 * self.level.len() as f64
        });
        2.0 * (level - colour)
    }

    /// Level at each sample, in the channel's unit.
    pub fn level(&self) -> &[f64] {
        &self.level
    }
}

impl Problem<'_> {
    /// Forgets what was learned of the noise: white, and the same share of full scale everywhere.
    pub fn flat_noise(&mut self) {
        self.whiteners = self
            .recordings
            .iter()
            .map(|p| p.channels.iter().map(|c| Whitener::flat(0.02 * c.full_scale, c.rows.len())).collect())
            .collect();
    }

    /// Takes all that a fit leaves for white noise, on every channel.
    pub fn white_noise_of(&mut self, fit: &Fit) {
        let residual = self.residual_of(fit);
        self.flat_noise();
        for (whiteners, residual) in self.whiteners.iter_mut().zip(residual) {
            for (whitener, values) in whiteners.iter_mut().zip(residual) {
                let mean_square = values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64;
                let least = 1e-3 * whitener.level()[0];
                *whitener = Whitener::flat(mean_square.sqrt().max(least), values.len());
            }
        }
    }

    /// Learns the noise from the residual of a fitted hypothesis.
    pub fn learn_noise(&mut self, hypothesis: &Hypothesis, values: &[f64]) {
        let rows = self.rows(hypothesis, values);
        let whiteners = self
            .recordings
            .iter()
            .zip(&self.masked)
            .zip(&rows)
            .map(|((recording, masked), rows)| {
                let top = rows.iter().fold(1e-9_f64, |m, r| m.max(r.true_speed_rad_s.abs()));
                recording
                    .channels
                    .iter()
                    .map(|c| {
                        let residual: Vec<f64> = c
                            .rows
                            .iter()
                            .zip(&c.values)
                            .map(|(r, v)| if masked[*r] { 0.0 } else { v - c.response.of(&rows[*r]) })
                            .collect();
                        let activity: Vec<f64> =
                            c.rows.iter().map(|r| (rows[*r].true_speed_rad_s / top).abs()).collect();
                        Whitener::learn(&residual, &activity, self.quantum(c.response) + 1e-5 * c.full_scale)
                    })
                    .collect()
            })
            .collect();
        self.whiteners = whiteners;
    }

    /// Standard deviation of a sensor's quantisation.
    fn quantum(&self, response: Response) -> f64 {
        let s = &self.rig.sensors;
        let uniform = 12.0_f64.sqrt();
        match response {
            Response::Thrust => match (s.thrust_full_scale_n, s.thrust_bits) {
                (Some(full), Some(bits)) => 2.0 * full / 2.0_f64.powi(bits as i32) / uniform,
                _ => 0.0,
            },
            Response::ShaftSpeed => match (s.encoder_counts_per_rev, s.control_rate_hz) {
                (Some(counts), Some(rate)) => {
                    let raw = std::f64::consts::TAU / counts * rate;
                    let tau = s.speed_filter_time_constant_s.unwrap_or(0.0) * rate;
                    raw / uniform / (1.0 + 2.0 * tau).sqrt() / 3.0
                }
                _ => 0.0,
            },
            _ => 0.0,
        }
    }
}

fn transform(values: &[f64], forward: &dyn RealToComplex<f64>) -> Vec<Complex<f64>> {
    let mut padded = forward.make_input_vec();
    padded[..values.len()].copy_from_slice(values);
    let mut spectrum = forward.make_output_vec();
    // The planner made the lengths, so this cannot fail.
    let _ = forward.process(&mut padded, &mut spectrum);
    spectrum
}

/// Standard deviation as `s0 + s1 activity`, from binned robust spreads.
fn levels(residual: &[f64], activity: &[f64], floor: f64) -> Vec<f64> {
    const BINS: usize = 6;
    let mut bins: Vec<Vec<f64>> = vec![Vec::new(); BINS];
    for (r, a) in residual.iter().zip(activity) {
        bins[((a * BINS as f64) as usize).min(BINS - 1)].push(*r);
    }
    // Least squares of variance on activity squared, weighted by count, both coefficients >= 0.
    let (mut n, mut sx, mut sxx, mut sy, mut sxy) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (i, bin) in bins.iter_mut().enumerate() {
        if bin.len() < 20 {
            continue;
        }
        let spread = rms(bin);
        let x = ((i as f64 + 0.5) / BINS as f64).powi(2);
        let y = spread * spread;
        // A variance is known to a share of itself: weight by 1/y^2.
        let w = bin.len() as f64 / (y * y).max(1e-300);
        n += w;
        sx += w * x;
        sxx += w * x * x;
        sy += w * y;
        sxy += w * x * y;
    }
    let det = n * sxx - sx * sx;
    let overall = rms(residual).max(floor).max(1e-12);
    let (mut v0, mut v1) = if det > 1e-9 * n * sxx {
        ((sy * sxx - sx * sxy) / det, (n * sxy - sx * sy) / det)
    } else {
        (overall * overall, 0.0)
    };
    if v1 < 0.0 {
        (v0, v1) = (if n > 0.0 { sy / n } else { overall * overall }, 0.0);
    }
    if v0 < 0.0 {
        (v0, v1) = (0.0, if sxx > 0.0 { sxy / sxx } else { overall * overall });
    }
    let least = floor.max(0.05 * overall).powi(2);
    activity.iter().map(|a| (v0 + v1 * a * a).max(least).sqrt()).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Power in bands that widen with frequency, joined by straight lines in the logarithms.
fn smoothed(power: &[f64]) -> Vec<f64> {
    let n = power.len();
    let mut knots: Vec<(f64, f64)> = Vec::new();
    let mut from = 0;
    while from < n {
        let to = ((from as f64 * BAND_RATIO) as usize).max(from + FEWEST_IN_BAND).min(n);
        let to = if n - to < FEWEST_IN_BAND { n } else { to };
        let mean = power[from..to].iter().map(|p| p.max(1e-12).ln()).sum::<f64>() / (to - from) as f64;
        knots.push(((0.5 * (from + to) as f64).ln(), mean + EULER));
        from = to;
    }
    let mut k = 0;
    (0..n)
        .map(|i| {
            let x = (i as f64 + 0.5).ln();
            while k + 2 < knots.len() && x > knots[k + 1].0 {
                k += 1;
            }
            if knots.len() < 2 {
                return knots[0].1.exp();
            }
            let ((x0, y0), (x1, y1)) = (knots[k], knots[k + 1]);
            let u = ((x - x0) / (x1 - x0)).clamp(0.0, 1.0);
            (y0 + (y1 - y0) * u).exp()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{Rng, SeedableRng};

    #[test]
    fn coloured_noise_comes_out_white() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
        let mut slow = 0.0;
        let residual: Vec<f64> = (0..6000)
            .map(|_| {
                slow = 0.98 * slow + 0.2 * rng.random_range(-1.0..1.0);
                slow + 0.3 * rng.random_range(-1.0..1.0)
            })
            .collect();
        let whitener = Whitener::learn(&residual, &vec![0.5; 6000], 1e-6);
        let w = whitener.apply(&residual);
        let power = w.iter().map(|v| v * v).sum::<f64>() / 6000.0;
        let lag = |k: usize| w.iter().zip(&w[k..]).map(|(a, b)| a * b).sum::<f64>() / 6000.0;
        assert!((power - 1.0).abs() < 0.1, "{power}");
        for k in [1, 2, 5, 20] {
            assert!(lag(k).abs() < 0.06, "lag {k}: {}", lag(k));
        }
    }

    #[test]
    fn level_follows_activity() {
        let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(6);
        let activity: Vec<f64> = (0..6000).map(|k| f64::from(k % 100) / 100.0).collect();
        let residual: Vec<f64> = activity.iter().map(|a| (0.1 + a) * rng.random_range(-1.0..1.0)).collect();
        let w = Whitener::learn(&residual, &activity, 1e-6);
        assert!(w.level()[95] > 3.0 * w.level()[2], "{} {}", w.level()[95], w.level()[2]);
    }
}
