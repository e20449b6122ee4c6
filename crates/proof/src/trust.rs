//! How sure a name may be that no other comes near, read off cases with a known answer.
//!
//! What the catalogue does not hold, and what was not fitted, may be right in its place, and the likelier the less the
//! recordings cost more without it, and the more others stand with it. How likely shows only in answers.

use crate::temper::{Temper, Weighed, mean_score};

/// How doubt of a name falls with what it gains.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Doubt {
    /// The gain, for each name of a set, of odds of one to one.
    pub surprise: f64,
    /// The power with which odds fall.
    pub power: f64,
}

/// Odds against one of so many names that gains so much under a doubt: the diagnosis's own formula, which is handed in.
pub type Law<'a> = &'a dyn Fn(Doubt, usize, f64) -> f64;

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

/// Mean score of cases under a doubt.
pub fn score(cases: &[&Weighed], temper: Temper, doubt: Doubt, law: Law) -> f64 {
    mean_score(cases, temper, &|effects, gain| law(doubt, effects, gain))
}

/// The doubt that scores best on some cases.
pub fn best(cases: &[&Weighed], temper: Temper, law: Law) -> Doubt {
    let tried = POWERS.into_iter().flat_map(|power| SURPRISES.map(|surprise| Doubt { surprise, power }));
    let worth = |doubt: &Doubt| score(cases, temper, *doubt, law);
    let first = Doubt { surprise: SURPRISES[0], power: POWERS[0] };
    tried.max_by(|a, b| worth(a).total_cmp(&worth(b))).unwrap_or(first)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_counted_by_what_they_gain() {
        let counted = counted(&[(5.0, false), (20.0, true), (30.0, false), (1e9, true)]);
        let rows: Vec<(usize, usize)> = counted.iter().map(|row| (row.2, row.3)).collect();
        assert_eq!(rows, [(0, 1), (1, 2), (0, 0), (0, 0), (1, 1)]);
    }
}
