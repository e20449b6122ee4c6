//! What is no more than a plainer effect is no name of its own.

use kort_identify::fit::Fit;
use kort_identify::hypothesis::Member;
use kort_thruster::effects::{Descriptor, Scale};

use super::stand_in::taking_over;
use super::{Search, Set, with, without};
use crate::left::{is_negligible, largest};

/// A name that does no more than a plainer one.
#[derive(Clone, Debug, PartialEq)]
pub struct Disguised {
    /// The name.
    pub effect: &'static str,
    /// The plainer one.
    pub plainer: &'static str,
    /// By how much they differ at most, over full scale.
    pub share: f64,
    /// The set with the name.
    set: Set,
    /// What that costs, its prior odds not counted: they move with the temper.
    alone: f64,
}

impl Search<'_, '_> {
    /// Whether a member of a fit does what a plainer effect does but for less, on every channel, than our equations may err
    /// by: a bearing that rubs by a twentieth more at one angle is dry friction. The set with that in its place is fitted then.
    pub(super) fn is_plainer(&mut self, set: &Set, fit: &Fit) -> bool {
        let problem = self.problem;
        let members = problem.members(&fit.hypothesis, &fit.values);
        // What the rig states or the user takes for given is no member of the set.
        let asked = |(_, member): &(usize, &Member)| set.contains(&member.effect.id);
        for (at, member) in members.iter().enumerate().filter(asked) {
            for plainer in member.effect.holds.iter().filter_map(|id| self.descriptor(id)) {
                let place = in_place_of(&members, at, plainer, &problem.scale);
                let (hypothesis, columns) = problem.recompose(fit, &place);
                let lines = problem.residual_lines(&hypothesis, &hypothesis.start);
                let between = problem.spectrum.powers(&(lines - &fit.lines));
                if !is_negligible(problem, &between) {
                    continue;
                }
                let rest = without(set, member.effect.id);
                let smaller = if rest.contains(&plainer.id) { rest } else { with(&rest, plainer.id) };
                let alone = self.cost_of(fit);
                let known = self.disguised.get(&smaller).map(|known| known.alone + self.prior(&known.set));
                if known.is_none_or(|known| alone + self.prior(set) < known) {
                    let share = largest(problem, &between);
                    let (effect, plainer) = (member.effect.id, plainer.id);
                    let disguised = Disguised { effect, plainer, share, set: set.clone(), alone };
                    self.disguised.insert(smaller.clone(), disguised);
                }
                // Where it has been fitted it may have got lost on its way.
                if self
                    .fits
                    .get(&smaller)
                    .is_none_or(|known| known.cost() > fit.cost() + self.constants.rivals)
                {
                    self.fit_set(smaller, &hypothesis, &columns);
                }
                return true;
            }
        }
        false
    }

    /// The name that the data would rather have in the place of a set's plainer one, if any.
    pub fn in_disguise(&self, set: &Set) -> Option<&Disguised> {
        self.disguised.get(set).filter(|known| known.alone + self.prior(&known.set) < self.cost(set))
    }
}

/// Members with a plainer one in the place of one of them, at its sizes: on top of it where it is there already.
fn in_place_of(members: &[Member], at: usize, plainer: &'static Descriptor, scale: &Scale) -> Vec<Member> {
    let new = in_first_form(taking_over(plainer, &members[at], scale), scale);
    let mut out = members.to_vec();
    match out.iter().position(|m| m.effect.id == plainer.id) {
        Some(there) => {
            let specs = (plainer.parameters)(scale);
            for (k, spec) in specs.iter().enumerate().filter(|(_, spec)| !spec.shape && !spec.held) {
                let sum = out[there].values[k] + new.values[k];
                out[there].values[k] = sum.clamp(spec.low, spec.high);
            }
            out.remove(at);
        }
        None => out[at] = new,
    }
    out
}

/// An effect in the first of its forms: what that leaves out is where it does nothing.
fn in_first_form(mut member: Member, scale: &Scale) -> Member {
    let specs = (member.effect.parameters)(scale);
    let Some(form) = member.effect.forms(&specs).into_iter().next() else { return member };
    for k in (0..specs.len()).filter(|k| !form.contains(k) && !specs[*k].held) {
        member.values[k] = specs[k].mean;
        member.held.push(k);
    }
    member
}
