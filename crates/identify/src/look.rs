//! One more look for an effect: a round of the search, and whether its best name is to be believed.

use kort_thruster::effects::{Descriptor, ambient_flow_unsteady};

use crate::changes::is_change;
use crate::fit::Fit;
use crate::judge::{commanded, excess, mates};
use crate::library::is_term;
use crate::rules;
use crate::search::{Candidate, Round, Search, criterion};
use crate::verdict::kin;

/// What a look for one more effect came to.
pub(crate) struct Look {
    /// Fit without the effect, under the noise the best candidate leaves.
    pub before: Fit,
    /// Named candidates, best first.
    pub named: Vec<Candidate>,
    /// What the best of them gains.
    pub gain: f64,
    /// The best term without a name, if it is worth anything.
    pub term: Option<Candidate>,
    /// The leader's gain holds on left-out blocks.
    pub holds: bool,
    /// Error above the noise that the best name leaves, root mean square over full scale.
    pub leaves: f64,
    /// Why the best name is not believed.
    pub against: Option<&'static str>,
}

/// Looks for one more effect. Where much is left and nothing promises to explain it, once more under
/// white noise: noise learned from a fit that misses something forgives just that.
pub(crate) fn look(
    search: &mut Search,
    current: &mut Fit,
    so_far: f64,
    progress: &(dyn Fn(&str) + Sync),
) -> Option<Look> {
    let known = search.noise();
    let first = search.round(current, so_far).map(|round| weigh(search, round, so_far, progress));
    // A poor first name is looked at again as well; later ones are many, and beside changes in mid-run what
    // their times do not meet exactly is left.
    let effects = &current.hypothesis.effects;
    let first_of_all = effects.is_empty();
    let much = excess(&search.problem, current).1;
    let leaves = first.as_ref().map_or(much, |look| look.leaves);
    let promising = |look: &Look| !first_of_all || look.against.is_none() || look.term.is_some();
    let stands = first.as_ref().is_some_and(promising);
    let poor = first_of_all && leaves * leaves > rules::LOOK_AGAIN * much * much;
    let beside_changes = effects.iter().any(|e| is_change(e));
    if stands && !poor || beside_changes || much.min(leaves) < rules::REAL_EXCESS {
        return first;
    }
    progress("much is left: looking once more under white noise");
    let after = (search.noise(), current.clone());
    search.set_noise(known);
    search.problem.white_noise_of(current);
    *current = search.problem.fit(&current.resume(), &current.columns, 8);
    let second = search.round(current, 0.0).map(|round| weigh(search, round, 0.0, progress));
    let better = |look: &Look| {
        let clearly = look.leaves * look.leaves < rules::CHANGE_LEAVES * leaves * leaves;
        look.against.is_none() && (!stands || clearly)
    };
    if second.as_ref().is_some_and(better) {
        return second;
    }
    search.set_noise(after.0);
    *current = after.1;
    first
}

/// Whether the best name of a round is to be believed.
fn weigh(search: &Search, round: Round, so_far: f64, progress: &(dyn Fn(&str) + Sync)) -> Look {
    let (terms, named): (Vec<_>, Vec<_>) = round.candidates.into_iter().partition(|c| is_term(c.effect));
    let base = criterion(&round.before);
    let gain = named.first().map_or(0.0, |best| base - best.criterion);
    let list: Vec<String> =
        named.iter().take(4).map(|c| format!("{} {:.0}", c.effect.id, base - c.criterion)).collect();
    progress(&format!("candidates and what they gain: {}", list.join(", ")));
    let term = terms.into_iter().next().filter(|t| base - t.criterion > rules::BELIEVE);
    let of_term = term.as_ref().map_or(0.0, |t| base - t.criterion);
    let clear = round.size > rules::CLEAR_SIZE && commanded(&search.problem);
    let weighty = gain > rules::SHARE_OF_FIRST * so_far || clear;
    // What is free in time bends to any physics: it must do better than a term of two numbers.
    let free = named.first().is_some_and(|best| search.free_in_time(best.effect));
    let least = if free { of_term } else { rules::LEAST_OF_TERM * of_term };
    let like_turbulence = named.first().is_some_and(|best| looks_like_turbulence(best.effect));
    let believe = if like_turbulence { rules::BELIEVE_LIKE_TURBULENCE } else { rules::BELIEVE };
    let against = if gain > believe && weighty && gain > least && round.holds {
        None
    } else if round.size <= rules::LEAST_SIZE {
        Some("it is too small to matter")
    } else if !round.holds {
        Some("its gain does not hold on data left out of the fit")
    } else {
        Some("its gain is within the noise, or far below that of a term without a name")
    };
    let leaves = excess(&search.problem, named.first().map_or(&round.before, |best| &best.fit)).1;
    Look { before: round.before, named, gain, term, holds: round.holds, leaves, against }
}

/// Whether what was found last bends to whatever is left, freely with time or as a relative of what was
/// found at the blade before: a name sought on top of that would not be one to trust.
pub(crate) fn bends(search: &Search, rounds: &[Vec<Candidate>]) -> bool {
    let [first, .., last] = rounds else { return false };
    let (first, last) = (first[0].effect, last[0].effect);
    search.free_in_time(last) || kin(first, last)
}

/// Whether slow turbulence of the inflow, which no noise model takes up whole, looks like this effect.
fn looks_like_turbulence(effect: &Descriptor) -> bool {
    mates(effect, &ambient_flow_unsteady::DESCRIPTOR)
}
