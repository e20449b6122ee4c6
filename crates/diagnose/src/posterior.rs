//! From costs of sets to probabilities, of sets and of effects.

use crate::constants::PosteriorConstants;
use crate::flexible::is_term;
use crate::search::Set;

/// A set of effects with what speaks for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The set; empty is the baseline alone.
    pub set: Set,
    /// Its cost: twice the negative log of evidence and prior.
    pub cost: f64,
    /// Its probability.
    pub probability: f64,
}

/// How far a set of so many effects may be believed if it is the likeliest by far. What was not fitted may be right
/// in the place of each: the odds against it grow as their number.
pub fn trusted(effects: usize, surprise: f64) -> f64 {
    1.0 / (1.0 + surprise * effects as f64)
}

/// How far costs count as odds where the likeliest set costs so much less than the baseline. No form is exact, so costs
/// differ by more than the truth behind them, and the more there is to explain, the more of it is form.
pub fn temper(constants: &PosteriorConstants, gain: f64) -> f64 {
    constants.temper.hypot(constants.form_share * gain.max(0.0))
}

/// Probabilities of sets, likeliest first: in proportion to `exp(-cost / (2 temper))`, as far as each may be [`trusted`].
pub fn posterior(costs: Vec<(Set, f64)>, temper: f64, surprise: f64) -> Vec<Explanation> {
    let least = costs.iter().map(|c| c.1).fold(f64::INFINITY, f64::min);
    let weight = |cost: f64| (-(cost - least) / (2.0 * temper)).exp();
    let total: f64 = costs.iter().map(|c| weight(c.1)).sum();
    let mut all: Vec<Explanation> = costs
        .into_iter()
        .map(|(set, cost)| {
            let probability = trusted(set.len(), surprise) * weight(cost) / total;
            Explanation { set, cost, probability }
        })
        .collect();
    all.sort_by(|a, b| {
        b.probability
            .total_cmp(&a.probability)
            .then(a.cost.total_cmp(&b.cost))
            .then_with(|| a.set.cmp(&b.set))
    });
    all
}

/// The set that is told: the likeliest, unless it needs what has no name and that is no likelier there than not. Then it
/// is the likeliest that needs nothing without a name.
pub fn told(explanations: &[Explanation]) -> Option<&Explanation> {
    let likeliest = explanations.first()?;
    let term = likeliest.set.iter().find(|id| is_term(id));
    if term.is_none_or(|term| presence(explanations, term, 1.0) >= 0.5) {
        return Some(likeliest);
    }
    explanations.iter().find(|e| !e.set.iter().any(|id| is_term(id)))
}

/// Probability that an effect is present: the sum over the sets that hold it, those that need a nameless term
/// counted by `beside_unknown`.
pub fn presence(explanations: &[Explanation], effect: &str, beside_unknown: f64) -> f64 {
    explanations
        .iter()
        .filter(|e| e.set.contains(&effect))
        .map(
            |e| {
                if e.set.iter().any(|id| is_term(id)) {
                    beside_unknown * e.probability
                } else {
                    e.probability
                }
            },
        )
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_temper_is_the_least_where_little_is_explained_and_a_share_of_much() {
        let constants = crate::constants::Constants::built_in().posterior;
        let (least, share) = (constants.temper, constants.form_share);
        assert_eq!(temper(&constants, -3.0), least, "a baseline that nothing betters");
        assert!((temper(&constants, 0.1 * least / share) / least - 1.0).abs() < 0.01);
        assert!((temper(&constants, 1e5) / (share * 1e5) - 1.0).abs() < 0.01);
    }

    #[test]
    fn equal_sets_share_and_a_far_one_has_nothing() {
        let costs = vec![(vec!["a"], 10.0), (vec!["b"], 10.0), (vec![], 500.0)];
        let all = posterior(costs, 3.0, 0.04);
        assert!((presence(&all, "a", 0.7) - 0.5 / 1.04).abs() < 1e-12);
        assert!((presence(&all, "b", 0.7) - 0.5 / 1.04).abs() < 1e-12);
        assert!(all[2].probability < 1e-12);
    }

    #[test]
    fn what_has_no_name_is_told_where_it_is_likelier_there_than_not() {
        let at = |cost: f64| {
            posterior(vec![(vec!["unknown_x"], 0.0), (vec![], cost), (vec!["a"], cost)], 3.0, 0.03)
        };
        assert_eq!(told(&at(0.5)).unwrap().set, Set::new());
        assert_eq!(told(&at(60.0)).unwrap().set, ["unknown_x"]);
        assert_eq!(told(&[]), None);
    }

    #[test]
    fn an_effect_in_every_likely_set_is_as_sure_as_all_of_them() {
        let costs = vec![(vec!["a", "b"], 0.0), (vec!["a", "c"], 1.0), (vec!["a"], 60.0)];
        let all = posterior(costs, 3.0, 0.03);
        assert!((presence(&all, "a", 0.7) - 1.0 / 1.06).abs() < 1e-3, "as two may be trusted");
        assert!(presence(&all, "b", 0.7) > presence(&all, "c", 0.7));
    }
}
