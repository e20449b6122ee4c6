//! Output-error identification: simulate, compare with every channel, improve the free numbers.
//!
//! Gauss-Newton on the tempered likelihood of [`crate::noise`]: about each point the response is taken as
//! linear and the criterion minimised with its noise learnt anew ([`crate::quadratic`]); a step that gives
//! less than it promises is damped, one that gives more is lengthened. A fit knows its noise, so that any two can be
//! compared.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use crate::edges::{Reach, delay_of};
use crate::hypothesis::{Hypothesis, Member, Target};
use crate::noise::{Floor, Noise};
use crate::quadratic::Quadratic;
use crate::simulate::Problem;

/// A fit ends when a step lowers the merit (twice a log-likelihood) by less than this.
const ENOUGH: f64 = 0.3;

/// A linear response holds where a step gains what it promises within this part of it.
const HOLDS: f64 = 0.25;

/// A step that gains less than this part of what it promises is damped.
const FALLS_SHORT: f64 = 0.3;

/// Dampings of one step.
const DAMPINGS: usize = 5;

/// How many times its length a step goes at most where it gains more than it promises: a budget. By more, the fits of
/// tuning cases ended where they do by this.
const LONGEST: f64 = 4.0;

/// Lines, in full scales, of a simulation that ran away: it follows nothing, and no noise of any size excuses it.
const RAN_AWAY: f64 = 1e6;

/// Rounds of placing the command's steps and fitting.
const PLACINGS: usize = 8;

/// Derivatives of the response by free number, as lines, where they are known.
pub type Columns = Vec<Option<Arc<DVector<f64>>>>;

/// Those derivatives that are known.
pub fn known_of(columns: &Columns) -> Vec<Arc<DVector<f64>>> {
    columns.iter().flatten().cloned().collect()
}

/// Where a fit stands.
struct Point {
    values: Vec<f64>,
    /// Measured less simulated, as lines.
    lines: DVector<f64>,
    /// Misfit and priors.
    merit: f64,
}

/// Where a step leads, and what the linear response promised of it.
struct Step {
    to: Point,
    promised: f64,
}

/// A fitted hypothesis.
#[derive(Clone)]
pub struct Fit {
    /// The hypothesis.
    pub hypothesis: Hypothesis,
    /// Values of its free numbers.
    pub values: Vec<f64>,
    /// Measured less simulated, as lines.
    pub lines: DVector<f64>,
    /// Derivatives, perhaps from nearby.
    pub columns: Columns,
    /// Least noise it is held to.
    pub floor: Floor,
    /// Its noise.
    pub noise: Noise,
    /// Squared distance from the priors' means, in standard deviations.
    pub penalty: f64,
    /// `ln det(I + J'WJ)`, free numbers in prior standard deviations: Laplace's price of the numbers.
    pub price: f64,
}

impl Fit {
    /// Twice the negative log of what the data say for the hypothesis, up to a constant of the recordings.
    pub fn cost(&self) -> f64 {
        self.noise.misfit + self.penalty + self.price
    }

    /// Whether the simulation broke down, or ran away.
    pub fn broke_down(&self) -> bool {
        !self.cost().is_finite() || self.ran_away()
    }

    /// Whether the simulation ran away, whatever its numbers cost.
    pub fn ran_away(&self) -> bool {
        !self.lines.iter().all(|line| line.abs() <= RAN_AWAY)
    }

    /// The hypothesis, to start from where this fit ended.
    pub fn resume(&self) -> Hypothesis {
        Hypothesis { start: self.values.clone(), ..self.hypothesis.clone() }
    }

    /// Which free numbers stand at a bound.
    pub fn at_bound(&self) -> Vec<bool> {
        self.hypothesis.free.iter().zip(&self.values).map(|(f, v)| f.at_bound(*v)).collect()
    }
}

impl Problem<'_> {
    /// Fits a hypothesis from its start, held to noise no less than `floor`. `known` holds derivatives from a nearby
    /// fit; they serve until a step gives less or more than they promise, which saves most simulations while
    /// hypotheses are compared.
    pub fn fit(&self, hypothesis: &Hypothesis, known: &Columns, floor: &Floor, iterations: usize) -> Fit {
        let mut at = self.point(hypothesis, hypothesis.start.clone(), floor);
        let mut columns = known.clone();
        columns.resize(at.values.len(), None);
        let mut fresh = columns.iter().all(Option::is_none);
        let mut damping = 0.0;
        let mut model: Option<Quadratic> = None;
        for _ in 0..if at.merit.is_finite() { iterations } else { 0 } {
            self.complete(hypothesis, &at.values, &mut columns);
            let about = match &model {
                Some(before) => before.about(&at.lines, &known_of(&columns), &hypothesis.free),
                None => self.about(&at.lines, &columns, hypothesis),
            };
            let step = self.step(hypothesis, &at, &about, floor, &mut damping, fresh);
            model = Some(about);
            let (gain, promised) = step.as_ref().map_or((0.0, 0.0), |s| (at.merit - s.to.merit, s.promised));
            at = step.map_or(at, |step| step.to);
            if gain > 0.0 && (gain - promised).abs() < HOLDS * promised {
                if gain < ENOUGH {
                    break;
                }
                fresh = false;
            } else if !fresh && gain > ENOUGH && gain > FALLS_SHORT * promised {
                // The derivatives no longer tell: refresh the effects' first, then everything.
                for (column, free) in columns.iter_mut().zip(&hypothesis.free) {
                    if matches!(free.target, Target::Effect(..)) {
                        *column = None;
                    }
                }
            } else if fresh && gain < ENOUGH {
                break;
            } else {
                columns.fill(None);
                fresh = true;
            }
        }
        let Point { values, lines, .. } = at;
        let powers = self.spectrum.powers(&lines);
        let noise = Noise::of(&self.spectrum.bands, &powers, floor, &self.criterion);
        Fit {
            penalty: hypothesis.penalty(&values),
            hypothesis: hypothesis.clone(),
            values,
            lines,
            columns,
            floor: floor.clone(),
            noise,
            price: f64::NAN,
        }
    }

    /// A fit to a finish from what is stated: the steps of the command are placed before anything moves, since
    /// numbers that were fitted to misplaced steps keep them there.
    pub fn settle_from_stated(&self, hypothesis: &Hypothesis, iterations: usize) -> Fit {
        let mut placed = hypothesis.clone();
        for placing in 0..PLACINGS {
            let stated = self.fit(&placed, &Vec::new(), &self.floor, 0);
            let reach = if placing == 0 { Reach::All } else { Reach::Near };
            let Some(inputs) = self.place_edges(&stated, reach) else { break };
            placed.inputs = Arc::new(inputs);
        }
        let best = self.settle_from_here(&placed, &Vec::new(), &self.floor, iterations);
        self.settle_all_steps(best, iterations)
    }

    /// A fit to a finish: from its start, with the steps of the command placed for it, and its price known. A delay of the
    /// drive is fitted to where the steps are, and they are placed for it: both may be off together.
    pub fn settle(&self, hypothesis: &Hypothesis, known: &Columns, floor: &Floor, iterations: usize) -> Fit {
        let fit = self.settle_from_here(hypothesis, known, floor, iterations);
        if delay_of(hypothesis).is_some() { self.settle_all_steps(fit, iterations) } else { fit }
    }

    /// Steps are placed one by one, for the instants at which the sensors are taken to be read and for a delay; all of
    /// them may be some ticks off together with those, which would pass for physics.
    fn settle_all_steps(&self, mut best: Fit, iterations: usize) -> Fit {
        for earlier in [true, false] {
            while let Some(moved) = self.a_tick_off(&best, earlier) {
                let next = self.settle_from_here(&moved, &best.columns, &best.floor, iterations);
                if next.cost() > best.cost() - ENOUGH {
                    break;
                }
                best = next;
            }
        }
        best
    }

    /// The same with each step of the command placed by itself.
    fn settle_from_here(
        &self,
        hypothesis: &Hypothesis,
        known: &Columns,
        floor: &Floor,
        iterations: usize,
    ) -> Fit {
        let mut fit = self.fit(hypothesis, known, floor, iterations);
        for _ in 0..PLACINGS {
            let Some(inputs) = self.place_edges(&fit, Reach::Near) else { break };
            let moved = Hypothesis { inputs: Arc::new(inputs), ..fit.resume() };
            let next = self.fit(&moved, &fit.columns, floor, iterations);
            let gain = fit.noise.misfit + fit.penalty - next.noise.misfit - next.penalty;
            if gain > 0.0 {
                fit = next;
            }
            if gain < ENOUGH {
                break;
            }
        }
        self.finish(fit)
    }

    /// Learns a fit's noise over its floor and prices its numbers.
    pub fn finish(&self, mut fit: Fit) -> Fit {
        let powers = self.spectrum.powers(&fit.lines);
        fit.noise = Noise::of(&self.spectrum.bands, &powers, &fit.floor, &self.criterion);
        self.complete(&fit.hypothesis, &fit.values, &mut fit.columns);
        fit.price = self.about(&fit.lines, &fit.columns, &fit.hypothesis).price(&fit.noise);
        fit
    }

    /// What a fit would come to from where it stands, as far as the response is a straight line.
    pub fn promised(&self, from: &Fit) -> f64 {
        let model = self.about(&from.lines, &from.columns, &from.hypothesis);
        let there = model.minimise(&from.floor, &from.hypothesis.free, &from.values, 0.0);
        model.cost(&there)
    }

    /// What each effect of a fit does to the response: the change where it is taken away, mean square by band. Nothing
    /// is said of what has no size.
    pub fn actions(&self, fit: &Fit) -> Vec<Vec<f64>> {
        let all = self.members(&fit.hypothesis, &fit.values);
        let none = || vec![0.0; self.spectrum.bands.len()];
        let of = |k: usize| if all[k].has_size(&self.scale) { self.action_of(fit, &[k]) } else { none() };
        (0..all.len()).map(of).collect()
    }

    /// What some effects of a fit, by their places in it, do to the response together.
    pub fn action_of(&self, fit: &Fit, places: &[usize]) -> Vec<f64> {
        let all = self.members(&fit.hypothesis, &fit.values);
        let rest = all.into_iter().enumerate().filter(|(i, _)| !places.contains(i)).map(|(_, m)| m);
        let (smaller, _) = self.recompose(fit, &rest.collect::<Vec<Member>>());
        let lines = self.residual_lines(&smaller, &smaller.start);
        self.spectrum.powers(&(lines - &fit.lines))
    }

    /// The same baseline, at a fit's values, with other members; derivatives that carry over come with it.
    pub fn recompose(&self, fit: &Fit, members: &[Member]) -> (Hypothesis, Columns) {
        let is_base = |k: &usize| !matches!(fit.hypothesis.free[*k].target, Target::Effect(..));
        let base: Vec<usize> = (0..fit.values.len()).filter(is_base).collect();
        let mut hypothesis = Hypothesis {
            effects: Vec::new(),
            free: base.iter().map(|k| fit.hypothesis.free[*k].clone()).collect(),
            start: base.iter().map(|k| fit.values[*k]).collect(),
            inputs: fit.hypothesis.inputs.clone(),
        };
        for member in members {
            let values = hypothesis.start.clone();
            hypothesis = hypothesis.with(&values, member.clone(), &self.scale);
        }
        let key = |h: &Hypothesis, target: Target| match target {
            Target::Base(p) => (p.name(), usize::MAX),
            Target::Sampling { response } => (response.name(), usize::MAX - 1),
            Target::Averaging { response } => (response.name(), usize::MAX - 2),
            Target::Effect(i, j) => (h.effects[i].effect.id, j),
        };
        let columns = hypothesis
            .free
            .iter()
            .map(|free| {
                let wanted = key(&hypothesis, free.target);
                let at = fit.hypothesis.free.iter().position(|f| key(&fit.hypothesis, f.target) == wanted)?;
                fit.columns[at].clone()
            })
            .collect();
        (hypothesis, columns)
    }

    /// A step from a point whose derivatives are known: damped where it does not give what it promises, lengthened
    /// where it gives more. Nothing where no step lowers the merit.
    fn step(
        &self,
        hypothesis: &Hypothesis,
        from: &Point,
        model: &Quadratic,
        floor: &Floor,
        damping: &mut f64,
        fresh: bool,
    ) -> Option<Step> {
        let free = &hypothesis.free;
        let mut best: Option<Step> = None;
        for _ in 0..DAMPINGS {
            let minimum = model.minimise(floor, free, &from.values, *damping);
            let promised = from.merit - minimum.misfit - minimum.penalty;
            let moved = |times: f64| -> Vec<f64> {
                let by = |k: usize| from.values[k] + times * minimum.step[k] * free[k].sigma;
                (0..free.len()).map(|k| free[k].within(by(k))).collect()
            };
            let mut to = self.point(hypothesis, moved(1.0), floor);
            let mut times = 2.0;
            while from.merit - to.merit > (1.0 + HOLDS) * promised.max(ENOUGH) && times <= LONGEST {
                let farther = self.point(hypothesis, moved(times), floor);
                if farther.merit.is_nan() || farther.merit >= to.merit {
                    break;
                }
                to = farther;
                times *= 2.0;
            }
            let gain = from.merit - to.merit;
            let so_far = best.as_ref().map_or(0.0, |step| from.merit - step.to.merit);
            if gain > so_far {
                best = Some(Step { to, promised });
            } else if best.is_some() {
                break;
            }
            if gain > FALLS_SHORT * promised {
                *damping = if *damping > 1e-3 { *damping * 0.1 } else { 0.0 };
                break;
            }
            if !fresh || promised < ENOUGH {
                break;
            }
            *damping = if *damping == 0.0 { 0.1 } else { *damping * 10.0 };
        }
        best
    }

    /// Values, what they leave as lines, and their merit.
    fn point(&self, hypothesis: &Hypothesis, values: Vec<f64>, floor: &Floor) -> Point {
        let lines = self.residual_lines(hypothesis, &values);
        let powers = self.spectrum.powers(&lines);
        let misfit = Noise::of(&self.spectrum.bands, &powers, floor, &self.criterion).misfit;
        Point { merit: misfit + hypothesis.penalty(&values), values, lines }
    }

    /// Computes the derivatives that are missing.
    pub fn complete(&self, hypothesis: &Hypothesis, values: &[f64], columns: &mut Columns) {
        columns.resize(values.len(), None);
        let missing: Vec<usize> = (0..columns.len()).filter(|k| columns[*k].is_none()).collect();
        for (k, lines) in self.derivatives(hypothesis, values, &missing) {
            columns[k] = Some(Arc::new(lines));
        }
    }

    /// The criterion about a point whose derivatives are all known.
    pub fn about(&self, lines: &DVector<f64>, columns: &Columns, hypothesis: &Hypothesis) -> Quadratic<'_> {
        Quadratic::new(&self.spectrum, &self.criterion, lines, &known_of(columns), &hypothesis.free)
    }

    /// Information of the data on the free numbers of a fit, in units of their priors'.
    pub fn information(&self, fit: &Fit) -> DMatrix<f64> {
        self.about(&fit.lines, &fit.columns, &fit.hypothesis).information(&fit.noise)
    }

    /// Covariance of a fit's values, priors included.
    pub fn covariance(&self, fit: &Fit) -> DMatrix<f64> {
        let n = fit.values.len();
        let total = self.information(fit) + DMatrix::identity(n, n);
        let mut covariance = total.cholesky().map_or_else(|| DMatrix::identity(n, n), |c| c.inverse());
        for (k, free) in fit.hypothesis.free.iter().enumerate() {
            covariance.row_mut(k).scale_mut(free.sigma);
            covariance.column_mut(k).scale_mut(free.sigma);
        }
        covariance
    }

    /// Standard errors of a fit's values, priors included.
    pub fn standard_errors(&self, fit: &Fit) -> Vec<f64> {
        self.covariance(fit).diagonal().iter().map(|v| v.max(0.0).sqrt()).collect()
    }

    /// A fit taken further under the present masks.
    pub fn again(&self, fit: &Fit, iterations: usize) -> Fit {
        let columns = if fit.lines.len() == self.spectrum.lines { fit.columns.clone() } else { Vec::new() };
        let floor = if columns.is_empty() { &self.floor } else { &fit.floor };
        self.fit(&fit.resume(), &columns, floor, iterations)
    }
}
