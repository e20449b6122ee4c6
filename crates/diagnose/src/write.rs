//! The report of a diagnosis: fits on training rows, scores on the others, and everything put in its place.

use kort_identify::data::{Series, available};
use kort_identify::fit::Fit;
use kort_identify::heldout::held_out_rows;
use kort_identify::scores::{self, HeldOut, parameters};
use kort_identify::simulate::{Problem, Stack};
use kort_identify::thin::Thin;
use kort_thruster::effects::Path;
use kort_thruster::rig::Rig;

use crate::adoption;
use crate::cancelling::cancelling;
use crate::decide::{Circumstances, Decision, Named, decide};
use crate::diagnose::Options;
use crate::experiment::{self, Open};
use crate::flexible::is_term;
use crate::left::{self, Rest};
use crate::left_aside;
use crate::load_steps;
use crate::locate::{self, locate};
use crate::place;
use crate::posterior::{Explanation, InPlace, Posterior};
use crate::report::{Alternative, Baseline, Finding, Mismatch, Remainder, Report, SetReport, Verdict};
use crate::search::{Search, Set};
use crate::traces::{Traces, traces};
use crate::words;

/// What the report is written from.
pub struct Writer<'a, 'p> {
    problem: &'a Problem<'p>,
    search: &'a Search<'a, 'p>,
    posterior: Posterior,
    best: Set,
    baseline: &'a Fit,
    last: Fit,
    series: &'a [Series],
    rig: &'a Rig,
    options: &'a Options,
    held: Vec<Vec<bool>>,
    training: Problem<'p>,
    floor: std::collections::BTreeMap<&'static str, f64>,
}

/// Iterations of a fit on the training rows.
const TRAINING: usize = 5;
/// Most a name is given where held-out data do not confirm it or its values stand at their bounds.
const UNCONFIRMED: f64 = 0.9;
/// Explanations are listed until this probability is reached.
const LISTED: f64 = 0.95;
/// Names set aside that are listed.
const ALTERNATIVES: usize = 6;

impl<'a, 'p> Writer<'a, 'p> {
    /// From a search that is done and its posterior.
    pub fn new(
        search: &'a Search<'a, 'p>,
        posterior: Posterior,
        series: &'a [Series],
        rig: &'a Rig,
        options: &'a Options,
    ) -> Self {
        let problem = search.problem;
        let best = posterior.told().map_or_else(Set::new, |e| e.set().clone());
        let baseline = &search.fits[&Set::new()];
        let last = left::at_its_best(problem, &search.fits[&best]);
        let held = held_out_rows(problem, &[&last.hypothesis]);
        let floor = scores::noise_floor(problem, &problem.residual(&last.hypothesis, &last.values));
        Self {
            training: problem.without(&held),
            problem,
            search,
            posterior,
            best,
            baseline,
            last,
            series,
            rig,
            options,
            held,
            floor,
        }
    }

    fn residual(&self, fit: &Fit) -> Stack {
        self.problem.residual(&fit.hypothesis, &fit.values)
    }

    /// A fit taken further on the training rows, as residual on all.
    fn trained(&self, fit: &Fit) -> Stack {
        let trained = self.training.again(fit, TRAINING);
        self.residual(if trained.ran_away() { fit } else { &trained })
    }

    fn score(&self, before: &Stack, after: &Stack) -> HeldOut {
        scores::held_out(self.problem, &self.held, before, after, &self.floor, self.options.seed)
    }

    fn excess(&self, residual: &Stack) -> f64 {
        left::excess(self.problem, residual, &self.floor)
    }

    /// The best set's names without the nameless term.
    fn names_only(&self) -> Set {
        self.best.iter().copied().filter(|id| !is_term(id)).collect()
    }

    /// The report, and curves for its plots.
    pub fn write(self, mut notes: Vec<String>, thin: Option<Thin>) -> (Report, Traces) {
        let (problem, options) = (self.problem, self.options);
        let baseline_full = self.residual(self.baseline);
        let last_full = self.residual(&self.last);
        let named_full = match self.search.fits.get(&self.names_only()) {
            Some(named) if self.names_only() != self.best => {
                self.residual(&left::at_its_best(problem, named))
            }
            _ => last_full.clone(),
        };
        let whole = (self.excess(&baseline_full) - self.excess(&last_full)).max(1e-300);
        let left = (self.excess(&named_full) - self.excess(&last_full)).max(0.0) / whole;
        let rest = left::more_than_noise(problem, &self.last, &last_full, &self.floor);
        let idle = !self.names_only().is_empty() && !scores::predicts(problem, &last_full);
        let thin = thin.filter(|thin| thin.still || !idle).or(idle.then(Thin::unpredicted));
        let actions = problem.actions(&self.last);
        let mut negligible = left::negligible(problem, &self.last, &actions);
        negligible.retain(|(id, _)| !self.baseline.hypothesis.has(id));
        let circumstances = Circumstances {
            negligible: negligible.iter().map(|n| n.0).collect(),
            thin: thin.clone(),
            unparted: crate::unparted::unparted(self.search, &self.best),
            steady: left::steady(problem, &self.last, &actions),
            cancelling: cancelling(problem, &self.last, &actions),
            broke_down: false,
            left,
            more_than_noise: rest.is_some(),
        };
        let decision = decide(&self.posterior, &circumstances);
        let baseline_trained = self.trained(self.baseline);
        let last_trained =
            if self.best.is_empty() { baseline_trained.clone() } else { self.trained(&self.last) };
        let rows = problem.rows(&self.last.hypothesis, &self.last.values);
        let speed: Vec<Vec<f64>> =
            rows.iter().map(|rows| rows.iter().map(|s| s.true_speed_rad_s).collect()).collect();

        let (mut findings, mut mismatch) = (Vec::new(), Vec::new());
        let mut doubted: Option<(&str, Remainder)> = None;
        let stated = |id: &&str| decision.term == Some(*id) || decision.named.iter().any(|n| n.effect == *id);
        let members = self.best.iter().copied().filter(stated);
        let empty_cost = self.search.cost(&Set::new());
        for member in members {
            let smaller =
                left::at_its_best(problem, &self.search.fit_without(&self.best, member, 2 * TRAINING));
            let smaller_full = self.residual(&smaller);
            let smaller_trained = self.trained(&smaller);
            let mut located = locate(problem, &smaller_full, &last_full, &speed);
            if member == load_steps::LOAD_STEPS.id {
                (located.regime, located.spans) = load_steps::regime(problem, &self.last);
            }
            let gain = (smaller.noise.misfit - self.last.noise.misfit).max(0.0);
            let share = ((self.excess(&smaller_full) - self.excess(&last_full)) / whole).clamp(0.0, 1.0);
            let path = self.path(member);
            let place = mismatch_of(path, &located, gain, share);
            // Of what is in doubt the most.
            if decision.doubts(member) && doubted.as_ref().is_none_or(|d| d.1.share_of_excess_error < share) {
                let left = Remainder::at(place.clone(), share, words::nrmse(problem, &smaller_full));
                doubted = Some((member, left));
            }
            mismatch.push((share, place));
            let here: Vec<&Named> = decision
                .named
                .iter()
                .filter(|n| {
                    n.effect == member || n.rivals.contains(&member) && !self.best.contains(&n.effect)
                })
                .collect();
            for named in here {
                let finding = if named.effect == member {
                    let heldout = self.score(&smaller_trained, &last_trained);
                    self.finding(named, &self.last, heldout, Some(&located))
                } else {
                    // In the likeliest set that has it in the member's place, alone or beside another.
                    let rest = self.best.iter().filter(|id| **id != member);
                    let stands_in = |e: &&Explanation| {
                        e.set().contains(&named.effect)
                            && !e.set().contains(&member)
                            && rest.clone().all(|id| e.set().contains(id))
                    };
                    let swapped = self.posterior.sets.iter().find(stands_in);
                    let Some(fit) = swapped.and_then(|e| self.search.fits.get(e.set())) else { continue };
                    let fit = left::at_its_best(problem, fit);
                    let heldout = self.score(&smaller_trained, &self.trained(&fit));
                    self.finding(named, &fit, heldout, None)
                };
                findings.push((share, finding));
            }
        }
        if let (Some(rest), Verdict::Unexplained) = (rest, decision.verdict)
            && mismatch.is_empty()
        {
            mismatch.push((1.0, self.bare(rest, &baseline_full, &speed)));
        }
        // In the order of what each removes; of rivals the likeliest first.
        findings.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.probability.total_cmp(&a.1.probability)));
        mismatch.sort_by(|a, b| b.0.total_cmp(&a.0));
        let findings: Vec<Finding> = findings.into_iter().map(|f| f.1).collect();
        let mismatch: Vec<Mismatch> = mismatch.into_iter().map(|m| m.1).collect();
        let std_last = problem.standard_errors(&self.last);
        let empirical_term = decision.term.map(|term| {
            let smaller = self.search.fit_without(&self.best, term, 2 * TRAINING);
            let heldout = self.score(&self.trained(&smaller), &last_trained);
            words::empirical(problem, &self.last, &std_last, term, heldout)
        });
        let remainder = match (decision.term, rest) {
            _ if decision.named.is_empty() => None,
            (Some(term), _) => {
                let located = locate(problem, &named_full, &last_full, &speed);
                let place = mismatch_of(self.path(term), &located, 0.0, left);
                Some(Remainder::at(place, left.min(1.0), words::nrmse(problem, &named_full)))
            }
            (None, Some(rest)) => {
                let bare = self.bare(rest, &last_full, &speed);
                let share = self.excess(&last_full) / self.excess(&baseline_full).max(1e-300);
                Some(Remainder::at(bare, share.clamp(0.0, 1.0), words::nrmse(problem, &last_full)))
            }
            (None, None) => doubted.as_ref().map(|d| d.1.clone()),
        };
        let in_doubt = doubted.filter(|d| remainder.as_ref() == Some(&d.1)).map(|d| d.0);
        if findings.len() > 1 {
            let everything = self.score(&baseline_trained, &last_trained).excess_error_removed;
            notes.push(format!(
                "everything found together removes {:.0} % of the error above the noise on held-out data",
                100.0 * everything
            ));
        }
        if let (Some(thin), Verdict::InsufficientData) = (&thin, decision.verdict) {
            notes.insert(0, thin.why.clone());
        }
        notes.extend(negligible.iter().map(|(id, share)| words::negligible(id, *share)));
        notes.extend(circumstances.cancelling.iter().map(|(a, b)| words::cancelling(a, b)));
        notes.extend(words::strained(self.baseline));
        notes.extend(left_aside::left_aside(self.series, problem, decision.verdict, self.rig));
        let std_baseline = problem.standard_errors(self.baseline);
        let baseline = Baseline {
            model: options.model.name().into(),
            parameters: scores::all_parameters(self.baseline, &std_baseline),
            effects: scores::fitted_effects(self.baseline, &std_baseline),
            channels: scores::channels(problem, &self.held, &baseline_trained, &baseline_full, &self.floor),
        };
        let misread = thin.as_ref().is_some_and(|thin| thin.of_the_log);
        let thin = thin.as_ref().map(|thin| thin.why.as_str());
        let open = Open::of(&decision, remainder.as_ref(), &mismatch, thin);
        let next = || experiment::next(self.search, &decision, &self.best, self.rig, open);
        let next_experiment = if misread { None } else { next() };
        let in_place = self.posterior.in_place(circumstances.beside());
        let alternatives = self.alternatives(&decision, &circumstances.negligible, &in_place, empty_cost);
        let summary = words::summary(&words::Told {
            verdict: decision.verdict,
            findings: &findings,
            mismatch: &mismatch,
            term: empirical_term.as_ref(),
            without_name: decision.term.and_then(|id| self.search.descriptor(id)).map_or("", |d| d.what),
            remainder: remainder.as_ref(),
            in_doubt,
            next: next_experiment.as_ref(),
            baseline: &baseline,
            thin,
            alternatives: &alternatives,
        });
        let report = Report {
            schema: "kort.diagnosis/2".into(),
            kort_version: env!("CARGO_PKG_VERSION").into(),
            recordings: problem.recorded().map(|r| r.name.clone()).collect(),
            rig: self.rig.name.clone(),
            seed: options.seed,
            seconds: problem.recorded().map(kort_identify::data::Prepared::duration_s).sum(),
            verdict: decision.verdict,
            summary,
            baseline,
            mismatch,
            findings,
            explanations: listed(in_place),
            remainder,
            alternatives,
            empirical_term,
            next_experiment,
            notes,
        };
        (report, traces(problem, &baseline_full, &last_full, &speed))
    }

    /// A mismatch that neither name nor term describes: located by its error, on the path by which a cause that is
    /// free in time would explain most of it.
    fn bare(&self, rest: Rest, residual: &Stack, speed: &[Vec<f64>]) -> Mismatch {
        let nothing: Stack =
            residual.iter().map(|r| r.iter().map(|c| vec![0.0; c.len()]).collect()).collect();
        let located = locate(self.problem, residual, &nothing, speed);
        let offered = available(self.options.model, self.series, &self.problem.recordings);
        let path = place::path(self.problem, &self.last, self.rig, &offered, rest.alone);
        Mismatch {
            path: path.map_or("sensor", Path::name).into(),
            channel: rest.channel.into(),
            regime: left::told(self.problem, rest, residual, &located.regime),
            time_s: located.spans,
            significance_sigma: rest.ratio,
            share_of_excess_error: 1.0,
        }
    }

    fn path(&self, id: &str) -> &'static str {
        self.search.descriptor(id).map_or("shaft", |d| d.path.name())
    }

    fn finding(
        &self,
        named: &Named,
        fit: &Fit,
        heldout: HeldOut,
        located: Option<&locate::Place>,
    ) -> Finding {
        let problem = self.problem;
        let slot = fit.hypothesis.effects.iter().position(|m| m.effect.id == named.effect);
        let values = parameters(fit, &problem.standard_errors(fit), slot);
        let values = words::in_units(values, self.rig.amplifier.kind);
        let at_bound = values.iter().any(|p| p.at_bound == Some(true) && p.value != 0.0);
        let unconfirmed = heldout.interval_95[0] <= 0.0 || at_bound;
        let probability = if unconfirmed { named.probability.min(UNCONFIRMED) } else { named.probability };
        let effect = slot.map(|i| fit.hypothesis.effects[i].effect);
        Finding {
            effect: named.effect.into(),
            path: self.path(named.effect).into(),
            not_adopted: adoption::why_not(problem, named.effect, probability, &named.rivals, &values),
            probability,
            statement: effect.map_or_else(String::new, words::statement),
            equation: effect.map_or("", |e| e.equation).into(),
            parameters: values,
            evidence: words::evidence(effect, &heldout, located, at_bound),
            heldout,
            confounded_with: named.rivals.iter().map(|r| (*r).to_string()).collect(),
        }
    }

    /// Names that were fitted and are less likely, likeliest first.
    fn alternatives(
        &self,
        decision: &Decision,
        negligible: &[&str],
        in_place: &InPlace,
        empty_cost: f64,
    ) -> Vec<Alternative> {
        let best_cost = self.search.cost(&self.best);
        let mut others: Vec<(f64, f64, &'static str)> = self
            .search
            .effects
            .iter()
            .filter(|e| !decision.named.iter().any(|n| n.effect == e.id) && !negligible.contains(&e.id))
            .filter_map(|e| {
                let holding = self.search.fits.keys().filter(|set| set.contains(&e.id));
                let cost = holding.map(|set| self.search.cost(set)).min_by(f64::total_cmp)?;
                Some((in_place.probability(e.id), cost, e.id))
            })
            .collect();
        others.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.total_cmp(&b.1)));
        others
            .into_iter()
            .take(ALTERNATIVES)
            .map(|(probability, cost, effect)| {
                let (worse, gained) = ((cost - best_cost).max(0.0), empty_cost - best_cost);
                let why_not = match self.best.contains(&effect) {
                    true => words::TOO_LITTLE.into(),
                    false => words::why_not(worse, gained, self.search.temper(), self.best.is_empty()),
                };
                Alternative { effect: effect.into(), probability, why_not }
            })
            .collect()
    }
}

/// Sets of names that are right together, until enough is listed.
fn listed(in_place: InPlace) -> Vec<SetReport> {
    let mut reached = 0.0;
    let missing = |(_, probability): &(Set, f64)| {
        let more = reached < LISTED;
        reached += probability;
        more
    };
    let effects = |set: Set| set.into_iter().map(String::from).collect();
    let report = |(set, probability)| SetReport { effects: effects(set), probability };
    in_place.0.into_iter().take_while(missing).map(report).collect()
}

fn mismatch_of(path: &str, located: &locate::Place, gain: f64, share: f64) -> Mismatch {
    Mismatch {
        path: path.into(),
        channel: located.channel.into(),
        regime: located.regime.clone(),
        time_s: located.spans.clone(),
        significance_sigma: gain.sqrt(),
        share_of_excess_error: share,
    }
}
