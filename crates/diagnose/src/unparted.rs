//! What the data alone do not part.
//!
//! Odds hold how common each effect is, and a common effect is likelier than a rare one that fits as well. Where that is all that
//! speaks for it, it has not been told from the other: a recording that could would have to be made.

use crate::flexible::is_term;
use crate::search::{Search, Set};

/// Evidence up to this many to one is "not worth more than a bare mention" (Jeffreys 1961, Theory of Probability, appendix B: the
/// root of ten).
const BARE_MENTION: f64 = 3.162_277_660_168_379_5;

/// Members of a set with what stands as well in their place by the data alone, whatever is more common. What needs more numbers
/// for that, or stands for it and another together, is no such rival: it holds the simpler effect within itself.
pub fn unparted(search: &Search, set: &Set) -> Vec<(&'static str, &'static str)> {
    let Some(best) = search.fits.get(set) else { return Vec::new() };
    let scale = 2.0 * search.temper();
    let by_data = |set: &Set| search.cost(set) / scale - search.rarity(set);
    let mut pairs = Vec::new();
    for (other, fit) in &search.fits {
        let only_in =
            |one: &Set, not: &Set| one.iter().copied().filter(|id| !not.contains(id)).collect::<Vec<_>>();
        let ([member], [rival]) = (&only_in(set, other)[..], &only_in(other, set)[..]) else { continue };
        let holds_it = search
            .descriptor(rival)
            .is_some_and(|effect| effect.same_as.iter().any(|same| same.contains(member)));
        let as_simple = fit.values.len() <= best.values.len() && !holds_it;
        let near = by_data(other) - by_data(set) <= BARE_MENTION.ln();
        if near && as_simple && !is_term(member) && !is_term(rival) {
            pairs.push((*member, *rival));
        }
    }
    pairs
}
