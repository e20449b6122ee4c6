//! The comparison: scores with intervals over seeds, a verdict in words, text and JSON.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::score::{Outcome, SCORES, Score, Window, summarise, summarise_ratios};

/// The plain law that the others are measured against.
const PLAIN: &str = "velocity_servo";
/// What is compared with the plain law's, seed by seed.
const AGAINST_PLAIN: [&str; 5] =
    ["thrust_rms_n", "energy_j", "energy_per_impulse_j_n_s", "energy_over_ideal", "useful_impulse_n_s"];
/// What adaptation is held to: error over that with true parameters.
const RECOVERED: f64 = 1.2;

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

    /// A score as a multiple of another law's, seed by seed: both met the same sea.
    pub fn ratio(&self, to: &Self, score: &str) -> Option<Score> {
        let values: Option<Vec<f64>> =
            self.by_seed.iter().zip(&to.by_seed).map(|(a, b)| Some(a.get(score)? / b.get(score)?)).collect();
        values.filter(|v| !v.is_empty()).map(|v| summarise_ratios(&v))
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
        !laws.iter().any(|o| better(o, "thrust_rms_n") && better(o, "energy_per_impulse_j_n_s"))
    }
}

/// One scenario.
pub struct ScenarioResult {
    /// Name of the scenario.
    pub name: String,
    /// What it is for.
    pub what: String,
    /// Largest steady thrust, N.
    pub thrust_max_n: f64,
    /// Its controllers, in the order asked for.
    pub laws: Vec<LawResult>,
    /// Words.
    pub verdict: String,
}

impl ScenarioResult {
    /// With its verdict.
    pub fn new(name: &str, what: &str, thrust_max_n: f64, laws: Vec<LawResult>) -> Self {
        let verdict = verdict(&laws);
        Self { name: name.into(), what: what.into(), thrust_max_n, laws, verdict }
    }

    /// The law with the least thrust error.
    pub fn best(&self) -> Option<&LawResult> {
        self.laws.iter().min_by(|a, b| a.mean("thrust_rms_n").total_cmp(&b.mean("thrust_rms_n")))
    }

    /// A score, or the thrust error over the plain law's.
    pub fn figure(&self, law: &LawResult, score: &str) -> Option<Score> {
        if score == OF_PLAIN { law.ratio(self.plain()?, "thrust_rms_n") } else { law.score(score) }
    }

    /// The plain law, if it ran.
    pub fn plain(&self) -> Option<&LawResult> {
        self.laws.iter().find(|l| l.name == PLAIN)
    }
}

fn interval(s: Score) -> String {
    if s.ci95[0] == s.ci95[1] {
        format!("{:.3}", s.mean)
    } else {
        format!("{:.3} ({:.3} to {:.3})", s.mean, s.ci95[0], s.ci95[1])
    }
}

fn verdict(laws: &[LawResult]) -> String {
    let mut order: Vec<&LawResult> = laws.iter().collect();
    order.sort_by(|a, b| a.mean("thrust_rms_n").total_cmp(&b.mean("thrust_rms_n")));
    let Some(best) = order.first() else { return "nothing ran".into() };
    let mut words = format!(
        "{} has the least thrust error: {} N RMS",
        best.name,
        interval(best.score("thrust_rms_n").unwrap_or(Score { mean: 0.0, ci95: [0.0; 2] }))
    );
    let plain = laws.iter().find(|l| l.name == PLAIN);
    if let Some(plain) = plain.filter(|p| p.name != best.name) {
        let of = |score| best.ratio(plain, score).map_or_else(|| "an unknown share".into(), interval);
        let _ = write!(
            words,
            ", {} of {PLAIN}'s, for {} of its energy, {} of its energy per useful newton-second and {} of its energy over the ideal",
            of("thrust_rms_n"),
            of("energy_j"),
            of("energy_per_impulse_j_n_s"),
            of("energy_over_ideal")
        );
        words += &why_more_energy(best, plain);
    } else if plain.is_some() && order.len() > 1 {
        words += "; the plain law wins here";
    }
    if let Some((next, lead)) = order.get(1).and_then(|next| Some((next, next.ratio(best, "thrust_rms_n")?)))
    {
        if best.by_seed.len() < 2 {
            let _ = write!(
                words,
                ". Next is {} at {:.3} of it; one seed gives no interval, so how sure this is cannot be said",
                next.name, lead.mean
            );
        } else if lead.ci95[0] > 1.0 {
            let _ = write!(
                words,
                ". Next is {} at {} of it: the order is beyond the doubt of {} seeds",
                next.name,
                interval(lead),
                best.by_seed.len()
            );
        } else {
            let _ = write!(
                words,
                ". {} is as good within the doubt of {} seeds: {} of it",
                next.name,
                best.by_seed.len(),
                interval(lead)
            );
        }
    }
    words += &recovered(laws);
    let broken: Vec<&str> =
        laws.iter().filter(|l| l.mean("limits_broken") > 0.0).map(|l| l.name.as_str()).collect();
    if !broken.is_empty() {
        let _ = write!(words, ". LIMITS BROKEN by {}", broken.join(", "));
    }
    let lost: Vec<&str> = laws
        .iter()
        .filter(|l| l.mean("faults_survived") < l.mean("faults_injected"))
        .map(|l| l.name.as_str())
        .collect();
    if !lost.is_empty() {
        let _ = write!(words, ". Not every fault was recovered from by {}", lost.join(", "));
    }
    words + "."
}

/// Where the better law takes more energy: because it gives thrust that the plain law does not, or
/// because it gives it at a worse efficiency.
fn why_more_energy(best: &LawResult, plain: &LawResult) -> String {
    let of = |score| best.ratio(plain, score);
    let (Some(energy), Some(ideal), Some(useful)) =
        (of("energy_j"), of("energy_over_ideal"), of("useful_impulse_n_s"))
    else {
        return String::new();
    };
    if energy.ci95[0] <= 1.0 {
        return String::new();
    }
    // Within a hundredth is the same: one seed has no interval.
    let efficiency = if ideal.ci95[1] < 0.99 {
        "better"
    } else if ideal.ci95[0] <= 1.01 {
        "the same"
    } else {
        "worse"
    };
    format!(
        ": more energy, as it gives {:.3} of the useful newton-seconds, at {efficiency} efficiency",
        useful.mean
    )
}

/// How near the adapting laws come to their error with true parameters, where that was run.
fn recovered(laws: &[LawResult]) -> String {
    let of: Vec<(&LawResult, Score)> =
        laws.iter().filter_map(|l| Some((l, l.score("error_over_true_parameters")?))).collect();
    if of.is_empty() {
        return String::new();
    }
    let list = |adapts: bool| {
        let some = of.iter().filter(|(l, _)| l.score("parameter_error").is_some() == adapts);
        some.map(|(l, s)| format!("{} {}", l.name, interval(*s))).collect::<Vec<_>>().join(", ")
    };
    let mut words = format!(
        ". Error as a multiple of that with true parameters told: {}",
        [list(true), list(false)]
            .into_iter()
            .filter(|l| !l.is_empty())
            .collect::<Vec<_>>()
            .join("; without adaptation ")
    );
    let adapting = of.iter().filter(|(l, _)| l.score("parameter_error").is_some());
    let (back, short): (Vec<_>, Vec<_>) = adapting.partition(|(_, s)| s.mean <= RECOVERED);
    for (laws, which) in [(back, "Back within"), (short, "NOT back within")] {
        let names: Vec<&str> = laws.iter().map(|(l, _)| l.name.as_str()).collect();
        if !names.is_empty() {
            let _ = write!(words, ". {which} {RECOVERED}: {}", names.join(", "));
        }
    }
    words
}

/// Not a score of its own: thrust error over the plain law's.
pub const OF_PLAIN: &str = "of plain";

/// Columns of the text: score, heading, digits.
const COLUMNS: [(&str, &str, usize); 18] = [
    ("thrust_rms_n", "RMS N", 2),
    (OF_PLAIN, OF_PLAIN, 3),
    ("thrust_p95_n", "95 % N", 2),
    ("rise_time_s", "rise s", 3),
    ("settle_time_s", "settle s", 3),
    ("overshoot_pct", "over %", 1),
    ("energy_j", "energy J", 0),
    ("energy_per_impulse_j_n_s", "J/Ns", 3),
    ("energy_over_ideal", "of ideal", 3),
    ("copper_loss_per_impulse_j_n_s", "I2R J/Ns", 3),
    ("saturation_share", "limit", 3),
    ("current_travel_a_s", "wear A/s", 1),
    ("flow_rms_m_s", "flow m/s", 3),
    ("parameter_error", "param", 3),
    ("error_over_true_parameters", "of true", 3),
    ("faults_injected", "faults", 1),
    ("faults_survived", "survived", 1),
    ("limits_broken", "broken", 0),
];

/// The whole comparison.
pub struct Report {
    /// Length of the script, s: every scenario once. The time it took is no part of the result, as
    /// the same input gives the same document.
    pub seconds: f64,
    /// Time that passed for the thrusters, all runs together, s.
    pub virtual_seconds: f64,
    /// Scenario by scenario.
    pub scenarios: Vec<ScenarioResult>,
}

impl Report {
    /// All of it.
    pub fn new(seconds: f64, virtual_seconds: f64, scenarios: Vec<ScenarioResult>) -> Self {
        Self { seconds, virtual_seconds, scenarios }
    }

    /// As of the contracts.
    pub fn json(&self) -> Value {
        let scenarios: Vec<Value> = self
            .scenarios
            .iter()
            .map(|s| {
                let laws: Vec<Value> = s
                    .laws
                    .iter()
                    .map(|l| {
                        let known = |s: &Score| if s.mean.is_nan() { Value::Null } else { json!(s) };
                        let scores: Map<String, Value> =
                            l.scores.iter().map(|(n, s)| ((*n).into(), known(s))).collect();
                        let against: Option<Map<String, Value>> = s.plain().map(|plain| {
                            let ratio = |n: &str| Some((n.into(), known(&l.ratio(plain, n)?)));
                            AGAINST_PLAIN.into_iter().filter_map(ratio).collect()
                        });
                        json!({
                            "name": l.name,
                            "scores": scores,
                            "against_plain": against,
                            "seeds": l.by_seed.len(),
                            "pareto": l.efficient(&s.laws),
                            "worst_window": {
                                "rms_n": l.worst.rms_n,
                                "time_s": [l.worst.points.first().map_or(0.0, |p| p[0]), l.worst.points.last().map_or(0.0, |p| p[0])],
                            },
                        })
                    })
                    .collect();
                json!({ "name": s.name, "what": s.what, "thrust_max_n": s.thrust_max_n, "laws": laws, "verdict": s.verdict })
            })
            .collect();
        json!({
            "schema": "kort.soak/1",
            "seconds": self.seconds,
            "virtual_seconds": self.virtual_seconds,
            "scenarios": scenarios,
        })
    }

    /// Tables for a terminal.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for s in &self.scenarios {
            let _ = writeln!(out, "{}: {}", s.name, s.what);
            // Where no fault was put in, none survived says nothing.
            let faults = s.laws.iter().any(|l| l.score("faults_injected").is_some_and(|f| f.mean > 0.0));
            let shown = |score: &str| {
                (faults || !score.starts_with("faults_"))
                    && s.laws.iter().any(|l| s.figure(l, score).is_some())
            };
            let columns: Vec<_> = COLUMNS.iter().filter(|(score, ..)| shown(score)).collect();
            let wide = s.laws.iter().map(|l| l.name.len()).max().unwrap_or(0).max(10);
            let _ = write!(out, "  {:wide$}", "controller");
            for (_, head, _) in &columns {
                let _ = write!(out, " {head:>9}");
            }
            out.push('\n');
            for l in &s.laws {
                let _ = write!(out, "  {:wide$}", l.name);
                for (score, _, digits) in &columns {
                    let _ = match s.figure(l, score).map(|x| x.mean) {
                        Some(x) if x.is_nan() => write!(out, " {:>9}", "not known"),
                        Some(x) => write!(out, " {x:>9.digits$}"),
                        None => write!(out, " {:>9}", "-"),
                    };
                }
                let _ = writeln!(out, "{}", if l.efficient(&s.laws) { "  *" } else { "" });
            }
            let _ = writeln!(out, "  {}\n", s.verdict);
        }
        let _ = writeln!(
            out,
            "* no other law is better in both thrust error and energy per useful newton-second; {:.0} virtual seconds in all",
            self.virtual_seconds
        );
        out
    }
}
