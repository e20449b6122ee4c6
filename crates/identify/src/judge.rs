//! From rounds of the search to findings: who is believed, who is a rival, who is set aside.

use kort_thruster::effects::Descriptor;

use crate::baseline::{Member, members, recompose};
use crate::fit::Fit;
use crate::library::is_term;
use crate::search::{Candidate, Search, criterion, rules};

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
}

/// Margin within which two explanations cannot be told apart.
pub fn margin(gain: f64) -> f64 {
    rules::MARGIN.max(rules::MARGIN_SHARE * gain)
}

/// Runs the search to its end. `progress` is told what is going on.
pub fn run(search: &mut Search, start: &crate::fit::Hypothesis, progress: &(dyn Fn(&str) + Sync)) -> Outcome {
    progress("fitting the baseline");
    let mut current = search.baseline(start);
    let mut rounds: Vec<Vec<Candidate>> = Vec::new();
    let mut so_far = 0.0;
    let mut doubt = None;
    while rounds.len() < rules::MOST_FOUND {
        progress(&format!("looking for effect {}", rounds.len() + 1));
        let saved = (search.problem.recordings.clone(), search.problem.whiteners.clone());
        let Some(round) = search.round(&mut current, so_far) else { break };
        let mut candidates = round.candidates;
        prefer_a_name(&mut candidates, round.gain);
        let believed = if round.gain < rules::BELIEVE.max(rules::SHARE_OF_FIRST * so_far) {
            Err("its gain is within the noise")
        } else if round.size < rules::LEAST_SIZE {
            Err("it is too small to matter")
        } else if round.left_out.0 < rules::HOLDS * round.gain {
            Err("its gain does not hold on data left out of the fit")
        } else {
            Ok(())
        };
        if let Err(why) = believed {
            doubt = Some((candidates[0].effect, round.gain, why));
            (search.problem.recordings, search.problem.whiteners) = saved;
            current = search.again(&current);
            break;
        }
        so_far += round.gain;
        current = candidates[0].fit.clone();
        rounds.push(candidates);
    }
    if rounds.is_empty() {
        return Outcome { baseline: current.clone(), last: current, places: Vec::new(), doubt };
    }
    progress("weighing rivals");
    prune(search, &mut current, &mut rounds);
    let places = settle(search, &mut current, &rounds);
    let (hypothesis, columns) = recompose(&current, &[], &search.scale);
    let baseline = search.problem.fit(&hypothesis, &columns, 8);
    Outcome { baseline, last: current, places, doubt }
}

/// A term without a name may lead only if it beats the best name by more than doubt.
fn prefer_a_name(candidates: &mut Vec<Candidate>, gain: f64) {
    let Some(best) = candidates.first().map(|c| c.criterion) else { return };
    let Some(named) = candidates.iter().position(|c| !is_term(c.effect)) else { return };
    if candidates[named].criterion - best < rules::TERM_LEAST.max(rules::TERM_SHARE * gain) {
        let name = candidates.remove(named);
        candidates.insert(0, name);
    }
}

/// Backward elimination: an early find that later ones made needless goes.
fn prune(search: &Search, current: &mut Fit, rounds: &mut Vec<Vec<Candidate>>) {
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
            Some((leave, fit, loss)) if loss < rules::BELIEVE => {
                *current = fit;
                rounds.remove(leave);
            }
            _ => break,
        }
    }
}

/// For every place: do others do as well, now that everything else is known? A better one takes
/// the place.
fn settle(search: &Search, current: &mut Fit, rounds: &[Vec<Candidate>]) -> Vec<Place> {
    let mut places: Vec<Place> = Vec::new();
    for (i, candidates) in rounds.iter().enumerate() {
        let all = members(&search.problem, current);
        let mut now = criterion(current);
        let mut tried: Vec<(Member, f64)> = Vec::new();
        let alone = rounds.len() == 1;
        let leader = all[i].0;
        for candidate in candidates.iter().filter(|c| c.effect.id != leader.id).take(6) {
            if all.iter().any(|m| m.0.id == candidate.effect.id) {
                continue;
            }
            let own = members(&search.problem, &candidate.fit);
            let Some(member) = own.into_iter().find(|m| m.0.id == candidate.effect.id) else { continue };
            let fit = if alone {
                candidate.fit.clone()
            } else {
                let mut swapped = all.clone();
                swapped[i] = member.clone();
                let (hypothesis, columns) = recompose(current, &swapped, &search.scale);
                search.problem.fit(&hypothesis, &columns, 6)
            };
            let distance = criterion(&fit) - now;
            if distance < -5.0 && !is_term(candidate.effect) && !alone {
                // The rival takes the place; distances count from it.
                let old = members(&search.problem, current)[i].clone();
                tried.iter_mut().for_each(|t| t.1 -= distance);
                tried.push((old, -distance));
                *current = fit;
                now = criterion(current);
            } else {
                let refit =
                    members(&search.problem, &fit).into_iter().find(|m| m.0.id == candidate.effect.id);
                tried.push((refit.unwrap_or(member), distance));
            }
        }
        tried.sort_by(|a, b| a.1.total_cmp(&b.1));
        let chosen = members(&search.problem, current)[i].0;
        let rest: Vec<Member> =
            members(&search.problem, current).into_iter().filter(|m| m.0.id != chosen.id).collect();
        let (hypothesis, columns) = recompose(current, &rest, &search.scale);
        let without = search.problem.fit(&hypothesis, &columns, 6);
        let gain = criterion(&without) - criterion(current);
        let limit = margin(gain);
        let (rivals, aside): (Vec<_>, Vec<_>) =
            tried.into_iter().partition(|t| t.1 < limit && !is_term(t.0.0) && !is_term(chosen));
        places.push(Place { chosen, rivals, aside: aside.into_iter().map(|t| (t.0.0, t.1)).collect(), gain });
    }
    places
}
