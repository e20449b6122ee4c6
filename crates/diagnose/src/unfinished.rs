//! Sets that leave more than noise.
//!
//! A learnt noise has no upper end: a set may leave nearly all of a mismatch and still cost least, since what is slow is few
//! facts. But what it leaves is no noise of sensors, so such a set is right only together with something that has no name,
//! and that has odds of its own before any data. A set with a term without a name has them counted already.

use std::collections::BTreeMap;

use rayon::prelude::*;

use crate::flexible::is_term;
use crate::left::leaves_more;
use crate::nameless::COMMONNESS;
use crate::posterior::Posterior;
use crate::search::{Search, Set};

/// Of sets that are less likely than this share of the likeliest it is not asked: whether they pay moves what is printed by a
/// few hundredths of itself.
const MATTERS: f64 = 0.01;

/// Negative log of the prior odds of what else must be there beside a set, for each set that leaves more than noise, of those
/// that are likely enough to matter.
pub fn unfinished(search: &Search, posterior: &Posterior) -> BTreeMap<Set, f64> {
    let likeliest = posterior.sets.first().map_or(0.0, |e| e.probability);
    let matters = posterior.sets.iter().take_while(|e| e.probability >= MATTERS * likeliest);
    let named: Vec<&Set> = matters.map(|e| e.set()).filter(|set| !set.iter().any(|id| is_term(id))).collect();
    let pays = |set: &&&Set| search.fits.get(**set).is_some_and(|fit| leaves_more(search.problem, fit));
    let more: Vec<&Set> = named.par_iter().filter(pays).copied().collect();
    more.into_iter().map(|set| (set.clone(), -COMMONNESS.ln())).collect()
}
