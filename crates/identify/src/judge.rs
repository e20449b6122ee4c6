//! From rounds of the search to findings: who is believed, who is a rival, who is set aside.

use std::collections::BTreeMap;

use kort_thruster::effects::Descriptor;
use rayon::prelude::*;

use crate::baseline::{Member, members, recompose};
use crate::changes;
use crate::data::{Driving, Series, available};
use crate::errors;
use crate::fit::{Columns, Fit, Hypothesis, Problem};
use crate::library::is_term;
use crate::look::{bends, look};
use crate::refit::{TIMING, amends, cost, unscreened};
use crate::rules;
use crate::search::{Candidate, Search, criterion};

/// One place in the explanation: an effect, and those that would do as well.
#[derive(Clone)]
pub struct Place {
    /// The effect that stands in the final fit.
    pub chosen: &'static Descriptor,
    /// Named rivals this recording cannot exclude, best first: effect, distance, values.
    pub rivals: Vec<(Member, f64)>,
    /// Others that were tried: effect and distance in the criterion.
    pub aside: Vec<(&'static Descriptor, f64)>,
    /// Fall of the criterion that this place brings.
    pub gain: f64,
}

/// The outcome of a search.
pub struct Outcome {
    /// Baseline alone, under the final noise.
    pub baseline: Fit,
    /// Everything that was found, fitted together.
    pub last: Fit,
    /// One place an effect found.
    pub places: Vec<Place>,
    /// Best candidate that was not believed, and why.
    pub doubt: Option<(&'static Descriptor, f64, &'static str)>,
    /// Error above the noise that nothing explains: channel, root mean square over full scale.
    pub excess: Option<(&'static str, f64)>,
    /// Changes in mid-run that were found might act here as well: term, distance in the criterion.
    pub elsewhere: Option<(&'static Descriptor, f64)>,
}

/// Margin within which two explanations cannot be told apart.
pub fn margin(gain: f64) -> f64 {
    rules::MARGIN.max(rules::MARGIN_SHARE * gain)
}

/// Whether the catalogue says that two effects are confused.
pub fn mates(a: &Descriptor, b: &Descriptor) -> bool {
    a.confused_with.contains(&b.id) || b.confused_with.contains(&a.id)
}

/// Distance within which an effect cannot be told from the one chosen: wider for effects that the
/// catalogue knows to be confused.
pub fn near(place: &Place, other: &Descriptor) -> f64 {
    let chosen = place.chosen;
    let limit = margin(place.gain);
    if mates(chosen, other) { limit.max(rules::MATES_SHARE * place.gain) } else { limit }
}

/// Runs the search to its end. `progress` is told what is going on.
///
/// Named effects are searched alone first. Terms without a name then judge the result: one that
/// does better than the names, or as well as several of them together, shows that the physics
/// is not in the catalogue.
pub fn run(
    search: &mut Search,
    start: &crate::fit::Hypothesis,
    series: &[Series],
    progress: &(dyn Fn(&str) + Sync),
) -> Outcome {
    progress("fitting the baseline");
    let mut current = search.baseline(start);
    let offered = available(search.problem.model, series, &search.problem.recordings);
    search.try_columns(series, &mut current, &offered);
    let (named, poor) = names(search, current, Vec::new(), progress);
    let left = excess(&search.problem, &named.last).1;
    // One switch found as a term is looked at again where several changes are weighed by path.
    let switched = named.places.iter().any(|p| p.chosen.id.ends_with("_switched"));
    if left < rules::REAL_EXCESS && !switched {
        return named;
    }
    // Much is left: did something change in mid-run? Slow noise learned without it hides it.
    progress("looking for changes in mid-run");
    let saved = search.noise();
    if let Some(found) = changes::find(search, &named.baseline, &offered) {
        let now = excess(&search.problem, &found.fit).1;
        let may_leave = if switched { rules::CHANGE_FOR_SWITCH } else { rules::CHANGE_LEAVES };
        if now * now < may_leave * left * left {
            let gain = criterion(&found.before) - criterion(&found.fit);
            let change = Candidate {
                effect: found.effect,
                criterion: criterion(&found.fit),
                fit: found.fit,
                screened: gain,
            };
            let rival = found.rival;
            let (outcome, _) = names(search, change.fit.clone(), vec![vec![change]], progress);
            return Outcome { elsewhere: rival, ..outcome };
        }
    }
    search.set_noise(saved);
    if poor {
        progress("the names leave too much: looking for a term without a name");
        let known = search.noise();
        let nameless = nameless(search, &named.baseline, &named.places);
        // Names that explain most stand where no term explains more.
        let floor = floor(&search.problem, &named.last);
        let left = |fit: &Fit| excesses(&search.problem, fit, &floor).iter().map(|e| e.1).sum::<f64>();
        if let Some(outcome) = nameless.filter(|n| left(&n.last) < left(&named.last)) {
            return outcome;
        }
        search.set_noise(known);
    }
    named
}

/// Looks for names on top of what is known, round by round, and lets terms judge them. True beside
/// an outcome whose names leave too much.
fn names(
    search: &mut Search,
    mut current: Fit,
    known: Vec<Vec<Candidate>>,
    progress: &(dyn Fn(&str) + Sync),
) -> (Outcome, bool) {
    let mut rounds = known;
    let mut so_far: f64 = rounds.iter().map(|r| r[0].screened).sum();
    let mut term: Option<Candidate> = None;
    let mut doubt = None;
    while rounds.len() < rules::MOST_FOUND && !bends(search, &rounds) {
        progress(&format!("looking for effect {}", rounds.len() + 1));
        let saved = search.noise();
        let Some(one) = look(search, &mut current, so_far, progress) else { break };
        if rounds.is_empty() && one.holds {
            term = one.term;
        }
        if let Some(why) = one.against {
            doubt = one.named.first().map(|best| (best.effect, one.gain, why));
            if term.is_none() || !rounds.is_empty() {
                search.set_noise(saved);
                current = search.again(&current);
            } else {
                current = one.before;
            }
            break;
        }
        so_far += one.gain;
        current = one.named[0].fit.clone();
        rounds.push(one.named);
    }
    let plain = |search: &Search, at: &Fit| {
        let (hypothesis, columns) = recompose(at, &[], &search.scale);
        search.problem.fit(&hypothesis, &columns, 8)
    };
    if rounds.is_empty() && term.is_none() {
        // Nothing named: is there anything at all? Terms that switch on have not been tried yet.
        let excess = excess(&search.problem, &current);
        if excess.1 > rules::LEAST_EXCESS {
            term = switched(search, &mut current);
        }
        if term.is_none() {
            let excess = Some(excess).filter(|e| e.1 > rules::REAL_EXCESS);
            let places = Vec::new();
            let outcome =
                Outcome { baseline: current.clone(), last: current, places, doubt, excess, elsewhere: None };
            return (outcome, false);
        }
    }
    progress("weighing rivals");
    // A rival that takes a place may make another find needless.
    let mut places = Vec::new();
    for _ in 0..rules::MOST_FOUND {
        prune(search, &mut current, &mut rounds, so_far);
        let before: Vec<&str> = current.hypothesis.effects.iter().map(|e| e.id).collect();
        places = settle(search, &mut current, &rounds);
        if rounds.len() < 2 || current.hypothesis.effects.iter().map(|e| e.id).eq(before) {
            break;
        }
    }
    let baseline = plain(search, &current);
    let poor = !places.is_empty() && leaves_too_much(search, &baseline, &current, &places);
    unnamed(search, &baseline, &mut current, &mut places, term);
    let excess = Some(excess(&search.problem, &current)).filter(|e| e.1 > rules::REAL_EXCESS);
    (Outcome { baseline, last: current, places, doubt, excess, elsewhere: None }, poor)
}

/// Error above the noise on every channel: mean square over full scale squared.
fn excesses(problem: &Problem, fit: &Fit, floor: &BTreeMap<&'static str, f64>) -> Vec<(&'static str, f64)> {
    let residual = problem.residual_of(fit);
    let full = errors::full_scales(problem);
    errors::sums(problem, &residual, |r, row| !problem.masked[r][row])
        .into_iter()
        .map(|(name, (sum, n))| {
            // The floor is itself an estimate: only what stands clear of its doubt counts.
            let n = n.max(1) as f64;
            let doubt = 4.0 * floor[name] * (3.0 / n).sqrt();
            (name, (sum / n - floor[name] - doubt).max(0.0) / full[name].powi(2))
        })
        .collect()
}

fn floor(problem: &Problem, fit: &Fit) -> BTreeMap<&'static str, f64> {
    errors::noise_floor(problem, &problem.residual_of(fit))
}

/// The channel with most error above its noise: root mean square over full scale.
pub(crate) fn excess(problem: &Problem, fit: &Fit) -> (&'static str, f64) {
    excesses(problem, fit, &floor(problem, fit))
        .into_iter()
        .map(|(name, square)| (name, square.sqrt()))
        .max_by(|a, b| a.1.total_cmp(&b.1))
        .unwrap_or(("", 0.0))
}

/// Whether commands drive. Between the rows of a measured driver nobody knows what drove: its steps
/// leave errors of their own.
pub(crate) fn commanded(problem: &Problem) -> bool {
    problem.recordings.iter().all(|r| matches!(r.driving, Driving::Command(_)))
}

/// Whether the names found leave so much of the error that the physics is not among them. What
/// changes freely with time is followed by its knots coarsely only, and may leave what it leaves.
fn leaves_too_much(search: &Search, baseline: &Fit, current: &Fit, places: &[Place]) -> bool {
    let floor = floor(&search.problem, current);
    let before = excesses(&search.problem, baseline, &floor);
    let after = excesses(&search.problem, current, &floor);
    let sum = |list: &[(&'static str, f64)]| list.iter().map(|e| e.1).sum::<f64>();
    let real = after.iter().any(|e| e.1.sqrt() > rules::REAL_EXCESS);
    let lead = places.iter().max_by(|a, b| a.gain.total_cmp(&b.gain));
    if lead.is_some_and(|p| search.free_in_time(p.chosen)) {
        return false;
    }
    let may_leave = match places {
        [_] => rules::MAY_LEAVE,
        _ => rules::SEVERAL_MAY_LEAVE,
    };
    let may_leave = if commanded(&search.problem) { may_leave } else { rules::DRIVER_LEAVES * may_leave };
    real && sum(&after) > may_leave * sum(&before)
}

/// The best term of the whole library on the baseline, under the noise it leaves.
fn switched(search: &mut Search, current: &mut Fit) -> Option<Candidate> {
    let saved = search.noise();
    let mut before = current.clone();
    let best = search.best_term_under_its_noise(&mut before, rules::TERM_LEAST)?;
    // A force sensor drifts: where little is left, a small step of it is no finding.
    let little = excess(&search.problem, &before).1 < rules::REAL_EXCESS;
    let least_size = if little { rules::CLEAR_SIZE } else { rules::LEAST_SIZE };
    if criterion(&before) - best.criterion > rules::BELIEVE && search.size(&before, &best.fit) > least_size {
        *current = before;
        return Some(best);
    }
    search.set_noise(saved);
    None
}

/// The outcome where no name explains enough: from the baseline anew, the best term without a name, if
/// there is one.
fn nameless(search: &mut Search, baseline: &Fit, names: &[Place]) -> Option<Outcome> {
    let mut current = search.baseline(&baseline.resume());
    let term = switched(search, &mut current)?;
    let gain = criterion(&current) - term.criterion;
    let aside = names.iter().map(|p| (p.chosen, (gain - p.gain).max(0.0))).collect();
    let places = vec![Place { chosen: term.effect, rivals: Vec::new(), aside, gain }];
    let excess = Some(excess(&search.problem, &term.fit)).filter(|e| e.1 > rules::REAL_EXCESS);
    Some(Outcome { baseline: current, last: term.fit, places, doubt: None, excess, elsewhere: None })
}

/// Lets terms without a name judge what the names explain. One term alone that does better than
/// any name alone, and nearly as well as all of them together, shows physics outside the
/// catalogue; a term on top of the names shows what they leave.
fn unnamed(
    search: &mut Search,
    baseline: &Fit,
    current: &mut Fit,
    places: &mut Vec<Place>,
    term: Option<Candidate>,
) {
    let base = criterion(baseline);
    let place = |effect, gain| Place { chosen: effect, rivals: Vec::new(), aside: Vec::new(), gain };
    let named_gain = base - criterion(current);
    let needed = rules::TERM_LEAST.max(rules::TERM_SHARE * named_gain);
    let mut best = current.clone();
    let mut added = None;
    if !places.is_empty()
        && let Some(top) = search.best_term(current, needed)
        && criterion(current) - top.criterion > needed
        && search.size(current, &top.fit) > 2.0 * rules::LEAST_SIZE
    {
        added = Some(place(top.effect, criterion(current) - top.criterion));
        best = top.fit;
    }
    let suspicious = places.len() > 1 || added.is_some() || places.is_empty() || term.is_some();
    let alone = if suspicious {
        let first = term.map(|t| {
            let fit = search.again(&t.fit);
            Candidate { criterion: criterion(&fit), fit, ..t }
        });
        let second = if places.len() > 1 || added.is_some() {
            search.best_term(&mut baseline.clone(), rules::TERM_LEAST)
        } else {
            None
        };
        first.into_iter().chain(second).min_by(|a, b| a.criterion.total_cmp(&b.criterion))
    } else {
        None
    };
    if let Some(alone) = alone {
        let gain = base - alone.criterion;
        let all = base - criterion(&best);
        let all_found = members(&search.problem, current);
        let (free, formed): (Vec<&Member>, Vec<&Member>) =
            all_found.iter().partition(|m| search.free_in_time(m.0));
        // Beside a name with a form of its own, what changes freely with time is no measure for a term.
        let measures = if formed.is_empty() { &free } else { &formed };
        let single = measures
            .iter()
            .map(|m| {
                if all_found.len() == 1 {
                    return named_gain;
                }
                let (hypothesis, columns) = recompose(current, std::slice::from_ref(*m), &search.scale);
                base - criterion(&search.problem.fit(&hypothesis, &columns, 5))
            })
            .fold(0.0_f64, f64::max);
        let several = places.len() + usize::from(added.is_some()) > 1;
        let reach = if free.is_empty() { rules::TERM_ALONE } else { rules::TERM_FOR_KNOTS };
        let ahead = gain > single + rules::TERM_LEAST.max(rules::TERM_AHEAD * named_gain);
        let better = ahead && (!several || gain > reach * all);
        let simpler = places.len() > 1 && gain > all;
        if places.is_empty() || better || simpler {
            let aside = places.drain(..).map(|p| (p.chosen, (gain - p.gain).max(0.0))).collect();
            *places = vec![Place { aside, ..place(alone.effect, gain) }];
            *current = alone.fit;
            return;
        }
    }
    if let Some(added) = added {
        places.push(added);
        *current = best;
    }
}

/// Backward elimination: an early find that later ones made needless goes.
fn prune(search: &Search, current: &mut Fit, rounds: &mut Vec<Vec<Candidate>>, gained: f64) {
    let needless = |search: &Search, without: &Fit, with: &Fit, loss: f64| {
        let size = search.size(without, with);
        loss < rules::BELIEVE
            || size < rules::LEAST_SIZE
            || loss < rules::SHARE_OF_FIRST * gained && size < rules::CLEAR_SIZE
    };
    while rounds.len() > 1 {
        let all = members(&search.problem, current);
        let now = criterion(current);
        let mut least: Option<(usize, Fit, f64)> = None;
        for leave in 0..all.len() {
            let rest: Vec<Member> =
                all.iter().enumerate().filter(|(i, _)| *i != leave).map(|(_, m)| m.clone()).collect();
            let (hypothesis, columns) = recompose(current, &rest, &search.scale);
            let fit = search.problem.fit(&hypothesis, &columns, 6);
            let loss = criterion(&fit) - now;
            if least.as_ref().is_none_or(|l| loss < l.2) {
                least = Some((leave, fit, loss));
            }
        }
        match least {
            Some((leave, fit, loss)) if needless(search, &fit, current, loss) => {
                *current = fit;
                rounds.remove(leave);
            }
            _ => break,
        }
    }
}

/// What may stand in a place instead of its leader: what competed in its round, with the fit it had,
/// and whatever the catalogue says the two are confused with, from the best of its starts.
fn contenders(
    search: &Search,
    current: &Fit,
    place: usize,
    candidates: &[Candidate],
) -> Vec<(Member, Option<Fit>)> {
    let all = members(&search.problem, current);
    let leader = all[place].0;
    let free = |id: &str| all.iter().all(|m| m.0.id != id);
    let own = |c: &Candidate| members(&search.problem, &c.fit).into_iter().find(|m| m.0.id == c.effect.id);
    let mut list: Vec<(Member, Option<Fit>)> = candidates
        .iter()
        .filter(|c| free(c.effect.id))
        .take(6)
        .filter_map(|c| Some((own(c)?, (all.len() == 1).then(|| c.fit.clone()))))
        .collect();
    for mate in &search.named {
        let strange = !mates(mate, leader) || amends(mate, &search.scale);
        if strange || !free(mate.id) || list.iter().any(|c| c.0.0.id == mate.id) {
            continue;
        }
        let starts = unscreened(mate, &search.scale).into_iter().map(|s| (*mate, s.start));
        let cost_of =
            |member: &Member| cost(&search.problem, &in_place(search, current, place, member.clone()).0);
        let best = starts.map(|m| (cost_of(&m), m)).min_by(|a, b| a.0.total_cmp(&b.0));
        list.extend(best.map(|b| (b.1, None)));
    }
    list
}

/// The present explanation with another member in one place.
fn in_place(search: &Search, current: &Fit, place: usize, member: Member) -> (Hypothesis, Columns) {
    let mut swapped = members(&search.problem, current);
    swapped[place] = member;
    recompose(current, &swapped, &search.scale)
}

/// How far a rival is behind. Numbers that it has and does not need are no argument against it: what counts
/// is how it fits. Not so where it changes freely with time: that bends to what has a form of its own, and
/// then the form is the likelier.
fn behind(search: &Search, place: &Place, rival: &Member, fit: &Fit, leader: &Fit) -> f64 {
    let free = |effect| search.free_in_time(effect);
    match (free(rival.0), free(place.chosen)) {
        (false, _) => (fit.chi2 + fit.penalty - leader.chi2 - leader.penalty).max(0.0),
        (true, false) => criterion(fit) - criterion(leader) + rules::BENDS * near(place, rival.0),
        (true, true) => criterion(fit) - criterion(leader),
    }
}

/// For every place: do others do as well, now that everything else is known? A better one takes
/// the place.
fn settle(search: &Search, current: &mut Fit, rounds: &[Vec<Candidate>]) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for (i, candidates) in rounds.iter().enumerate() {
        let all = members(&search.problem, current);
        let leader = all[i].0;
        let rest: Vec<Member> = all.into_iter().filter(|m| m.0.id != leader.id).collect();
        let (hypothesis, columns) = recompose(current, &rest, &search.scale);
        let without = search.problem.fit(&hypothesis, &columns, 6);
        let now = criterion(current);
        let mut place =
            Place { chosen: leader, rivals: Vec::new(), aside: Vec::new(), gain: criterion(&without) - now };
        // Each is fitted from where the leader stands: rivals that cannot be told apart lie beside it, in
        // a valley that is long where the rig states little.
        let mut tried: Vec<(Member, Fit)> = contenders(search, current, i, candidates)
            .into_par_iter()
            .map(|(member, own)| {
                // What stayed far behind in its round, under the same noise, is no rival.
                if let Some(own) =
                    own.as_ref().filter(|own| criterion(own) - now > rules::OUT_OF_THE_RACE * place.gain)
                {
                    return (member, own.clone());
                }
                let (hypothesis, columns) = in_place(search, current, i, member.clone());
                let mut fit = search.problem.fit(&hypothesis, &columns, 4);
                if criterion(&fit) - now < rules::OUT_OF_THE_RACE * place.gain {
                    fit = search.problem.again(&fit, 8);
                }
                if TIMING.contains(&member.0.id) && rounds.len() == 1 {
                    fit = search.with_own_edges(&fit, &[1.0]);
                }
                fit = own.filter(|own| criterion(own) < criterion(&fit)).unwrap_or(fit);
                let found = members(&search.problem, &fit).into_iter().find(|m| m.0.id == member.0.id);
                (found.unwrap_or(member), fit)
            })
            .collect();
        tried.sort_by(|a, b| criterion(&a.1).total_cmp(&criterion(&b.1)));
        let better = tried.first().is_some_and(|(m, fit)| criterion(fit) < now - 5.0 && !is_term(m.0));
        if better {
            let (member, fit) = tried.remove(0);
            let old = members(&search.problem, current).swap_remove(i);
            (place.chosen, place.gain) = (member.0, place.gain + now - criterion(&fit));
            tried.push((old, std::mem::replace(current, fit)));
            tried.sort_by(|a, b| criterion(&a.1).total_cmp(&criterion(&b.1)));
        }
        let now = criterion(current);
        let (rivals, aside): (Vec<_>, Vec<_>) = tried.into_iter().partition(|(member, fit)| {
            criterion(fit) - now < near(&place, member.0) && !is_term(member.0) && !is_term(place.chosen)
        });
        place.rivals = rivals
            .into_iter()
            .map(|(member, fit)| {
                let distance = behind(search, &place, &member, &fit, current);
                (member, distance)
            })
            .collect();
        place.aside = aside.into_iter().map(|(member, fit)| (member.0, criterion(&fit) - now)).collect();
        places.push(place);
    }
    places
}
