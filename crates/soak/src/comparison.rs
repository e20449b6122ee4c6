//! The comparison: scores with intervals over seeds, law beside law.

use std::collections::BTreeMap;

use crate::limits;
use crate::run::Prepared;
use crate::score::{Outcome, SCORES, Window};
use crate::summary::{Score, summarise, summarise_ratios};
use crate::verdict::verdict;

/// The plain law that the others are measured against.
pub const PLAIN: &str = "velocity_servo";
/// What is compared with the plain law's, seed by seed.
pub const AGAINST_PLAIN: [&str; 5] =
    ["thrust_rms_n", "energy_j", "energy_per_impulse_j_n_s", "energy_over_ideal", "useful_impulse_n_s"];
/// Not a score of its own: thrust error over the plain law's.
pub const OF_PLAIN: &str = "of plain";

/// One controller in one scenario.
pub struct LawResult {
    /// Name of the controller.
    pub name: String,
    /// Scores over seeds, in the order of [`SCORES`]; NaN is not known.
    pub scores: Vec<(&'static str, Score)>,
    /// Scores seed by seed, for paired comparison.
    pub by_seed: Vec<BTreeMap<&'static str, f64>>,
    /// Worst window over all seeds.
    pub worst: Window,
}

impl LawResult {
    /// From the outcomes of all seeds.
    pub fn new(name: &str, outcomes: Vec<Outcome>) -> Self {
        let scores = SCORES
            .iter()
            .filter_map(|(score, _)| {
                let values: Vec<f64> = outcomes.iter().filter_map(|o| o.scores.get(score).copied()).collect();
                (!values.is_empty()).then(|| (*score, summarise(&values)))
            })
            .collect();
        let (by_seed, windows): (Vec<_>, Vec<_>) = outcomes.into_iter().map(|o| (o.scores, o.worst)).unzip();
        let worst = windows.into_iter().max_by(|a, b| a.rms_n.total_cmp(&b.rms_n)).unwrap_or_default();
        Self { name: name.into(), scores, by_seed, worst }
    }

    /// A score as a multiple of another law's, seed by seed: both met the same sea. None where either is not known.
    pub fn ratio(&self, to: &Self, score: &str) -> Option<Score> {
        let values: Option<Vec<f64>> =
            self.by_seed.iter().zip(&to.by_seed).map(|(a, b)| Some(a.get(score)? / b.get(score)?)).collect();
        let ratio = summarise_ratios(&values.filter(|v| !v.is_empty())?);
        let [low, high] = ratio.ends();
        [ratio.mean, low, high].iter().all(|x| x.is_finite()).then_some(ratio)
    }

    /// A score by name.
    pub fn score(&self, name: &str) -> Option<Score> {
        self.scores.iter().find(|(n, _)| *n == name).map(|(_, s)| *s)
    }

    /// Mean of a score; infinite if it was not measured.
    pub fn mean(&self, name: &str) -> f64 {
        self.score(name).map_or(f64::INFINITY, |s| s.mean)
    }

    /// No other law is better in both thrust error and energy per useful newton-second. Energy alone
    /// would honour a law for thrust it does not give.
    pub fn efficient(&self, laws: &[Self]) -> bool {
        let better = |o: &Self, score| o.mean(score) < self.mean(score);
        let told = self.name == limits::NAME;
        let mut others = laws.iter().filter(|o| o.name != limits::NAME);
        !told && !others.any(|o| better(o, "thrust_rms_n") && better(o, "energy_per_impulse_j_n_s"))
    }
}

/// One scenario.
pub struct ScenarioResult {
    /// Name of the scenario.
    pub name: String,
    /// What it is for.
    pub what: String,
    /// Name of the rig.
    pub rig: String,
    /// What the default law is held to, thrust error over the plain law's.
    pub aim_of_plain: f64,
    /// Largest steady thrust, N.
    pub thrust_max_n: f64,
    /// Its controllers, in the order asked for.
    pub laws: Vec<LawResult>,
    /// Words.
    pub verdict: String,
}

impl ScenarioResult {
    /// With its verdict.
    pub fn new(prepared: &Prepared, laws: Vec<LawResult>) -> Self {
        let scenario = prepared.scenario;
        Self {
            name: scenario.name.clone(),
            what: scenario.what.clone(),
            rig: prepared.rig.name.clone(),
            aim_of_plain: scenario.aim_of_plain,
            thrust_max_n: prepared.thrust_max_n,
            verdict: verdict(&laws),
            laws,
        }
    }

    /// A law by name.
    pub fn law(&self, name: &str) -> Option<&LawResult> {
        self.laws.iter().find(|l| l.name == name)
    }

    /// The law with the least thrust error.
    pub fn best(&self) -> Option<&LawResult> {
        let laws = self.laws.iter().filter(|l| l.name != limits::NAME);
        laws.min_by(|a, b| a.mean("thrust_rms_n").total_cmp(&b.mean("thrust_rms_n")))
    }

    /// A score, or the thrust error over the plain law's.
    pub fn figure(&self, law: &LawResult, score: &str) -> Option<Score> {
        if score == OF_PLAIN { law.ratio(self.plain()?, "thrust_rms_n") } else { law.score(score) }
    }

    /// The plain law, if it ran.
    pub fn plain(&self) -> Option<&LawResult> {
        self.law(PLAIN)
    }
}
