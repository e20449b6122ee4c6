//! How sure a name may be that no other comes near, read off cases with a known answer.
//!
//! What the catalogue does not hold, and what was not fitted, may be right in its place, and the likelier the less the
//! recordings cost more without it, and the more others stand with it. How likely shows only in answers.

use crate::temper::{Temper, Weighed, mean_score};

/// Odds against a name: one to one where leaving it out costs `surprise` for each name of its set, falling with a power of
/// that.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubt {
    /// The gain of odds of one to one.
    pub surprise: f64,
    /// The power.
    pub power: f64,
}

impl Doubt {
    /// Odds against one of so many names that gains so much.
    pub fn odds(self, effects: usize, gain: f64) -> f64 {
        (self.surprise * effects as f64 / gain.max(1.0)).powf(self.power)
    }
}

/// Gains of even odds that are tried.
pub const SURPRISES: [f64; 7] = [5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 40.0];
/// Powers that are tried.
pub const POWERS: [f64; 4] = [0.7, 1.0, 1.5, 2.0];

/// Bounds of the gains, for each name of a set, by which names are counted.
const GAINS: [f64; 6] = [0.0, 20.0, 40.0, 80.0, 160.0, f64::INFINITY];

/// Names without a rival by what they gain for each of their set: from, to, how many were right, and how many there were.
pub fn counted(names: &[(f64, bool)]) -> Vec<(f64, f64, usize, usize)> {
    let of = |bounds: &[f64]| {
        let here = names.iter().filter(|(gain, _)| (bounds[0]..bounds[1]).contains(gain));
        (bounds[0], bounds[1], here.clone().filter(|(_, right)| *right).count(), here.count())
    };
    GAINS.windows(2).map(of).collect()
}

/// The doubt that scores best on some cases.
pub fn best(cases: &[&Weighed], temper: Temper) -> Doubt {
    let tried = POWERS.into_iter().flat_map(|power| SURPRISES.map(|surprise| Doubt { surprise, power }));
    let worth = |doubt: &Doubt| mean_score(cases, temper, &|effects, gain| doubt.odds(effects, gain));
    let first = Doubt { surprise: SURPRISES[0], power: POWERS[0] };
    tried.max_by(|a, b| worth(a).total_cmp(&worth(b))).unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odds_are_even_at_the_surprise_and_fall_with_the_power() {
        let doubt = Doubt { surprise: 50.0, power: 1.5 };
        assert_eq!(doubt.odds(1, 50.0), 1.0);
        assert_eq!(doubt.odds(3, 150.0), 1.0);
        assert!((doubt.odds(1, 200.0) - 0.125).abs() < 1e-12);
        assert!(doubt.odds(1, -3.0) == doubt.odds(1, 0.0), "a loss is no gain");
    }

    #[test]
    fn names_are_counted_by_what_they_gain() {
        let counted = counted(&[(5.0, false), (20.0, true), (30.0, false), (1e9, true)]);
        let rows: Vec<(usize, usize)> = counted.iter().map(|row| (row.2, row.3)).collect();
        assert_eq!(rows, [(0, 1), (1, 2), (0, 0), (0, 0), (1, 1)]);
    }
}
