//! Command programmes, one current a control tick.

use crate::chain::TICK_S;
use rand::Rng;
use rand::seq::SliceRandom;

/// Kind of excitation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Programme {
    /// Staircase of holds with rests, random holds, slow triangles, random reversals.
    Full,
    /// Staircase of holds with rests only.
    Staircase,
    /// Holds at one sign, never back to rest.
    OneSided,
    /// Slow sines only, both signs: nowhere a corner that would show a lag from a delay.
    SlowRamps,
}

/// Builds a programme for a drive of `limit_a`.
pub fn commands(programme: Programme, limit_a: f64, rng: &mut impl Rng) -> Vec<f64> {
    let mut out = Vec::new();
    match programme {
        Programme::Full => {
            staircase(&mut out, limit_a, 5, 1.4, 0.6, rng);
            random_holds(&mut out, limit_a, 18.0, rng);
            triangle(&mut out, 0.6 * limit_a, 12.0);
            triangle(&mut out, 0.15 * limit_a, 3.0);
            reversals(&mut out, limit_a, 10, rng);
        }
        Programme::Staircase => staircase(&mut out, limit_a, 9, 1.9, 0.7, rng),
        Programme::OneSided => {
            let count = 28;
            for index in 0..count {
                let level = 0.35 + 0.65 * ((index * 11 % count) as f64 + rng.random::<f64>()) / count as f64;
                hold(&mut out, level * limit_a, rng.random_range(0.9..2.2));
            }
        }
        Programme::SlowRamps => {
            for share in [0.9, 0.5, 0.8] {
                sine(&mut out, share * limit_a, rng.random_range(14.0..20.0));
            }
        }
    }
    // Whole log intervals only.
    out.truncate(out.len() / crate::stand::TICKS_PER_ROW * crate::stand::TICKS_PER_ROW);
    out
}

fn ticks(seconds: f64) -> usize {
    (seconds / TICK_S).round() as usize
}

fn hold(out: &mut Vec<f64>, level: f64, seconds: f64) {
    // Five decimals, as the log prints them.
    out.extend(std::iter::repeat_n((level * 1e5).round() / 1e5, ticks(seconds)));
}

fn staircase(out: &mut Vec<f64>, limit: f64, count: usize, on_s: f64, rest_s: f64, rng: &mut impl Rng) {
    let mut levels: Vec<f64> =
        (1..=count).flat_map(|n| [n as f64, -(n as f64)]).map(|n| limit * n / count as f64).collect();
    levels.shuffle(rng);
    hold(out, 0.0, rest_s - 0.1 * f64::from(count == 5));
    for level in levels {
        hold(out, level, on_s);
        hold(out, 0.0, rest_s);
    }
}

fn random_holds(out: &mut Vec<f64>, limit: f64, seconds: f64, rng: &mut impl Rng) {
    let end = out.len() + ticks(seconds);
    while out.len() < end {
        let length = [0.08, 0.15, 0.3, 0.6, 1.2][rng.random_range(0..5)];
        hold(out, rng.random_range(-limit..limit), length);
    }
}

fn triangle(out: &mut Vec<f64>, top: f64, period_s: f64) {
    let count = ticks(period_s);
    out.extend((0..count).map(|tick| {
        let phase = tick as f64 / count as f64;
        let wave = if phase < 0.25 {
            4.0 * phase
        } else if phase < 0.75 {
            2.0 - 4.0 * phase
        } else {
            4.0 * phase - 4.0
        };
        (top * wave * 1e5).round() / 1e5
    }));
}

fn sine(out: &mut Vec<f64>, top: f64, period_s: f64) {
    let count = ticks(period_s);
    out.extend((0..count).map(|tick| {
        let phase = std::f64::consts::TAU * tick as f64 / count as f64;
        (top * phase.sin() * 1e5).round() / 1e5
    }));
}

fn reversals(out: &mut Vec<f64>, limit: f64, count: usize, rng: &mut impl Rng) {
    let mut sign = 1.0;
    for _ in 0..count {
        hold(out, sign * limit * rng.random_range(0.3..1.0), rng.random_range(0.6..2.0));
        sign = -sign;
    }
}
