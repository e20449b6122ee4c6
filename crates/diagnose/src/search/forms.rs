//! Other forms of the members of a set.

use kort_identify::fit::{Columns, Fit};
use kort_identify::hypothesis::{Hypothesis, Member};
use kort_thruster::effects::Scale;
use rayon::prelude::*;

use super::{FIRST_STEPS, ITERATIONS, Search, Set};

/// Forms are changed as long as that lowers a cost by this.
const ENOUGH: f64 = 0.3;

/// Forms of one set from which first steps are taken.
const CLOSELY: usize = 4;

/// A set in another form, with what a straight line promises.
struct Promised {
    hypothesis: Hypothesis,
    columns: Columns,
    cost: f64,
}

impl Search<'_, '_> {
    /// Fits a set anew with each member in its other forms, until none helps: a screen sees only how a form begins,
    /// and shapes that the data do not speak of are better left at their prior means. The cheapest is kept.
    pub(super) fn reshape(&mut self, set: &Set) {
        while let Some(from) = self.fits.get(set) {
            let before = self.cost_of(from);
            if !self.reshaped.insert((set.clone(), before.to_bits())) {
                return;
            }
            let mut promised: Vec<Promised> = self
                .other_forms(from)
                .par_iter()
                .map(|members| self.promised(from, members))
                .filter(|form| form.cost.is_finite())
                .collect();
            promised.sort_by(|a, b| a.cost.total_cmp(&b.cost));
            promised.truncate(CLOSELY);
            // A few steps tell which form is worth a fit to the end.
            let best = promised
                .par_iter()
                .map(|form| {
                    let fit = self.problem.fit(&form.hypothesis, &form.columns, &from.floor, FIRST_STEPS);
                    self.problem.finish(fit)
                })
                .min_by(|a, b| self.cost_of(a).total_cmp(&self.cost_of(b)));
            let Some(best) = best.filter(|fit| self.cost_of(fit) < before + self.constants.rivals) else {
                return;
            };
            let fit = self.problem.settle(&best.resume(), &best.columns, &best.floor, ITERATIONS);
            self.keep(set.clone(), fit);
            if self.cost_of(&self.fits[set]) > before - ENOUGH {
                return;
            }
        }
    }

    /// What a fit's members in these forms come to, as far as the response is a straight line from where they begin.
    fn promised(&self, from: &Fit, members: &[Member]) -> Promised {
        let (hypothesis, mut columns) = self.problem.recompose(from, members);
        let lines = self.problem.residual_lines(&hypothesis, &hypothesis.start);
        self.problem.complete(&hypothesis, &hypothesis.start, &mut columns);
        let model = self.problem.about(&lines, &columns, &hypothesis);
        let there = model.minimise(&from.floor, &hypothesis.free, &hypothesis.start, 0.0);
        let cost = there.misfit + there.penalty + model.price(&there.noise);
        Promised { hypothesis, columns, cost }
    }

    /// The members of a fit with one of them in another of its forms. What a form leaves out stays at its prior mean,
    /// what it adds begins where the catalogue says.
    fn other_forms(&self, fit: &Fit) -> Vec<Vec<Member>> {
        let members = self.problem.members(&fit.hypothesis, &fit.values);
        let mut others = Vec::new();
        for (k, member) in members.iter().enumerate() {
            let specs = (member.effect.parameters)(&self.problem.scale);
            let never = |j: &usize| specs[*j].held && specs[*j].shape;
            let now: Vec<usize> = (0..specs.len()).filter(|j| !member.held.contains(j)).collect();
            for mut form in member.effect.forms(&specs) {
                form.retain(|j| !never(j));
                form.sort_unstable();
                if form == now || form.is_empty() {
                    continue;
                }
                let mut other = member.clone();
                other.held = (0..specs.len()).filter(|j| !form.contains(j)).collect();
                for j in (0..specs.len()).filter(|j| !never(j) && now.contains(j) != form.contains(j)) {
                    other.values[j] = match (form.contains(&j), specs[j].shape) {
                        (true, _) => specs[j].start,
                        (false, true) => specs[j].mean,
                        (false, false) => 0.0,
                    };
                }
                for chosen in self.chosen(other, member) {
                    let mut all = members.clone();
                    all[k] = chosen;
                    others.push(all);
                }
            }
        }
        others
    }

    /// A member in another form than before; where the form adds an order of the shaft's angle, at each usual one that is
    /// not at work already.
    fn chosen(&self, member: Member, before: &Member) -> Vec<Member> {
        let at_work = orders(before, &self.problem.scale);
        let added = orders(&member, &self.problem.scale).into_iter().find(|place| !at_work.contains(place));
        let Some(place) = added else { return vec![member] };
        let taken: Vec<f64> = at_work.iter().map(|place| before.values[*place]).collect();
        let at = |order| {
            let mut values = member.values.clone();
            values[place] = order;
            member.clone().at(values)
        };
        self.usual_orders(&member).into_iter().filter(|order| !taken.contains(order)).map(at).collect()
    }

    /// The orders of the shaft's angle that a member's starts have first.
    fn usual_orders(&self, member: &Member) -> Vec<f64> {
        let Some(place) = places(member, &self.problem.scale).first().copied() else { return Vec::new() };
        let mut usual: Vec<f64> =
            member.starts(&self.problem.scale).iter().map(|start| start[place]).collect();
        usual.sort_by(f64::total_cmp);
        usual.dedup();
        usual
    }

    /// A fit's cost with what the choice of each order of the shaft's angle beyond the first costs; the first is in
    /// [`Search::price_of`].
    pub(super) fn cost_of(&self, fit: &Fit) -> f64 {
        let choices = |member: &Member| {
            let further = orders(member, &self.problem.scale).len().saturating_sub(1);
            2.0 * further as f64 * (self.usual_orders(member).len().max(1) as f64).ln()
        };
        fit.cost() + fit.hypothesis.effects.iter().map(choices).sum::<f64>()
    }
}

/// Places of the orders of the shaft's angle of an effect that may act at several.
fn places(member: &Member, scale: &Scale) -> Vec<usize> {
    let specs = (member.effect.parameters)(scale);
    let all: Vec<usize> = (0..specs.len()).filter(|j| specs[*j].held && specs[*j].shape).collect();
    if all.len() > 1 { all } else { Vec::new() }
}

/// Those of them at which a free size acts: an order is listed before its sizes.
fn orders(member: &Member, scale: &Scale) -> Vec<usize> {
    let all = places(member, scale);
    let ends = all.iter().skip(1).copied().chain([member.values.len()]);
    let acts = |(place, end): &(usize, usize)| (place + 1..*end).any(|j| !member.held.contains(&j));
    all.iter().copied().zip(ends).filter(acts).map(|(place, _)| place).collect()
}
