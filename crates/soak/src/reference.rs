//! References over time, from a seed.

use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::scenario::Segment;

/// A recorded column, ready to be replayed: times from zero, shares of the largest thrust.
#[derive(Clone, Debug, Default)]
pub struct Replayed {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Share of the largest thrust.
    pub share: Vec<f64>,
}

/// Plays the segments one after the other, for ever.
pub struct Player<'a> {
    segments: &'a [Segment],
    replayed: &'a [Option<Replayed>],
    random: ChaCha8Rng,
    index: usize,
    since_s: f64,
    /// Two first-order stages of the DP filter.
    stages: [f64; 2],
    update_s: f64,
    value: f64,
    /// Where the stick goes; where a ramp began.
    target: f64,
    hold_s: f64,
    cursor: usize,
}

/// Period at which DP and joystick give a new value, s.
const PERIOD_S: f64 = 0.1;

impl<'a> Player<'a> {
    /// From the first segment.
    pub fn new(segments: &'a [Segment], replayed: &'a [Option<Replayed>], random: ChaCha8Rng) -> Self {
        Self {
            segments,
            replayed,
            random,
            index: 0,
            since_s: 0.0,
            stages: [0.0; 2],
            update_s: 0.0,
            value: 0.0,
            target: 0.0,
            hold_s: 0.0,
            cursor: 0,
        }
    }

    /// Share of the largest thrust now; then time goes on by `dt_s`.
    pub fn next(&mut self, dt_s: f64) -> f64 {
        if self.since_s + 1e-9 >= self.length_s() {
            self.index = (self.index + 1) % self.segments.len();
            (self.since_s, self.update_s, self.hold_s, self.cursor) = (0.0, 0.0, 0.0, 0);
        }
        let now = self.since_s;
        self.since_s += dt_s;
        match &self.segments[self.index] {
            Segment::Steps { levels, hold_s, ramp_s } => {
                let place = ((now / hold_s + 1e-9) as usize).min(levels.len() - 1);
                if now + 1e-9 >= self.update_s {
                    self.update_s = (place + 1) as f64 * hold_s;
                    self.target = self.value;
                }
                let since = now - place as f64 * hold_s;
                let part = if *ramp_s > 0.0 { (since / ramp_s).clamp(0.0, 1.0) } else { 1.0 };
                self.value = self.target + (levels[place] - self.target) * part;
            }
            Segment::Sine { amplitude, offset, period_s, .. } => {
                self.value = offset + amplitude * (std::f64::consts::TAU * now / period_s).sin();
            }
            &Segment::Dp { mean, std, time_s, .. } => {
                if now + 1e-9 >= self.update_s {
                    self.update_s += PERIOD_S;
                    self.dp(mean, std, time_s);
                }
            }
            &Segment::Joystick { amplitude, .. } => {
                if now + 1e-9 >= self.update_s {
                    self.update_s += PERIOD_S;
                    self.joystick(amplitude);
                }
            }
            Segment::Replay { .. } => {
                if let Some(replayed) = &self.replayed[self.index] {
                    while self.cursor + 1 < replayed.time_s.len()
                        && replayed.time_s[self.cursor + 1] <= now + 1e-9
                    {
                        self.cursor += 1;
                    }
                    self.value = replayed.share[self.cursor];
                }
            }
        }
        self.value.clamp(-1.0, 1.0)
    }

    fn length_s(&self) -> f64 {
        match &self.segments[self.index] {
            Segment::Steps { levels, hold_s, .. } => levels.len() as f64 * hold_s,
            Segment::Sine { for_s, .. } | Segment::Dp { for_s, .. } | Segment::Joystick { for_s, .. } => {
                *for_s
            }
            Segment::Replay { .. } => self.replayed[self.index]
                .as_ref()
                .and_then(|r| r.time_s.last().copied())
                .unwrap_or(PERIOD_S)
                .max(PERIOD_S),
        }
    }

    /// White noise through two equal first-order stages, scaled to the asked standard deviation.
    fn dp(&mut self, mean: f64, std: f64, time_s: f64) {
        let keep = (-PERIOD_S / time_s).exp();
        let white: f64 = StandardNormal.sample(&mut self.random);
        self.stages[0] = keep * self.stages[0] + (1.0 - keep) * white;
        self.stages[1] = keep * self.stages[1] + (1.0 - keep) * self.stages[0];
        // Variance of two equal stages under unit white noise.
        let k2 = keep * keep;
        let variance = (1.0 - keep).powi(4) * (1.0 + k2) / (1.0 - k2).powi(3);
        self.value = mean + std * self.stages[1] / variance.sqrt();
    }

    fn joystick(&mut self, amplitude: f64) {
        self.hold_s -= PERIOD_S;
        if self.hold_s <= 0.0 {
            self.hold_s = self.random.random_range(0.5..6.0);
            self.target = match self.random.random_range(0..10) {
                0 | 1 => 0.0,
                2 => -self.target,
                _ => amplitude * self.random.random_range(-1.0..1.0),
            };
        }
        // A thumb moves the stick across in a third of a second.
        let most = 2.0 * amplitude * PERIOD_S / 0.33;
        self.value += (self.target - self.value).clamp(-most, most);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;

    fn play(segment: Segment, seconds: f64) -> Vec<f64> {
        let segments = [segment];
        let mut player = Player::new(&segments, &[None], ChaCha8Rng::seed_from_u64(3));
        (0..(seconds / 0.01) as usize).map(|_| player.next(0.01)).collect()
    }

    #[test]
    fn dp_has_the_asked_mean_and_spread() {
        let values = play(Segment::Dp { mean: 0.3, std: 0.15, time_s: 1.0, for_s: 1e6 }, 20_000.0);
        let n = values.len() as f64;
        let mean = values.iter().sum::<f64>() / n;
        let std = (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n).sqrt();
        assert!((mean - 0.3).abs() < 0.02 && (std - 0.15).abs() < 0.015, "{mean} {std}");
    }

    #[test]
    fn steps_repeat_from_the_start() {
        let values = play(Segment::Steps { levels: vec![0.5, -0.5], hold_s: 1.0, ramp_s: 0.0 }, 4.0);
        assert_eq!((values[50], values[150], values[250], values[350]), (0.5, -0.5, 0.5, -0.5));
    }

    #[test]
    fn a_stick_stays_in_its_gate() {
        assert!(
            play(Segment::Joystick { amplitude: 0.7, for_s: 1e6 }, 600.0)
                .iter()
                .all(|v| v.abs() <= 0.7 + 1e-12)
        );
    }
}
