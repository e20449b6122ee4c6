//! From costs of sets to probabilities, of sets and of effects.

use std::collections::BTreeMap;

use crate::constants::PosteriorConstants;
use crate::flexible::is_term;
use crate::search::Set;

/// A set of effects as it was fitted.
#[derive(Clone, Debug, PartialEq)]
pub struct Fitted {
    /// The set; empty is the baseline alone.
    pub set: Set,
    /// What the recordings and its sizes cost it: twice the negative log of its evidence.
    pub alone: f64,
    /// Its cost with the prior odds of its members, and of what else must be there.
    pub cost: f64,
    /// Whether it leaves more than noise: then something without a name must be there.
    pub unfinished: bool,
}

/// A set of effects with what speaks for it.
#[derive(Clone, Debug, PartialEq)]
pub struct Explanation {
    /// The set with its costs.
    pub fitted: Fitted,
    /// Its probability among the sets that were fitted.
    pub probability: f64,
}

impl Explanation {
    /// Its effects.
    pub const fn set(&self) -> &Set {
        &self.fitted.set
    }
}

/// How far costs count as odds where the likeliest set costs so much less than the baseline. No form is exact, so costs
/// differ by more than the truth behind them, and the more there is to explain, the more of it is form.
pub fn temper(constants: &PosteriorConstants, gain: f64) -> f64 {
    constants.temper.hypot(constants.form_share * gain.max(0.0))
}

/// Odds that something which was not fitted is right in the place of one of so many effects, without which the recordings
/// cost so much more. Among what was fitted a difference of cost counts by its exponential; what an equation that nobody
/// wrote down would have taken of it is not bounded so, and dies off as a power only. It counts by the number of effects
/// that stand together: what the forms of the others leave passes for one more.
pub fn doubt(constants: &PosteriorConstants, effects: usize, gain: f64) -> f64 {
    (constants.surprise * effects as f64 / gain.max(LEAST_GAIN)).powf(constants.surprise_power)
}

/// Gains below this are none, whatever the data.
const LEAST_GAIN: f64 = 1.0;
/// Odds of one to one.
const EVEN: f64 = 1.0;

/// All sets that were fitted, likeliest first.
#[derive(Clone, Debug, PartialEq)]
pub struct Posterior {
    /// The sets.
    pub sets: Vec<Explanation>,
    constants: PosteriorConstants,
}

/// Sets less likely than this move no probability that is printed.
const LEAST_WEIGHT: f64 = 1e-9;

/// Sets of names that are right together, each with its probability, likeliest first.
#[derive(Clone, Debug, PartialEq)]
pub struct InPlace(pub Vec<(Set, f64)>);

impl InPlace {
    /// Probability of an effect: the sum over the sets that hold it. (A sum of no floats is -0.)
    pub fn probability(&self, effect: &str) -> f64 {
        self.0.iter().filter(|(set, _)| set.contains(&effect)).fold(0.0, |sum, (_, p)| sum + p)
    }
}

/// Whether names are stated less likely for what stands beside them and has no name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Beside {
    /// In a world that the catalogue holds.
    Nothing,
    /// In the world as it is: in sets that need a nameless term names count by a factor less.
    Terms,
    /// In all sets: the told one leaves more than noise can be.
    Everything,
}

/// What does as well stands within these odds: five to one part two names.
pub(crate) const NEAR: f64 = 0.2;

impl Posterior {
    /// Probabilities in proportion to `exp(-cost / (2 temper))`. What has no name stands in no name's place: where names do
    /// as well, sets that need it are no explanation.
    pub fn new(fitted: Vec<Fitted>, temper: f64, constants: &PosteriorConstants) -> Self {
        let mut all = Self::of_all(fitted, temper, constants);
        if !all.names_do_as_well(temper) {
            return all;
        }
        all.sets.retain(|e| !e.set().iter().any(|id| is_term(id)));
        Self::of_all(all.sets.into_iter().map(|e| e.fitted).collect(), temper, constants)
    }

    fn of_all(fitted: Vec<Fitted>, temper: f64, constants: &PosteriorConstants) -> Self {
        let least = fitted.iter().map(|f| f.cost).fold(f64::INFINITY, f64::min);
        let weight = |cost: f64| (-(cost - least) / (2.0 * temper)).exp();
        let total: f64 = fitted.iter().map(|f| weight(f.cost)).sum();
        let of = |fitted: Fitted| Explanation { probability: weight(fitted.cost) / total, fitted };
        let mut sets: Vec<Explanation> = fitted.into_iter().map(of).collect();
        sets.sort_by(|a, b| {
            (a.fitted.cost.total_cmp(&b.fitted.cost)).then_with(|| a.fitted.set.cmp(&b.fitted.set))
        });
        Self { sets, constants: *constants }
    }

    /// The set that is told: the likeliest, unless it needs what has no name and that is no likelier there than not. Then
    /// it is the likeliest that needs nothing without a name.
    pub fn told(&self) -> Option<&Explanation> {
        let likeliest = self.sets.first()?;
        let term = likeliest.set().iter().find(|id| is_term(id));
        if term.is_none_or(|term| self.presence(term) >= 0.5) { Some(likeliest) } else { self.named() }
    }

    /// The likeliest set that needs nothing without a name.
    fn named(&self) -> Option<&Explanation> {
        self.sets.iter().find(|e| !e.set().iter().any(|id| is_term(id)))
    }

    /// Whether what has no name stands in the place of names that the recordings alone do not part from it.
    fn names_do_as_well(&self, temper: f64) -> bool {
        let (Some(likeliest), Some(named)) = (self.sets.first(), self.named()) else { return false };
        let worse = named.fitted.alone - likeliest.fitted.alone;
        likeliest != named && !named.set().is_empty() && (-worse / (2.0 * temper)).exp() >= NEAR
    }

    /// Share that the sets which hold an effect have of all that were fitted.
    pub fn presence(&self, effect: &str) -> f64 {
        self.holding(effect).map(|e| e.probability).sum()
    }

    /// Which names are right together, likeliest first; the probabilities sum to one. In each set that was fitted something
    /// that was not may be right in the place of any member ([`doubt`]): the set then goes on without it. A set without
    /// names is none of them, or what nobody wrote down.
    pub fn in_place(&self, beside: Beside) -> InPlace {
        let mut sets: BTreeMap<Set, f64> = BTreeMap::new();
        let mut trusted: BTreeMap<&'static str, f64> = BTreeMap::new();
        for explanation in self.sets.iter().filter(|e| e.probability >= LEAST_WEIGHT) {
            let (terms, names): (Set, Set) = explanation.set().iter().partition(|id| is_term(id));
            let lowered = match beside {
                Beside::Nothing => false,
                Beside::Terms => !terms.is_empty(),
                Beside::Everything => true,
            };
            let factor = if lowered { self.constants.beside_unknown } else { 1.0 };
            let in_place: Vec<f64> = names
                .iter()
                .map(|id| factor * *trusted.entry(*id).or_insert_with(|| self.trust(id)))
                .collect();
            for out in 0..1_u32 << names.len() {
                let stays = |at: &usize| out >> at & 1 == 0;
                let odds = |at| if stays(&at) { in_place[at] } else { 1.0 - in_place[at] };
                let kept = (0..names.len()).filter(stays).map(|at| names[at]).chain(terms.iter().copied());
                let share = explanation.probability * (0..names.len()).map(odds).product::<f64>();
                *sets.entry(kept.collect()).or_default() += share;
            }
        }
        let mut sets: Vec<(Set, f64)> = sets.into_iter().collect();
        sets.sort_by(|a, b| b.1.total_cmp(&a.1));
        InPlace(sets)
    }

    /// Probability that an effect which a set holds is what stands there: what was not fitted is one more rival, beside all
    /// sets that hold the effect.
    fn trust(&self, effect: &str) -> f64 {
        let doubt = self.holding(effect).next().map_or(1.0, |e| self.doubt_in(e, effect));
        1.0 / (1.0 + self.presence(effect) * doubt)
    }

    fn holding(&self, effect: &str) -> impl Iterator<Item = &Explanation> {
        self.sets.iter().filter(move |e| e.set().contains(&effect))
    }

    /// Doubt of a set's member by what the recordings cost more without it: the least of what was fitted of the others.
    /// Where that leaves more than noise and the set does not, the cost does not tell what is gained: the odds are even then
    /// at the worst, as they are where none of the others was fitted.
    fn doubt_in(&self, explanation: &Explanation, member: &str) -> f64 {
        let Fitted { set, alone, unfinished, .. } = &explanation.fitted;
        let smaller = |e: &&Explanation| e.set().iter().all(|id| *id != member && set.contains(id));
        let others = self.sets.iter().filter(smaller).map(|e| &e.fitted);
        let Some(least) = others.min_by(|a, b| a.alone.total_cmp(&b.alone)) else { return EVEN };
        let doubt = doubt(&self.constants, set.len(), least.alone - alone);
        if least.unfinished && !unfinished { doubt.min(EVEN) } else { doubt }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn constants() -> PosteriorConstants {
        crate::constants::Constants::built_in().posterior
    }

    fn of(costs: &[(&[&'static str], f64)], temper: f64) -> Posterior {
        let all = costs.iter().map(|(set, cost)| fitted(set, *cost, false)).collect();
        Posterior::new(all, temper, &constants())
    }

    fn fitted(set: &[&'static str], cost: f64, unfinished: bool) -> Fitted {
        Fitted { set: set.to_vec(), alone: cost, cost, unfinished }
    }

    #[test]
    fn the_temper_is_the_least_where_little_is_explained_and_a_share_of_much() {
        let constants = constants();
        let (least, share) = (constants.temper, constants.form_share);
        assert_eq!(temper(&constants, -3.0), least, "a baseline that nothing betters");
        assert!((temper(&constants, 0.1 * least / share) / least - 1.0).abs() < 0.01);
        assert!((temper(&constants, 1e5) / (share * 1e5) - 1.0).abs() < 0.01);
    }

    #[test]
    fn doubt_is_even_at_the_surprise_and_falls_with_the_power() {
        let constants = PosteriorConstants { surprise: 50.0, surprise_power: 1.5, ..constants() };
        assert_eq!(doubt(&constants, 1, 50.0), 1.0);
        assert_eq!(doubt(&constants, 3, 150.0), 1.0);
        assert!((doubt(&constants, 1, 200.0) - 0.125).abs() < 1e-12);
        assert_eq!(doubt(&constants, 1, -3.0), doubt(&constants, 1, 0.0), "a loss is no gain");
    }

    #[test]
    fn equal_sets_share_and_a_far_one_has_nothing() {
        let all = of(&[(&["a"], 10.0), (&["b"], 10.0), (&[], 1e4)], 3.0);
        assert!((all.presence("a") - 0.5).abs() < 1e-9 && (all.presence("b") - 0.5).abs() < 1e-9);
        assert!(all.sets[2].probability < 1e-12);
        assert_eq!(
            (all.in_place(Beside::Nothing).probability("c"), all.in_place(Beside::Terms).probability("c")),
            (0.0, 0.0),
            "what was not fitted"
        );
    }

    #[test]
    fn what_has_no_name_is_told_where_it_is_likelier_there_than_not() {
        let at = |cost: f64| of(&[(&["unknown_x"], 0.0), (&[], cost), (&["a"], cost)], 3.0);
        assert!(at(0.5).told().unwrap().set().is_empty());
        assert_eq!(*at(60.0).told().unwrap().set(), ["unknown_x"]);
        assert_eq!(of(&[], 3.0).told(), None);
    }

    #[test]
    fn what_has_no_name_stands_in_no_name_s_place() {
        let at = |worse: f64| of(&[(&["unknown_x"], 0.0), (&["a"], worse), (&[], 900.0)], 3.0);
        assert_eq!(*at(6.0).told().unwrap().set(), ["a"], "odds of e to one");
        assert!(at(6.0).in_place(Beside::Nothing).probability("a") > 0.9, "and is not doubted for it");
        assert_eq!(*at(12.0).told().unwrap().set(), ["unknown_x"], "of seven to one");
    }

    #[test]
    fn without_a_rival_a_name_is_as_sure_as_what_leaving_it_out_costs() {
        let surprise = constants().surprise;
        let without = |gain: f64| of(&[(&["a", "b"], 0.0), (&["a"], gain), (&["b"], 1e5), (&[], 1e6)], 1.0);
        let even = without(2.0 * surprise);
        assert!(
            (even.in_place(Beside::Nothing).probability("b") - 0.5).abs() < 1e-6,
            "one to one at twice the surprise of one"
        );
        assert!(even.in_place(Beside::Nothing).probability("a") > 0.999, "each by its own");
        assert!(without(4.0 * surprise).in_place(Beside::Nothing).probability("b") > 0.7);
        assert!(without(surprise).in_place(Beside::Nothing).probability("b") < 0.3);
        let sets = even.in_place(Beside::Nothing).0;
        assert_eq!(sets[0].0.len() + sets[1].0.len(), 3, "both, or the sure one alone: {sets:?}");
        assert!((sets[0].1 - 0.5).abs() < 1e-3 && (sets.iter().map(|s| s.1).sum::<f64>() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn a_rival_and_the_doubt_are_not_counted_as_one_factor_each() {
        let surprise = constants().surprise;
        let two = of(&[(&["a"], 0.0), (&["b"], 0.0), (&[], surprise)], 1.0);
        assert!(
            (two.in_place(Beside::Nothing).probability("a") - 1.0 / 3.0).abs() < 1e-3,
            "a, b and what was not fitted"
        );
    }

    #[test]
    fn beside_a_nameless_term_a_name_is_stated_lower() {
        let factor = constants().beside_unknown;
        let all = of(&[(&["a", "unknown_x"], 0.0), (&["unknown_x"], 1e4), (&["a"], 1e4), (&[], 1e5)], 1.0);
        assert!(
            (all.in_place(Beside::Terms).probability("a")
                - factor * all.in_place(Beside::Nothing).probability("a"))
            .abs()
                < 1e-9
        );
    }

    #[test]
    fn where_nothing_smaller_stands_the_odds_are_even() {
        let all = of(&[(&["a"], 0.0), (&["b"], 90.0)], 1.0);
        assert!((all.in_place(Beside::Nothing).probability("a") - 0.5).abs() < 1e-9);
    }

    #[test]
    fn where_the_smaller_set_leaves_more_than_noise_the_odds_are_even_at_the_worst() {
        let at = |gain: f64, unfinished: bool, both: bool| {
            let all = vec![fitted(&["a"], 0.0, both), Fitted { cost: 90.0, ..fitted(&[], gain, unfinished) }];
            Posterior::new(all, 1.0, &constants()).in_place(Beside::Nothing).probability("a")
        };
        assert!((at(2.0, true, false) - 0.5).abs() < 1e-9);
        assert!(at(2.0, false, false) < 0.1 && at(2.0, true, true) < 0.1);
        assert!(at(300.0, true, false) > 0.9, "what is gained all the same counts");
    }
}
