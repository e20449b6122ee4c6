//! Test signals: what a command or an ambient flow does over time.

use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::ScenarioError;

/// One stretch of a signal. Values are in the unit of the signal it belongs to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Segment {
    /// One value.
    Hold {
        /// The value.
        value: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Values one after the other.
    Steps {
        /// The values.
        values: Vec<f64>,
        /// How long each is held, s.
        each_s: f64,
    },
    /// Equal steps from one value to another, both included.
    Staircase {
        /// First level.
        from: f64,
        /// Last level.
        to: f64,
        /// Number of levels.
        levels: u32,
        /// How long each is held, s.
        each_s: f64,
    },
    /// A straight line.
    Ramp {
        /// Value at the start.
        from: f64,
        /// Value at the end.
        to: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Full ahead, full astern, and so on.
    Reversals {
        /// Size of both.
        amplitude: f64,
        /// How long each is held, s.
        each_s: f64,
        /// Number of reversals; one more level than that.
        count: u32,
    },
    /// A sine.
    Sine {
        /// Amplitude.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Frequency, Hz.
        frequency_hz: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// A sine whose frequency rises evenly in octaves a second.
    Chirp {
        /// Amplitude.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Frequency at the start, Hz.
        from_hz: f64,
        /// Frequency at the end, Hz.
        to_hz: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Sines of equal size, evenly spaced in octaves, with Schroeder's phases (low peaks), scaled
    /// so that their sum stays within the amplitude.
    Multisine {
        /// Largest size of the sum.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Lowest frequency, Hz.
        from_hz: f64,
        /// Highest frequency, Hz.
        to_hz: f64,
        /// Number of sines.
        tones: u32,
        /// How long, s.
        duration_s: f64,
    },
    /// Pseudo-random binary sequence of maximum length.
    Prbs {
        /// Size of both levels about the mean.
        amplitude: f64,
        /// Mean.
        #[serde(default)]
        mean: f64,
        /// Shortest time between changes, s.
        each_s: f64,
        /// Length of the shift register, 5 to 15: the sequence repeats after `2^order - 1` steps.
        #[serde(default = "order")]
        order: u32,
        /// How long, s.
        duration_s: f64,
    },
    /// Random levels held for random times: sees gains and lags over the whole range.
    RandomLevels {
        /// Smallest level.
        low: f64,
        /// Largest level.
        high: f64,
        /// Shortest hold, s.
        shortest_s: f64,
        /// Longest hold, s.
        longest_s: f64,
        /// How long, s.
        duration_s: f64,
    },
    /// Points over time, straight lines between them.
    Points {
        /// Pairs of time since the segment's start [s] and value, times rising.
        points: Vec<[f64; 2]>,
    },
    /// A column of a recording.
    Replay {
        /// File, or name of a shipped recording.
        recording: String,
        /// Column, after the map.
        column: String,
        /// Column map for a foreign log.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        columns: Option<String>,
        /// Where to begin in the recording, s after its first row.
        #[serde(default)]
        from_s: f64,
        /// How long, s; to the recording's end if left out.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        duration_s: Option<f64>,
        /// Factor on the values.
        #[serde(default = "one")]
        scale: f64,
    },
}

fn order() -> u32 {
    9
}

fn one() -> f64 {
    1.0
}

/// A replayed column: instants (from zero) and values.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Replayed {
    /// Instants, s, rising, the first is zero.
    pub time_s: Vec<f64>,
    /// Values; each is held to the next instant.
    pub values: Vec<f64>,
}

/// Finds the recording of a [`Segment::Replay`]; opening files is the caller's part.
pub trait Replays {
    /// The column from `from_s` on, without NaN.
    ///
    /// # Errors
    /// The recording or the column cannot be had; in words for the user.
    fn column(&mut self, recording: &str, column: &str, columns: Option<&str>) -> Result<Replayed, String>;
}

/// No recording can be replayed.
pub struct NoReplays;

impl Replays for NoReplays {
    fn column(&mut self, recording: &str, _: &str, _: Option<&str>) -> Result<Replayed, String> {
        Err(format!("{recording}: recordings cannot be replayed here"))
    }
}

/// A prepared signal.
#[derive(Clone, Debug, Default)]
pub struct Excitation {
    parts: Vec<(f64, Part)>,
    duration_s: f64,
}

#[derive(Clone, Debug)]
enum Part {
    Levels { times_s: Vec<f64>, values: Vec<f64> },
    Lines { times_s: Vec<f64>, values: Vec<f64> },
    Tones { mean: f64, tones: Vec<(f64, f64, f64)> },
    Chirp { mean: f64, amplitude: f64, from_hz: f64, octaves_per_s: f64 },
}

/// Instants this close to an edge are past it: a tick's time is a product, the edge a decimal.
const EDGE_S: f64 = 1e-9;

impl Excitation {
    /// Prepares the segments, one after the other. Random ones follow from `seed`.
    ///
    /// # Errors
    /// A value out of range, or a replay that cannot be had; named as `field[index].key`.
    pub fn new(
        field: &str,
        segments: &[Segment],
        seed: u64,
        replays: &mut dyn Replays,
    ) -> Result<Self, ScenarioError> {
        let mut parts = Vec::with_capacity(segments.len());
        let mut start = 0.0;
        for (i, segment) in segments.iter().enumerate() {
            let at = format!("{field}[{i}]");
            let random = ChaCha8Rng::seed_from_u64(seed.wrapping_add(i as u64 * 0x9e37_79b9));
            let (duration_s, part) = segment.prepare(&at, random, replays)?;
            parts.push((start, part));
            start += duration_s;
        }
        Ok(Self { parts, duration_s: start })
    }

    /// Sum of the segments, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Largest size it reaches, over samples `period_s` apart.
    pub fn peak(&self, period_s: f64) -> f64 {
        let n = (self.duration_s / period_s).ceil().min(1e7) as u64;
        (0..=n).map(|i| self.value(i as f64 * period_s).abs()).fold(0.0, f64::max)
    }

    /// Value at a time; after the last segment its last value, zero without segments.
    pub fn value(&self, time_s: f64) -> f64 {
        let next = self.parts.partition_point(|(start, _)| *start <= time_s + EDGE_S);
        let Some((start, part)) = next.checked_sub(1).and_then(|i| self.parts.get(i)) else { return 0.0 };
        let end = self.parts.get(next).map_or(self.duration_s, |p| p.0);
        part.value((time_s - start).clamp(0.0, end - start))
    }
}

impl Part {
    fn value(&self, t: f64) -> f64 {
        match self {
            Part::Levels { times_s, values } => {
                let next = times_s.partition_point(|at| *at <= t + EDGE_S);
                values[next.saturating_sub(1)]
            }
            Part::Lines { times_s, values } => {
                let next = times_s.partition_point(|at| *at <= t);
                if next == 0 {
                    return values[0];
                }
                let Some(b) = times_s.get(next) else { return values[next - 1] };
                let a = times_s[next - 1];
                values[next - 1] + (values[next] - values[next - 1]) * (t - a) / (b - a)
            }
            Part::Tones { mean, tones } => {
                let tau = std::f64::consts::TAU;
                mean + tones.iter().map(|(size, hz, phase)| size * (tau * hz * t + phase).sin()).sum::<f64>()
            }
            Part::Chirp { mean, amplitude, from_hz, octaves_per_s } => {
                // Phase is the integral of f0 2^(k t).
                let turns = if *octaves_per_s == 0.0 {
                    from_hz * t
                } else {
                    from_hz * ((octaves_per_s * t).exp2() - 1.0) / (octaves_per_s * std::f64::consts::LN_2)
                };
                mean + amplitude * (std::f64::consts::TAU * turns).sin()
            }
        }
    }
}

/// Longest prepared sequence: a scenario of a day at 100 Hz.
const MOST_LEVELS: f64 = 1e7;

impl Segment {
    fn prepare(
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

    fn signal(segments: &[Segment]) -> Excitation {
        Excitation::new("segments", segments, 1, &mut NoReplays).unwrap()
    }

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

    #[test]
    fn segments_follow_each_other_and_edges_are_sharp() {
        let s = signal(&[
            Segment::Hold { value: 1.0, duration_s: 0.3 },
            Segment::Ramp { from: 0.0, to: 2.0, duration_s: 1.0 },
            Segment::Reversals { amplitude: 5.0, each_s: 1.0, count: 1 },
        ]);
        assert_eq!(s.duration_s(), 3.3);
        assert_eq!(s.value(0.299), 1.0);
        assert!(s.value(3.0 * 0.1).abs() < 1e-12);
        assert!((s.value(0.8) - 1.0).abs() < 1e-12);
        assert_eq!((s.value(1.3), s.value(2.3), s.value(99.0)), (5.0, -5.0, -5.0));
        assert_eq!(s.peak(0.01), 5.0);
    }

    #[test]
    fn a_multisine_keeps_within_its_amplitude_and_a_chirp_reaches_its_end() {
        let s = signal(&[Segment::Multisine {
            amplitude: 3.0,
            mean: 1.0,
            from_hz: 0.1,
            to_hz: 5.0,
            tones: 20,
            duration_s: 20.0,
        }]);
        let peak = (0..40_000).map(|i| (s.value(f64::from(i) * 5e-4) - 1.0).abs()).fold(0.0, f64::max);
        assert!((2.9..3.05).contains(&peak), "{peak}");
        let c = signal(&[Segment::Chirp {
            amplitude: 1.0,
            mean: 0.0,
            from_hz: 0.1,
            to_hz: 10.0,
            duration_s: 10.0,
        }]);
        // Zero crossings in the last tenth of a second at about 10 Hz: two.
        let crossings = (0..1000)
            .map(|i| 9.9 + f64::from(i) * 1e-4)
            .filter(|t| c.value(*t) * c.value(t + 1e-4) < 0.0)
            .count();
        assert!((1..=3).contains(&crossings), "{crossings}");
    }

    #[test]
    fn random_ones_follow_from_the_seed() {
        let make = |seed| {
            let segments = [Segment::RandomLevels {
                low: -1.0,
                high: 1.0,
                shortest_s: 0.1,
                longest_s: 1.0,
                duration_s: 30.0,
            }];
            let s = Excitation::new("s", &segments, seed, &mut NoReplays).unwrap();
            (0..300).map(|i| s.value(f64::from(i) * 0.1)).collect::<Vec<_>>()
        };
        assert_eq!(make(1), make(1));
        assert_ne!(make(1), make(2));
        assert!(make(1).iter().all(|v| v.abs() <= 1.0));
    }

    #[test]
    fn wrong_values_are_named() {
        let error =
            |s: Segment| Excitation::new("segments", &[s], 1, &mut NoReplays).unwrap_err().to_string();
        assert!(error(Segment::Hold { value: f64::NAN, duration_s: 1.0 }).contains("segments[0].value"));
        assert!(error(Segment::Hold { value: 1.0, duration_s: -1.0 }).contains("-1"));
        let prbs = Segment::Prbs { amplitude: 1.0, mean: 0.0, each_s: 0.1, order: 40, duration_s: 1.0 };
        assert!(error(prbs).contains("5 to 15"));
    }
}
