//! Excitations: values between -1 and 1 a tick, times what a machine is driven by.

use std::f64::consts::TAU;

use crate::dice::Dice;

/// Kind of excitation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Excitation {
    /// Staircase, random levels, slow triangles, reversals: all that a patient bench does.
    Full,
    /// Holds at many levels, both signs, with rests between.
    Staircase,
    /// A few steps of several sizes, both ways.
    Steps,
    /// Levels at random for random times.
    RandomLevels,
    /// Two levels at random times.
    Binary,
    /// A sine whose frequency rises.
    Chirp,
    /// Several sines at once.
    Multisine,
    /// One or two sines.
    Sine,
    /// Slow triangles.
    Ramps,
    /// Holds at one sign, never back to rest.
    OneSided,
    /// Very slow sines, both signs: nowhere a corner.
    SlowSines,
    /// One level, held.
    OneSpeed,
}

impl Excitation {
    /// What a case may draw.
    pub const DRAWN: [Excitation; 9] = [
        Excitation::Full,
        Excitation::Staircase,
        Excitation::Steps,
        Excitation::RandomLevels,
        Excitation::Binary,
        Excitation::Chirp,
        Excitation::Multisine,
        Excitation::Sine,
        Excitation::Ramps,
    ];

    /// Every size and both ways are in it, at rest and in motion.
    pub fn rich(self) -> bool {
        matches!(
            self,
            Excitation::Full | Excitation::Staircase | Excitation::RandomLevels | Excitation::Steps
        )
    }
}

/// A list of shares of the largest command, one a tick of `tick_s`, for about `seconds`.
///
/// `quick_s` is the time in which the machine answers: holds last a few of it, sines begin at a
/// fraction of its inverse.
pub fn shares(kind: Excitation, seconds: f64, quick_s: f64, tick_s: f64, dice: &mut Dice) -> Vec<f64> {
    let mut line = Line { values: Vec::new(), tick_s };
    let end = (seconds / tick_s) as usize;
    match kind {
        Excitation::Full => {
            line.staircase(5, 6.0 * quick_s, 2.5 * quick_s, 0.3 * seconds, dice);
            line.levels(0.55 * seconds, quick_s, dice);
            line.triangle(0.6, 0.18 * seconds);
            line.triangle(0.15, 0.06 * seconds);
            line.reversals(end, quick_s, dice);
        }
        Excitation::Staircase => line.staircase(9, 8.0 * quick_s, 3.0 * quick_s, seconds, dice),
        Excitation::Steps => {
            while line.values.len() < end {
                line.hold(0.0, dice.between(1.0, 3.0) * quick_s);
                line.hold(
                    dice.side() * dice.pick(&[0.2, 0.4, 0.6, 0.8, 1.0]),
                    dice.between(5.0, 9.0) * quick_s,
                );
            }
        }
        Excitation::RandomLevels => line.levels(seconds, quick_s, dice),
        Excitation::Binary => {
            let (top, centre) = (dice.between(0.3, 0.8), dice.pick(&[0.0, 0.0, 0.2]));
            while line.values.len() < end {
                line.hold(centre + dice.side() * top, dice.pick(&[0.3, 0.6, 1.2, 2.4]) * quick_s);
            }
        }
        Excitation::Chirp => {
            let (top, low) = (dice.between(0.5, 0.95), 0.03 / quick_s);
            let high = low * dice.between(20.0, 60.0);
            let rate = (high / low).ln() / seconds;
            line.wave(end, |t| top * (TAU * low * ((rate * t).exp() - 1.0) / rate).sin());
        }
        Excitation::Multisine => {
            let tones: Vec<(f64, f64)> = (0..dice.index(5) + 4)
                .map(|_| (dice.log_between(0.03, 1.2) / quick_s, dice.between(0.0, TAU)))
                .collect();
            let top = dice.between(0.6, 1.0) / (tones.len() as f64).sqrt() / 1.3;
            line.wave(end, |t| {
                top * tones.iter().map(|(hz, phase)| (TAU * hz * t + phase).sin()).sum::<f64>()
            });
        }
        Excitation::Sine => {
            let (low, high) = (dice.log_between(0.04, 0.1) / quick_s, dice.log_between(0.1, 0.5) / quick_s);
            let (top, more) = (dice.between(0.5, 0.8), dice.pick(&[0.0, 0.15, 0.2]));
            line.wave(end, |t| top * (TAU * low * t).sin() + more * (TAU * high * t).sin());
        }
        Excitation::Ramps => {
            while line.values.len() < end {
                line.triangle(dice.pick(&[0.2, 0.5, 0.8, 1.0]), dice.between(15.0, 40.0) * quick_s);
            }
        }
        Excitation::OneSided => {
            while line.values.len() < end {
                line.hold(dice.between(0.35, 1.0), dice.between(4.0, 9.0) * quick_s);
            }
        }
        Excitation::OneSpeed => line.hold(dice.between(0.4, 0.9), seconds),
        Excitation::SlowSines => {
            while line.values.len() < end {
                let (top, period) = (dice.pick(&[0.9, 0.5, 0.8]), dice.between(70.0, 90.0) * quick_s);
                line.wave((period / tick_s) as usize, |t| top * (TAU * t / period).sin());
            }
        }
    }
    line.values.truncate(end);
    line.values
}

struct Line {
    values: Vec<f64>,
    tick_s: f64,
}

impl Line {
    fn hold(&mut self, level: f64, seconds: f64) {
        let ticks = (seconds / self.tick_s).round().max(1.0) as usize;
        self.values.extend(std::iter::repeat_n(level.clamp(-1.0, 1.0), ticks));
    }

    fn wave(&mut self, ticks: usize, at: impl Fn(f64) -> f64) {
        self.values.extend((0..ticks).map(|tick| at(tick as f64 * self.tick_s).clamp(-1.0, 1.0)));
    }

    /// Both signs of `count` levels in a random order, with rests; shortened to fit into `most_s`.
    fn staircase(&mut self, count: usize, on_s: f64, rest_s: f64, most_s: f64, dice: &mut Dice) {
        let mut levels: Vec<f64> = (1..=count).flat_map(|n| [n as f64, -(n as f64)]).collect();
        dice.shuffle(&mut levels);
        let fit = (most_s / (2.0 * count as f64 * (on_s + rest_s))).min(1.0);
        self.hold(0.0, rest_s * fit);
        for level in levels {
            self.hold(level / count as f64, on_s * fit);
            self.hold(0.0, rest_s * fit);
        }
    }

    fn levels(&mut self, seconds: f64, quick_s: f64, dice: &mut Dice) {
        let end = self.values.len() + (seconds / self.tick_s) as usize;
        while self.values.len() < end {
            let length = dice.pick(&[0.3, 0.6, 1.2, 2.5, 5.0]) * quick_s;
            self.hold(dice.between(-1.0, 1.0), length);
        }
    }

    fn triangle(&mut self, top: f64, period_s: f64) {
        let ticks = (period_s / self.tick_s) as usize;
        self.wave(ticks, |t| {
            let phase = (t / period_s).min(1.0);
            top * if phase < 0.25 {
                4.0 * phase
            } else if phase < 0.75 {
                2.0 - 4.0 * phase
            } else {
                4.0 * phase - 4.0
            }
        });
    }

    fn reversals(&mut self, end: usize, quick_s: f64, dice: &mut Dice) {
        let mut sign = 1.0;
        while self.values.len() < end {
            self.hold(sign * dice.between(0.3, 1.0), dice.between(2.5, 8.0) * quick_s);
            sign = -sign;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_kind_fills_its_time_within_the_limits(seed in 0u64..500, which in 0usize..9) {
            let kind = Excitation::DRAWN[which];
            let list = shares(kind, 20.0, 0.25, 0.002, &mut Dice::new(seed, 1));
            prop_assert!(list.iter().all(|share| share.abs() <= 1.0));
            prop_assert!(list.len() > 5000 && list.len() <= 10_000, "{kind:?}: {}", list.len());
            let top = list.iter().fold(0.0, |top: f64, share| top.max(share.abs()));
            prop_assert!(top > 0.1, "{kind:?} hardly drives: {top}");
        }
    }
}
