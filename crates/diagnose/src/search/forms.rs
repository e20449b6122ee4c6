//! Other forms of the members of a set.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use kort_identify::fit::{Columns, Fit};
use kort_identify::hypothesis::{Hypothesis, Member, Target};
use kort_thruster::effects::Scale;
use kort_thruster::effects::torque_ripple_cogging::come_again;
use nalgebra::DVector;
use rayon::prelude::*;

use super::{FIRST_STEPS, ITERATIONS, Search, Set};

/// Forms are changed as long as that lowers a cost by this.
const ENOUGH: f64 = 0.3;

/// Forms of one set from which first steps are taken.
const CLOSELY: usize = 4;

/// A number that a form adds: effect, place, and the bits of its order.
type Added = (&'static str, usize, u64);

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
                .begun(from)
                .into_par_iter()
                .map(|(hypothesis, columns)| self.promised(from, hypothesis, columns))
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

    /// A fit's set in other forms, with all derivatives. One that several forms add at the same order of the shaft's angle
    /// is learnt once: how they begin beside it changes it little.
    fn begun(&self, from: &Fit) -> Vec<(Hypothesis, Columns)> {
        let mut begun: Vec<(Hypothesis, Columns)> =
            self.other_forms(from).iter().map(|members| self.problem.recompose(from, members)).collect();
        let missing = |(hypothesis, columns): &(Hypothesis, Columns)| -> Vec<(usize, Added)> {
            let all = (0..columns.len()).filter(|k| columns[*k].is_none());
            all.map(|k| (k, self.added(hypothesis, k))).collect()
        };
        // Those that add most first: what one simulation can tell is asked of one.
        let mut order: Vec<usize> = (0..begun.len()).collect();
        order.sort_by_key(|i| std::cmp::Reverse(missing(&begun[*i]).len()));
        let mut known = BTreeSet::new();
        let asked: Vec<(usize, Vec<(usize, Added)>)> = order
            .into_iter()
            .map(|i| (i, missing(&begun[i]).into_iter().filter(|(_, key)| known.insert(*key)).collect()))
            .collect();
        let learnt: BTreeMap<Added, Arc<DVector<f64>>> = asked
            .into_par_iter()
            .flat_map_iter(|(i, asked)| {
                let (hypothesis, places) = (&begun[i].0, asked.iter().map(|(k, _)| *k).collect::<Vec<_>>());
                let columns = self.problem.derivatives(hypothesis, &hypothesis.start, &places);
                let keyed = move |(k, lines)| {
                    let (_, key) = asked.iter().find(|(place, _)| *place == k)?;
                    Some((*key, Arc::new(lines)))
                };
                columns.into_iter().filter_map(keyed)
            })
            .collect();
        for (hypothesis, columns) in &mut begun {
            for (k, column) in columns.iter_mut().enumerate().filter(|(_, column)| column.is_none()) {
                *column = learnt.get(&self.added(hypothesis, k)).cloned();
            }
        }
        begun
    }

    /// What a free number that a form adds is: of which effect, at which of its places, at which order.
    fn added(&self, hypothesis: &Hypothesis, k: usize) -> Added {
        let Target::Effect(i, j) = hypothesis.free[k].target else { return ("", k, 0) };
        let member = &hypothesis.effects[i];
        let order = places(member, &self.problem.scale).into_iter().rfind(|place| *place < j);
        (member.effect.id, j, order.map_or(0, |place| member.values[place].to_bits()))
    }

    /// What a form comes to, as far as the response is a straight line from where it begins.
    fn promised(&self, from: &Fit, hypothesis: Hypothesis, columns: Columns) -> Promised {
        let lines = self.problem.residual_lines(&hypothesis, &hypothesis.start);
        let model = self.problem.about(&lines, &columns, &hypothesis);
        let there = model.minimise(&from.floor, &hypothesis.free, &hypothesis.start, 0.0);
        let cost = model.cost(&there);
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
    /// not at work already. Orders are added one after the other: of several at once each would have to be chosen.
    fn chosen(&self, member: Member, before: &Member) -> Vec<Member> {
        let at_work = orders(before, &self.problem.scale);
        let mut added = orders(&member, &self.problem.scale);
        added.retain(|place| !at_work.contains(place));
        let place = match added[..] {
            [] => return vec![member],
            [place] => place,
            _ => return Vec::new(),
        };
        let taken: Vec<f64> = at_work.iter().map(|place| before.values[*place]).collect();
        let at = |order| {
            let mut values = member.values.clone();
            values[place] = order;
            member.clone().at(values)
        };
        let comes_again = |order: &f64| {
            let together: Vec<f64> = taken.iter().copied().chain([*order]).collect();
            come_again(&together, self.problem.scale.turned_rad)
        };
        let usual = self.usual_orders(&member).into_iter();
        usual.filter(|order| !taken.contains(order) && comes_again(order)).map(at).collect()
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
