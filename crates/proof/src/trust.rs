//! How far a set is trusted by the number of its names, read off cases with a known answer.
//!
//! A name that no rival comes near is stated as surely as its set is trusted, and that alone: what the catalogue does
//! not hold, and what was not fitted, may be right instead. How often it is shows only in answers.

use serde_json::Value;

use crate::score::{Claim, Scored};

/// A name that its set's trust alone keeps from certainty.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stated {
    /// Names in the likeliest set.
    pub names: usize,
    /// Share of the odds that its sets have, before trust.
    pub share: f64,
    /// It is right.
    pub right: bool,
}

/// From this share of the odds on a name has no rival to speak of.
const ALONE: f64 = 0.9;

/// Odds against a set of so many names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Law {
    /// The same for all.
    Same,
    /// As the number of names.
    Number,
    /// As its square.
    Square,
}

impl Law {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Same, Self::Number, Self::Square];

    /// Name for a table.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Same => "the same for all",
            Self::Number => "as the number",
            Self::Square => "as its square",
        }
    }

    /// Trust in a set of so many names under odds against one name alone.
    pub fn trust(self, names: usize, surprise: f64) -> f64 {
        let power = match self {
            Self::Same => 0,
            Self::Number => 1,
            Self::Square => 2,
        };
        1.0 / (1.0 + surprise * (names as f64).powi(power))
    }
}

/// Odds against one name that are tried.
pub const SURPRISES: [f64; 12] = [0.005, 0.01, 0.014, 0.02, 0.03, 0.04, 0.05, 0.06, 0.08, 0.1, 0.15, 0.2];

/// The names of one report that have no rival to speak of, as its trust in them was `trust`.
pub fn stated(scored: &Scored, report: &Value, trust: impl Fn(usize) -> f64) -> Vec<Stated> {
    let told = report["explanations"].as_array().and_then(|sets| sets.first());
    let names = told.and_then(|set| set["effects"].as_array()).map_or(0, Vec::len);
    let of = |claim: &Claim| Stated {
        names,
        share: (claim.probability / trust(names)).min(1.0),
        right: claim.right,
    };
    scored.claims.iter().map(of).filter(|stated| stated.share >= ALONE).collect()
}

/// Logarithmic score of names under a trust, at most zero.
pub fn score(all: &[Stated], trust: impl Fn(usize) -> f64) -> f64 {
    let of = |stated: &Stated| {
        let probability = stated.share * trust(stated.names);
        if stated.right { probability.ln() } else { (1.0 - probability).ln() }
    };
    all.iter().map(of).sum()
}

/// Numbers of names with how many were right and how many there were.
pub fn counted(all: &[Stated]) -> Vec<(usize, usize, usize)> {
    let mut sizes: Vec<usize> = all.iter().map(|stated| stated.names).collect();
    sizes.sort_unstable();
    sizes.dedup();
    let of = |size: usize| {
        let here = all.iter().filter(|stated| stated.names == size);
        (size, here.clone().filter(|stated| stated.right).count(), here.count())
    };
    sizes.into_iter().map(of).collect()
}

/// The law and the odds that score best.
pub fn best(all: &[Stated]) -> (Law, f64) {
    let tried = Law::ALL.into_iter().flat_map(|law| SURPRISES.map(|surprise| (law, surprise)));
    let worth = |(law, surprise): &(Law, f64)| score(all, |names| law.trust(names, *surprise));
    tried.max_by(|a, b| worth(a).total_cmp(&worth(b))).unwrap_or((Law::Number, SURPRISES[0]))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names of which so many are wrong, for sets of each size.
    fn names(wrong: &[(usize, usize, usize)]) -> Vec<Stated> {
        let of = |(names, wrong, all): &(usize, usize, usize)| {
            let (names, wrong) = (*names, *wrong);
            (0..*all).map(move |k| Stated { names, share: 1.0, right: k >= wrong })
        };
        wrong.iter().flat_map(of).collect()
    }

    #[test]
    fn the_law_that_wrong_names_follow_scores_best() {
        let (law, surprise) = best(&names(&[(1, 4, 104), (2, 14, 114), (4, 39, 139)]));
        assert_eq!((law, surprise), (Law::Square, 0.03), "odds of 0.04, 0.14, 0.39");
        let (law, surprise) = best(&names(&[(1, 10, 110), (2, 10, 110), (4, 10, 110)]));
        assert_eq!((law, surprise), (Law::Same, 0.1));
    }

    #[test]
    fn names_are_counted_by_how_many_stand_together() {
        assert_eq!(counted(&names(&[(2, 1, 3), (1, 0, 2)])), [(1, 2, 2), (2, 2, 3)]);
    }
}
