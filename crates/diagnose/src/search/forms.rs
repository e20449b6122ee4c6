//! Other forms of the members of a set.

use kort_identify::fit::{Columns, Fit};
use kort_identify::hypothesis::{Hypothesis, Member};
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
            let before = from.cost();
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
                .min_by(|a, b| a.cost().total_cmp(&b.cost()));
            let Some(best) = best.filter(|fit| fit.cost() < before + self.constants.rivals) else { return };
            let fit = self.problem.settle(&best.resume(), &best.columns, &best.floor, ITERATIONS);
            self.keep(set.clone(), fit);
            if self.fits[set].cost() > before - ENOUGH {
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
                let mut all = members.clone();
                all[k] = other;
                others.push(all);
            }
        }
        others
    }
}
