//! Test signals: what a command or an ambient flow does over time.

mod prepare;

use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::{ScenarioError, Segment};

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
    /// Of each segment a value out of range, or a replay that cannot be had; named as `field[index].key`.
    pub fn new(
        field: &str,
        segments: &[Segment],
        seed: u64,
        replays: &mut dyn Replays,
    ) -> Result<Self, Vec<ScenarioError>> {
        let (mut parts, mut wrong) = (Vec::with_capacity(segments.len()), Vec::new());
        let mut start = 0.0;
        for (i, segment) in segments.iter().enumerate() {
            let at = format!("{field}[{i}]");
            let random = ChaCha8Rng::seed_from_u64(seed.wrapping_add(i as u64 * 0x9e37_79b9));
            match segment.prepare(&at, random, replays) {
                Ok((duration_s, part)) => {
                    parts.push((start, part));
                    start += duration_s;
                }
                Err(error) => wrong.push(error),
            }
        }
        if wrong.is_empty() { Ok(Self { parts, duration_s: start }) } else { Err(wrong) }
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

#[cfg(test)]
mod tests {
    use super::*;

    fn signal(segments: &[Segment]) -> Excitation {
        Excitation::new("segments", segments, 1, &mut NoReplays).unwrap()
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
            |s: Segment| Excitation::new("segments", &[s], 1, &mut NoReplays).unwrap_err()[0].to_string();
        assert!(error(Segment::Hold { value: f64::NAN, duration_s: 1.0 }).contains("segments[0].value"));
        assert!(error(Segment::Hold { value: 1.0, duration_s: -1.0 }).contains("-1"));
        let prbs = Segment::Prbs { amplitude: 1.0, mean: 0.0, each_s: 0.1, order: 40, duration_s: 1.0 };
        assert!(error(prbs).contains("5 to 15"));
    }
}
