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

/// From this share of the odds on a name has no rival to speak of.
const ALONE: f64 = 0.9;

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

    /// Probability of every name under a temper: its sets against the others that were fitted, and against what was not,
    /// by `doubt` in the likeliest of its sets.
    pub fn names(&self, temper: Temper, doubt: Odds) -> BTreeMap<&str, f64> {
        let believed = self
            .presences(temper)
            .into_iter()
            .map(|(name, presence, (k, gain))| (name, presence / (1.0 + presence * doubt(k, gain))));
        believed.collect()
    }

    /// Every name with the share of the odds that its sets have; of the likeliest of them how many names it has, and what
    /// it gains by this one.
    fn presences(&self, temper: Temper) -> Vec<(&str, f64, (usize, f64))> {
        let least = self.sets.iter().map(|set| set.0).fold(f64::INFINITY, f64::min);
        let baseline = self.sets.iter().find(|set| set.2.is_empty()).map_or(least, |set| set.0);
        let temper = temper.at(baseline - least);
        let cost = |set: &(f64, f64, Vec<String>)| set.0 / (2.0 * temper) + set.1;
        let mut sets: Vec<&(f64, f64, Vec<String>)> = self.sets.iter().collect();
        sets.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        let Some(first) = sets.first().map(|set| cost(set)) else { return Vec::new() };
        let weights: Vec<f64> = sets.iter().map(|set| (first - cost(set)).exp()).collect();
        let total: f64 = weights.iter().sum();
        let mut out: Vec<(&str, f64, (usize, f64))> = Vec::new();
        for (set, weight) in sets.iter().zip(weights) {
            for name in &set.2 {
                match out.iter_mut().find(|known| known.0 == name) {
                    Some(known) => known.1 += weight / total,
                    None => out.push((name, weight / total, (set.2.len(), self.gain(set, name)))),
                }
            }
        }
        out
    }

    /// What a set's cost grows by without one of its names: to the least of the fitted sets of its others.
    fn gain(&self, set: &(f64, f64, Vec<String>), name: &str) -> f64 {
        let smaller = |other: &&(f64, f64, Vec<String>)| {
            other.2.iter().all(|other| *other != name && set.2.contains(other))
        };
        self.sets.iter().filter(smaller).map(|other| other.0 - set.0).fold(f64::INFINITY, f64::min)
    }

    /// Names that no other comes near, right or wrong: their gains for each name of their set, and whether they are right.
    pub fn without_rival(&self, temper: Temper) -> Vec<(f64, bool)> {
        let alone = self.presences(temper).into_iter().filter(|(_, presence, _)| *presence >= ALONE);
        alone
            .filter_map(|(name, _, (effects, gain))| match self.standing.get(name) {
                Some(Standing::Hidden) => Some((gain / effects as f64, true)),
                Some(Standing::Wrong) => Some((gain / effects as f64, false)),
                _ => None,
            })
            .collect()
    }

    /// Logarithmic score, at most zero: of every name that any set holds, and of hidden ones that none does.
    pub fn score(&self, temper: Temper, doubt: Odds) -> f64 {
        let names = self.names(temper, doubt);
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
pub fn mean_score(cases: &[&Weighed], temper: Temper, doubt: Odds) -> f64 {
    cases.iter().map(|case| case.score(temper, doubt)).sum::<f64>() / cases.len().max(1) as f64
}

/// Odds against a name by how many stand together and what they gain by it.
pub type Odds<'a> = &'a dyn Fn(usize, f64) -> f64;

/// The temper that scores best on some cases.
pub fn best(cases: &[&Weighed], doubt: Odds) -> Temper {
    let scored = tempers().map(|temper| (mean_score(cases, temper, doubt), temper));
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
pub fn cross_validate(cases: &[Weighed], in_use: Temper, doubt: Odds) -> Vec<LeftOut> {
    let folds: std::collections::BTreeSet<usize> = cases.iter().map(|case| case.fold).collect();
    folds
        .into_iter()
        .map(|fold| {
            let (here, others): (Vec<&Weighed>, Vec<&Weighed>) = cases.iter().partition(|c| c.fold == fold);
            let temper = best(&others, doubt);
            LeftOut {
                fold,
                cases: here.len(),
                temper,
                score: mean_score(&here, temper, doubt),
                in_use: mean_score(&here, in_use, doubt),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trust;

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
        let p = case(0, 10.0, true).names(flat(1.0), &|_, _| 0.0)["a"];
        assert!((p - 1.0 / (1.0 + (3.0_f64 - 5.0).exp())).abs() < 1e-12);
        let half = case(0, 10.0, true).names(Temper { least: 0.0, form_share: 0.2 }, &|_, _| 0.0)["a"];
        assert!(
            (half - 1.0 / (1.0 + (3.0_f64 - 2.5).exp())).abs() < 1e-12,
            "twice as far off where ten are gained"
        );
    }

    #[test]
    fn a_name_without_a_rival_is_as_sure_as_what_it_gains() {
        let sure = case(0, 300.0, true);
        let p = sure.names(flat(1.0), &|_, gain| 100.0 / gain)["a"];
        assert!((p - 0.75).abs() < 1e-9);
        assert_eq!(sure.without_rival(flat(1.0)), [(300.0, true)]);
        assert_eq!(case(0, 300.0, false).without_rival(flat(1.0)), [(300.0, false)]);
        assert!(case(0, 6.0, true).without_rival(flat(1.0)).is_empty(), "nothing hidden is as likely");
    }

    #[test]
    fn the_doubt_that_scores_best_is_even_where_half_the_names_are_wrong() {
        let mut cases: Vec<Weighed> = (0..20).map(|k| case(0, 30.0, k % 2 == 0)).collect();
        cases.extend((0..20).map(|_| case(0, 3000.0, true)));
        let law = |doubt: trust::Doubt, effects: usize, gain: f64| {
            (doubt.surprise * effects as f64 / gain).powf(doubt.power)
        };
        let all: Vec<&Weighed> = cases.iter().collect();
        let best = trust::best(&all, flat(1.0), &law);
        assert!((0.5..2.0).contains(&law(best, 1, 30.0)), "{best:?}");
        assert_eq!(
            trust::counted(&all.iter().flat_map(|c| c.without_rival(flat(1.0))).collect::<Vec<_>>())[1].3,
            20
        );
    }

    #[test]
    fn where_large_gains_are_wrong_half_the_time_the_best_temper_is_high() {
        let honest: Vec<Weighed> = (0..20).map(|k| case(k % 2, 30.0, true)).collect();
        let deceived: Vec<Weighed> = (0..20).map(|k| case(k % 2, 30.0, k % 4 < 2)).collect();
        let all = |cases: &[Weighed]| best(&cases.iter().collect::<Vec<_>>(), &|_, _| 0.01);
        let at = |temper: Temper| temper.at(30.0);
        assert!(at(all(&honest)) <= 2.0);
        assert!(at(all(&deceived)) >= 4.0);
        let left_out = cross_validate(&deceived, flat(1.0), &|_, _| 0.01);
        assert_eq!(left_out.iter().map(|l| l.cases).sum::<usize>(), 20);
        assert!(left_out.iter().all(|l| l.score > l.in_use), "{left_out:?}");
    }
}
