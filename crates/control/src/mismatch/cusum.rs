//! What is usual of a residual, sums of what is not, and the threshold that a rate of false alarms asks for.

use super::channels::{Sign, WAYS};
use super::faults::Sides;
use super::{BLOCK_S, LEARNT};

/// Reference value of the CUSUM, standard deviations.
const REFERENCE: f64 = 0.75;
/// A block counts for no more than this, standard deviations: one bad block is no mismatch.
const CLIP: f64 = 4.0;
/// Farthest off that is told from still farther, standard deviations.
const FARTHEST: f64 = 1e3;
/// Least spread of each way of being off: what nobody would call a mismatch.
pub(super) const LEAST: [f64; WAYS] = [0.001, 0.01, 0.001, 0.1];

/// Mean and squared deviations of a residual (Welford 1962).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Usual {
    pub(super) n: u32,
    mean: f64,
    squares: f64,
    /// Mean of one over the excitation: the variance of noise that is there anyway goes with it.
    per_excitation: f64,
}

impl Usual {
    pub(super) fn take(&mut self, sign: Sign) {
        self.n += 1;
        let (n, off) = (f64::from(self.n), sign.value - self.mean);
        self.mean += off / n;
        self.squares += off * (sign.value - self.mean);
        self.per_excitation += (1.0 / sign.excitation - self.per_excitation) / n;
    }

    /// In standard deviations. Of a block that was driven less than usual the deviation is that of additive noise; of one driven
    /// more it stays, as part of what is usual goes with what is expected.
    pub(super) fn standardised(&self, sign: Sign, least: f64) -> f64 {
        let wider = (1.0 / (sign.excitation * self.per_excitation)).max(1.0).sqrt();
        ((sign.value - self.mean) / (self.spread(least) * wider)).clamp(-FARTHEST, FARTHEST)
    }

    pub(super) fn spread(&self, least: f64) -> f64 {
        (self.squares / f64::from(self.n.max(2) - 1)).sqrt().max(least)
    }
}

/// Blocks that what a residual is lately is averaged over: a minute of driving.
const LATELY: u32 = 30;

/// What a residual is lately: the mean of the first blocks, then an exponential one.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Lately {
    n: u32,
    mean: f64,
}

impl Lately {
    pub(super) fn take(&mut self, x: f64) {
        self.n = LATELY.min(self.n + 1);
        self.mean += (x - self.mean) / f64::from(self.n);
    }

    pub(super) fn mean(&self) -> Option<f64> {
        (self.n > 0).then_some(self.mean)
    }
}

/// When a sum last stood at zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Onset {
    /// Driven time since then, s: what the statistics count.
    pub(super) driven_s: f64,
    /// The monitor's clock then, s: what is told, for it goes on while nothing is driven.
    pub(super) at_s: f64,
}

/// Two-sided CUSUM with the time since it last stood at zero.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Cusum {
    sums: [f64; 2],
    onsets: [Onset; 2],
}

impl Cusum {
    /// Takes a block that began at `began_s` of the monitor's clock.
    pub(super) fn take(&mut self, z: f64, sides: Sides, most: f64, began_s: f64) {
        let both = [(0, 1.0), (1, -1.0)];
        for (side, sign) in both.into_iter().take(if sides == Sides::Both { 2 } else { 1 }) {
            let sum = self.sums[side] + sign * z.clamp(-CLIP, CLIP) - REFERENCE;
            self.sums[side] = sum.clamp(0.0, most);
            let onset = &mut self.onsets[side];
            if sum <= 0.0 {
                *onset = Onset::default();
            } else {
                // It stood at zero until this block was driven, however long nothing was before.
                onset.at_s = if onset.driven_s > 0.0 { onset.at_s } else { began_s };
                onset.driven_s += BLOCK_S;
            }
        }
    }

    /// An alarm on one side, since an onset that another sum has found.
    pub(super) fn fill(&mut self, side: usize, most: f64, onset: Onset) {
        *self = Self::default();
        (self.sums[side], self.onsets[side]) = (most, onset);
    }

    pub(super) fn level(&self) -> (f64, Onset) {
        let side = usize::from(self.sums[1] > self.sums[0]);
        (self.sums[side], self.onsets[side])
    }
}

/// The threshold, standard deviations, at which all CUSUMs together give that many false alarms a day.
pub fn threshold(alarms_per_day: f64, cusums: usize) -> f64 {
    let blocks_per_day = 86_400.0 / BLOCK_S;
    let run = 2.0 * cusums as f64 * blocks_per_day / alarms_per_day;
    let d = REFERENCE - 2.0 / f64::from(LEARNT).sqrt();
    let length = |h: f64| {
        let b = h + 1.166;
        ((2.0 * d * b).exp() - 2.0 * d * b - 1.0) / (2.0 * d * d)
    };
    let (mut low, mut high) = (0.0, 60.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if length(middle) < run { low = middle } else { high = middle }
    }
    high
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_threshold_rises_as_alarms_become_rarer() {
        let (often, rarely) = (threshold(1.0, 8), threshold(1.0 / 30.0, 8));
        assert!(often > 5.0 && rarely > often + 2.0 && rarely < 20.0, "{often} {rarely}");
    }

    #[test]
    fn a_block_that_was_hardly_driven_says_less() {
        let mut usual = Usual::default();
        (0..LEARNT)
            .for_each(|k| usual.take(Sign { value: if k % 2 == 0 { 0.01 } else { -0.01 }, excitation: 0.2 }));
        let off = |excitation| usual.standardised(Sign { value: 0.05, excitation }, 0.0);
        assert!((off(0.2) - 5.0).abs() < 0.05 && (off(0.2) - off(0.8)).abs() < 1e-9, "{}", off(0.2));
        assert!(
            (off(0.05) - 2.5).abs() < 0.05,
            "a quarter of the excitation, twice the spread: {}",
            off(0.05)
        );
    }

    #[test]
    fn an_onset_is_the_clock_when_the_block_began_that_the_sum_rose_in() {
        let mut cusum = Cusum::default();
        for (z, began_s) in [(2.0, 10.0), (0.0, 12.0), (0.0, 14.0), (2.0, 500.0), (2.0, 900.0)] {
            cusum.take(z, Sides::One, 9.0, began_s);
        }
        let onset = Onset { driven_s: 2.0 * BLOCK_S, at_s: 500.0 };
        assert_eq!(
            cusum.level(),
            (2.5, onset),
            "it fell to zero in between, and nothing was driven for 400 s since"
        );
    }

    /// Siegmund's approximation against a simulated CUSUM.
    #[test]
    fn the_run_length_is_that_of_a_simulated_cusum() {
        let (h, mut seed, mut total, runs) = (4.0, 1_u64, 0_u64, 400);
        let mut normal = || {
            // Sum of twelve uniforms: near enough to normal within four deviations.
            (0..12)
                .map(|_| {
                    seed =
                        seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
                    (seed >> 11) as f64 / (1_u64 << 53) as f64
                })
                .sum::<f64>()
                - 6.0
        };
        for _ in 0..runs {
            let mut sum = 0.0;
            while sum < h {
                sum = f64::max(0.0, sum + normal() - REFERENCE);
                total += 1;
            }
        }
        let (d, b) = (REFERENCE, h + 1.166);
        let expected = ((2.0 * d * b).exp() - 2.0 * d * b - 1.0) / (2.0 * d * d);
        let found = total as f64 / f64::from(runs);
        assert!((found / expected - 1.0).abs() < 0.3, "{found} {expected}");
    }
}
