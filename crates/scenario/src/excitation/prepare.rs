//! From a segment as written to a part of the signal, or to what is wrong with it.

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::{EDGE_S, Part, Replays};
use crate::{ScenarioError, Segment};

/// Longest prepared sequence: a scenario of a day at 100 Hz.
const MOST_LEVELS: f64 = 1e7;

impl Segment {
    /// Checks the segment and makes of it a length, s, and a part of the signal.
    pub(super) fn prepare(
        &self,
        at: &str,
        mut random: ChaCha8Rng,
        replays: &mut dyn Replays,
    ) -> Result<(f64, Part), ScenarioError> {
        let check = Check { at };
        match self {
            Segment::Hold { value, duration_s } => {
                check.finite("value", *value)?;
                check.positive("duration_s", *duration_s)?;
                Ok((*duration_s, levels(vec![*value], *duration_s)))
            }
            Segment::Steps { values, each_s } => {
                check.positive("each_s", *each_s)?;
                if values.is_empty() {
                    return Err(check.fail("values", "an empty list", "at least one number"));
                }
                values.iter().try_for_each(|v| check.finite("values", *v))?;
                Ok((values.len() as f64 * each_s, levels(values.clone(), *each_s)))
            }
            Segment::Staircase { from, to, levels: n, each_s } => {
                check.finite("from", *from)?;
                check.finite("to", *to)?;
                check.positive("each_s", *each_s)?;
                check.between("levels", f64::from(*n), 2.0, 1e6)?;
                let step = (to - from) / f64::from(n - 1);
                let values: Vec<f64> = (0..*n).map(|i| from + step * f64::from(i)).collect();
                Ok((f64::from(*n) * each_s, levels(values, *each_s)))
            }
            Segment::Ramp { from, to, duration_s } => {
                check.finite("from", *from)?;
                check.finite("to", *to)?;
                check.positive("duration_s", *duration_s)?;
                Ok((*duration_s, Part::Lines { times_s: vec![0.0, *duration_s], values: vec![*from, *to] }))
            }
            Segment::Reversals { amplitude, each_s, count } => {
                check.finite("amplitude", *amplitude)?;
                check.positive("each_s", *each_s)?;
                check.between("count", f64::from(*count), 1.0, 1e6)?;
                let side = |i: u32| if i.is_multiple_of(2) { *amplitude } else { -amplitude };
                Ok((f64::from(count + 1) * each_s, levels((0..=*count).map(side).collect(), *each_s)))
            }
            Segment::Sine { amplitude, mean, frequency_hz, duration_s } => {
                check.finite("amplitude", *amplitude)?;
                check.finite("mean", *mean)?;
                check.positive("frequency_hz", *frequency_hz)?;
                check.positive("duration_s", *duration_s)?;
                Ok((*duration_s, Part::Tones { mean: *mean, tones: vec![(*amplitude, *frequency_hz, 0.0)] }))
            }
            Segment::Chirp { amplitude, mean, from_hz, to_hz, duration_s } => {
                check.finite("amplitude", *amplitude)?;
                check.finite("mean", *mean)?;
                check.positive("from_hz", *from_hz)?;
                check.positive("to_hz", *to_hz)?;
                check.positive("duration_s", *duration_s)?;
                let octaves_per_s = (to_hz / from_hz).log2() / duration_s;
                let part =
                    Part::Chirp { mean: *mean, amplitude: *amplitude, from_hz: *from_hz, octaves_per_s };
                Ok((*duration_s, part))
            }
            Segment::Multisine { amplitude, mean, from_hz, to_hz, tones, duration_s } => {
                check.finite("amplitude", *amplitude)?;
                check.finite("mean", *mean)?;
                check.positive("from_hz", *from_hz)?;
                check.positive("to_hz", *to_hz)?;
                check.positive("duration_s", *duration_s)?;
                check.between("tones", f64::from(*tones), 2.0, 1000.0)?;
                Ok((*duration_s, multisine(*amplitude, *mean, *from_hz, *to_hz, *tones, *duration_s)))
            }
            Segment::Prbs { amplitude, mean, each_s, order, duration_s } => {
                check.finite("amplitude", *amplitude)?;
                check.finite("mean", *mean)?;
                check.positive("each_s", *each_s)?;
                check.positive("duration_s", *duration_s)?;
                check.between("duration_s / each_s", duration_s / each_s, 1.0, MOST_LEVELS)?;
                let Some(taps) = order.checked_sub(5).and_then(|i| TAPS.get(i as usize)) else {
                    return Err(check.fail("order", order, "5 to 15"));
                };
                let mut register = random.random_range(1..1_u32 << order);
                let n = (duration_s / each_s - EDGE_S).ceil() as usize;
                let values = (0..n)
                    .map(|_| mean + if shift(&mut register, *order, taps) { *amplitude } else { -amplitude });
                Ok((*duration_s, levels(values.collect(), *each_s)))
            }
            Segment::RandomLevels { low, high, shortest_s, longest_s, duration_s } => {
                check.finite("low", *low)?;
                check.finite("high", *high)?;
                check.positive("shortest_s", *shortest_s)?;
                check.positive("duration_s", *duration_s)?;
                check.between("high", *high, *low, f64::MAX)?;
                check.between("longest_s", *longest_s, *shortest_s, f64::MAX)?;
                check.between("duration_s / shortest_s", duration_s / shortest_s, 1.0, MOST_LEVELS)?;
                let (mut times_s, mut values, mut now) = (Vec::new(), Vec::new(), 0.0);
                while now < *duration_s {
                    times_s.push(now);
                    values.push(low + (high - low) * random.random::<f64>());
                    now += shortest_s + (longest_s - shortest_s) * random.random::<f64>();
                }
                Ok((*duration_s, Part::Levels { times_s, values }))
            }
            Segment::Points { points } => {
                points.iter().flatten().try_for_each(|v| check.finite("points", *v))?;
                let rising = points.windows(2).all(|w| w[1][0] > w[0][0]);
                if points.len() < 2 || !rising || points[0][0] != 0.0 {
                    return Err(check.fail(
                        "points",
                        format!("{} pairs", points.len()),
                        "at least two pairs [time, value], times rising from 0",
                    ));
                }
                let (times_s, values): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
                Ok((times_s[times_s.len() - 1], Part::Lines { times_s, values }))
            }
            Segment::Replay { recording, column, columns, from_s, duration_s, scale } => {
                check.finite("scale", *scale)?;
                check.between("from_s", *from_s, 0.0, f64::MAX)?;
                let whole = replays
                    .column(recording, column, columns.as_deref())
                    .map_err(|message| ScenarioError::Replay { at: at.into(), message })?;
                let first = whole.time_s.partition_point(|t| *t < *from_s);
                let Some(last) = whole.time_s.last().filter(|_| first + 1 < whole.time_s.len()) else {
                    let end = whole.time_s.last().copied().unwrap_or(0.0);
                    return Err(check.fail(
                        "from_s",
                        from_s,
                        &format!("below {end}, where the recording ends"),
                    ));
                };
                let start = whole.time_s[first];
                let length = duration_s.unwrap_or(last - start);
                check.positive("duration_s", length)?;
                let times_s = whole.time_s[first..].iter().map(|t| t - start).collect();
                let values = whole.values[first..].iter().map(|v| v * scale).collect();
                Ok((length, Part::Levels { times_s, values }))
            }
        }
    }
}

fn levels(values: Vec<f64>, each_s: f64) -> Part {
    Part::Levels { times_s: (0..values.len()).map(|i| i as f64 * each_s).collect(), values }
}

fn multisine(amplitude: f64, mean: f64, from_hz: f64, to_hz: f64, n: u32, duration_s: f64) -> Part {
    let count = f64::from(n);
    let mut tones: Vec<(f64, f64, f64)> = (0..n)
        .map(|i| {
            let k = f64::from(i);
            let hz = from_hz * (to_hz / from_hz).powf(k / (count - 1.0));
            // Schroeder 1970: phases that spread the peaks.
            (1.0, hz, -std::f64::consts::PI * k * (k + 1.0) / count)
        })
        .collect();
    let part = Part::Tones { mean: 0.0, tones: tones.clone() };
    let samples = ((duration_s * from_hz.max(to_hz) * 20.0).ceil() as u64).clamp(100, 1_000_000);
    let step = duration_s / samples as f64;
    let peak = (0..=samples).map(|i| part.value(i as f64 * step).abs()).fold(f64::MIN_POSITIVE, f64::max);
    tones.iter_mut().for_each(|t| t.0 = amplitude / peak);
    Part::Tones { mean, tones }
}

/// Feedback taps of maximum-length shift registers of order 5 to 15 (Golomb, Shift Register
/// Sequences, 1967).
const TAPS: [&[u32]; 11] = [
    &[5, 3],
    &[6, 5],
    &[7, 6],
    &[8, 6, 5, 4],
    &[9, 5],
    &[10, 7],
    &[11, 9],
    &[12, 11, 10, 4],
    &[13, 12, 11, 8],
    &[14, 13, 12, 2],
    &[15, 14],
];

fn shift(register: &mut u32, order: u32, taps: &[u32]) -> bool {
    let bit = taps.iter().fold(0, |sum, tap| sum ^ (*register >> (tap - 1)) & 1);
    *register = (*register << 1 | bit) & ((1 << order) - 1);
    bit == 1
}

/// Names a field in errors.
struct Check<'a> {
    at: &'a str,
}

impl Check<'_> {
    fn fail(&self, key: &str, found: impl std::fmt::Display, allowed: &str) -> ScenarioError {
        ScenarioError::Value {
            key: format!("{}.{key}", self.at),
            found: found.to_string(),
            allowed: allowed.into(),
        }
    }

    fn finite(&self, key: &str, value: f64) -> Result<(), ScenarioError> {
        if value.is_finite() { Ok(()) } else { Err(self.fail(key, value, "a finite number")) }
    }

    fn positive(&self, key: &str, value: f64) -> Result<(), ScenarioError> {
        if value.is_finite() && value > 0.0 {
            Ok(())
        } else {
            Err(self.fail(key, value, "a finite number above 0"))
        }
    }

    fn between(&self, key: &str, value: f64, low: f64, high: f64) -> Result<(), ScenarioError> {
        if value >= low && value <= high {
            return Ok(());
        }
        let allowed = if high == f64::MAX { format!("{low} or more") } else { format!("{low} to {high}") };
        Err(self.fail(key, value, &allowed))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn registers_have_maximum_length() {
        for (i, taps) in TAPS.iter().enumerate() {
            let order = i as u32 + 5;
            let mut register = 1;
            let mut length = 0_u32;
            loop {
                shift(&mut register, order, taps);
                length += 1;
                if register == 1 {
                    break;
                }
            }
            assert_eq!(length, (1 << order) - 1, "order {order}");
        }
    }
}
