//! The temper of the odds, fitted on some cases and tested on those left out.
//!
//! A diagnosis weighs sets of effects by `exp(-cost / (2 temper) - rarity)`. Costs assume that what is left is
//! noise; it is structure too, and differs by more than the truth behind it, and the more so the more there is to
//! explain. How much more is read off cases with a known answer: the temper under which the names that are right are
//! given most, and those that are wrong least (logarithmic score, Good 1952, J. R. Stat. Soc. B 14:107).

use std::collections::BTreeMap;

use kort_truth::Answer;
use serde_json::Value;

use crate::score::stands_for;

/// How far costs count as odds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Temper {
    /// Where little is explained.
    pub least: f64,
    /// What it grows to as a share of what the likeliest set costs less than the baseline.
    pub form_share: f64,
}

impl Temper {
    fn at(self, gain: f64) -> f64 {
        self.least.hypot(self.form_share * gain.max(0.0))
    }
}

/// Least tempers that are tried.
pub const LEAST_TEMPERS: [f64; 7] = [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 6.0];
/// Shares that are tried.
pub const FORM_SHARES: [f64; 6] = [0.0, 0.003, 0.006, 0.01, 0.02, 0.04];

/// Every temper that is tried.
pub fn tempers() -> impl Iterator<Item = Temper> {
    LEAST_TEMPERS.into_iter().flat_map(|least| FORM_SHARES.map(|form_share| Temper { least, form_share }))
}

/// Least probability that counts, so that one miss does not decide alone.
const LEAST: f64 = 1e-3;

/// What a name has to do with the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Standing {
    Hidden,
    /// Another name of the same physics, or of the recording's noise: neither right nor wrong.
    Akin,
    Wrong,
}

/// One case: its sets, and how each name stands to its answer.
#[derive(Clone, Debug)]
pub struct Weighed {
    /// Fold of the case.
    pub fold: usize,
    hidden: Vec<String>,
    /// Cost, rarity and names of every set.
    sets: Vec<(f64, f64, Vec<String>)>,
    standing: BTreeMap<String, Standing>,
}

impl Weighed {
    /// From a report that holds its `evidence`; none where it was refused.
    pub fn of(answer: &Answer, report: &Value, fold: usize) -> Option<Self> {
        let mut sets = Vec::new();
        for set in report["evidence"].as_array()? {
            let names = set["effects"].as_array()?.iter().filter_map(Value::as_str).map(str::to_owned);
            sets.push((set["cost"].as_f64()?, set["rarity"].as_f64()?, names.collect()));
        }
        let standing = |name: &str| {
            if answer.effects.iter().any(|hidden| hidden.effect == name) {
                Standing::Hidden
            } else if answer.effects.iter().any(|hidden| stands_for(name, hidden))
                || answer.noises.iter().any(|noise| noise.names.contains(&name))
                || name.starts_with("unknown_")
            {
                Standing::Akin
            } else {
                Standing::Wrong
            }
        };
        let names = sets.iter().flat_map(|(_, _, names): &(f64, f64, Vec<String>)| names);
        let standing = names.map(|name| (name.clone(), standing(name))).collect();
        let hidden = answer.effects.iter().map(|hidden| hidden.effect.clone()).collect();
        Some(Self { fold, hidden, sets, standing })
    }

    /// Probability of every name under a temper, each set as far as one of so many effects is trusted.
    pub fn names(&self, temper: Temper, trust: Trust) -> BTreeMap<&str, f64> {
        let least = self.sets.iter().map(|set| set.0).fold(f64::INFINITY, f64::min);
        let baseline = self.sets.iter().find(|set| set.2.is_empty()).map_or(least, |set| set.0);
        let temper = temper.at(baseline - least);
        let cost = |set: &(f64, f64, Vec<String>)| set.0 / (2.0 * temper) + set.1;
        let least = self.sets.iter().map(cost).fold(f64::INFINITY, f64::min);
        let weights: Vec<f64> = self.sets.iter().map(|set| (least - cost(set)).exp()).collect();
        let total: f64 = weights.iter().sum();
        let mut out = BTreeMap::new();
        for (set, weight) in self.sets.iter().zip(weights) {
            for name in &set.2 {
                *out.entry(name.as_str()).or_insert(0.0) += trust(set.2.len()) * weight / total;
            }
        }
        out
    }

    /// Logarithmic score, at most zero: of every name that any set holds, and of hidden ones that none does.
    pub fn score(&self, temper: Temper, trust: Trust) -> f64 {
        let names = self.names(temper, trust);
        let stated = |name: &str| names.get(name).copied().unwrap_or(0.0).min(1.0);
        let wrong = names.keys().filter(|name| self.standing.get(**name) == Some(&Standing::Wrong));
        let akin = self.standing.values().any(|standing| *standing == Standing::Akin);
        wrong.map(|name| (1.0 - stated(name)).max(LEAST).ln()).sum::<f64>()
            + self
                .hidden
                .iter()
                .filter(|name| names.contains_key(name.as_str()) || !akin)
                .map(|name| stated(name).max(LEAST).ln())
                .sum::<f64>()
    }
}

/// A temper's mean score over cases.
pub fn mean_score(cases: &[&Weighed], temper: Temper, trust: Trust) -> f64 {
    cases.iter().map(|case| case.score(temper, trust)).sum::<f64>() / cases.len().max(1) as f64
}

/// How far a set of so many effects is trusted.
pub type Trust<'a> = &'a dyn Fn(usize) -> f64;

/// The temper that scores best on some cases.
pub fn best(cases: &[&Weighed], trust: Trust) -> Temper {
    let scored = tempers().map(|temper| (mean_score(cases, temper, trust), temper));
    let first = Temper { least: LEAST_TEMPERS[0], form_share: FORM_SHARES[0] };
    scored.max_by(|a, b| a.0.total_cmp(&b.0)).map_or(first, |best| best.1)
}

/// A fold left out: the temper fitted on the others, its score here, and the built-in one's.
#[derive(Clone, Debug, PartialEq)]
pub struct LeftOut {
    /// The fold.
    pub fold: usize,
    /// Cases in it.
    pub cases: usize,
    /// Temper fitted on the other folds.
    pub temper: Temper,
    /// Its mean score on this fold.
    pub score: f64,
    /// Mean score here of the temper in use.
    pub in_use: f64,
}

/// Fits on all folds but one, and tests on that.
pub fn cross_validate(cases: &[Weighed], in_use: Temper, trust: Trust) -> Vec<LeftOut> {
    let folds: std::collections::BTreeSet<usize> = cases.iter().map(|case| case.fold).collect();
    folds
        .into_iter()
        .map(|fold| {
            let (here, others): (Vec<&Weighed>, Vec<&Weighed>) = cases.iter().partition(|c| c.fold == fold);
            let temper = best(&others, trust);
            LeftOut {
                fold,
                cases: here.len(),
                temper,
                score: mean_score(&here, temper, trust),
                in_use: mean_score(&here, in_use, trust),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const fn flat(least: f64) -> Temper {
        Temper { least, form_share: 0.0 }
    }

    /// Two sets: nothing, and one name that gains so much.
    fn case(fold: usize, gain: f64, right: bool) -> Weighed {
        let standing = if right { Standing::Hidden } else { Standing::Wrong };
        Weighed {
            fold,
            hidden: if right { vec!["a".into()] } else { Vec::new() },
            sets: vec![(0.0, 0.0, Vec::new()), (-gain, 3.0, vec!["a".into()])],
            standing: [("a".to_owned(), standing)].into(),
        }
    }

    #[test]
    fn probabilities_follow_cost_and_rarity() {
        let p = case(0, 10.0, true).names(flat(1.0), &|_| 1.0)["a"];
        assert!((p - 1.0 / (1.0 + (3.0_f64 - 5.0).exp())).abs() < 1e-12);
        let half = case(0, 10.0, true).names(Temper { least: 0.0, form_share: 0.2 }, &|_| 1.0)["a"];
        assert!(
            (half - 1.0 / (1.0 + (3.0_f64 - 2.5).exp())).abs() < 1e-12,
            "twice as far off where ten are gained"
        );
    }

    #[test]
    fn where_large_gains_are_wrong_half_the_time_the_best_temper_is_high() {
        let honest: Vec<Weighed> = (0..20).map(|k| case(k % 2, 30.0, true)).collect();
        let deceived: Vec<Weighed> = (0..20).map(|k| case(k % 2, 30.0, k % 4 < 2)).collect();
        let all = |cases: &[Weighed]| best(&cases.iter().collect::<Vec<_>>(), &|_| 0.99);
        let at = |temper: Temper| temper.at(30.0);
        assert!(at(all(&honest)) <= 2.0);
        assert!(at(all(&deceived)) >= 4.0);
        let left_out = cross_validate(&deceived, flat(1.0), &|_| 0.99);
        assert_eq!(left_out.iter().map(|l| l.cases).sum::<usize>(), 20);
        assert!(left_out.iter().all(|l| l.score > l.in_use), "{left_out:?}");
    }
}
