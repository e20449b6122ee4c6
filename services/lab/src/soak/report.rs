//! The comparison: scores with intervals over seeds, a verdict in words, text and JSON.

use std::fmt::Write;

use serde_json::{Map, Value, json};

use super::score::{Outcome, SCORES, Score, Window, summarise};

/// The plain law that the others are measured against.
const PLAIN: &str = "velocity_servo";

/// One controller in one scenario.
pub struct LawResult {
    /// Name of the controller.
    pub name: String,
    /// Scores over seeds, in the order of [`SCORES`].
    pub scores: Vec<(&'static str, Score)>,
    /// Thrust RMS and energy by seed, for paired comparison.
    pub by_seed: Vec<(f64, f64)>,
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
        let by_seed = outcomes.iter().map(|o| (o.scores["thrust_rms_n"], o.scores["energy_j"])).collect();
        let worst = outcomes
            .into_iter()
            .map(|o| o.worst)
            .max_by(|a, b| a.rms_n.total_cmp(&b.rms_n))
            .unwrap_or_default();
        Self { name: name.into(), scores, by_seed, worst }
    }

    /// A score by name.
    pub fn score(&self, name: &str) -> Option<Score> {
        self.scores.iter().find(|(n, _)| *n == name).map(|(_, s)| *s)
    }

    /// Mean of a score; infinite if it was not measured.
    pub fn mean(&self, name: &str) -> f64 {
        self.score(name).map_or(f64::INFINITY, |s| s.mean)
    }

    /// No other law is better in both thrust error and energy.
    pub fn efficient(&self, laws: &[Self]) -> bool {
        !laws.iter().any(|o| {
            o.mean("thrust_rms_n") < self.mean("thrust_rms_n") && o.mean("energy_j") < self.mean("energy_j")
        })
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

    /// The plain law, if it ran.
    pub fn plain(&self) -> Option<&LawResult> {
        self.laws.iter().find(|l| l.name == PLAIN)
    }
}

/// Ratio of two laws' figures, seed by seed: both met the same sea.
fn ratio(of: &LawResult, to: &LawResult, pick: fn(&(f64, f64)) -> f64) -> Score {
    let values: Vec<f64> = of.by_seed.iter().zip(&to.by_seed).map(|(a, b)| pick(a) / pick(b)).collect();
    summarise(&values)
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
        let (error, energy) = (ratio(best, plain, |x| x.0), ratio(best, plain, |x| x.1));
        let _ = write!(words, ", {} of {PLAIN}'s, for {} of its energy", interval(error), interval(energy));
    } else if plain.is_some() && order.len() > 1 {
        words += "; the plain law wins here";
    }
    if let Some(next) = order.get(1) {
        let lead = ratio(next, best, |x| x.0);
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
                        let scores: Map<String, Value> =
                            l.scores.iter().map(|(n, s)| ((*n).into(), json!(s))).collect();
                        json!({
                            "name": l.name,
                            "scores": scores,
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
            let columns: &[(&str, &str, usize)] = &[
                ("thrust_rms_n", "RMS N", 2),
                ("thrust_p95_n", "95 % N", 2),
                ("rise_time_s", "rise s", 3),
                ("settle_time_s", "settle s", 3),
                ("overshoot_pct", "over %", 1),
                ("energy_per_impulse_j_n_s", "J/Ns", 3),
                ("copper_loss_per_impulse_j_n_s", "I2R J/Ns", 3),
                ("saturation_share", "limit", 3),
                ("current_travel_a_s", "wear A/s", 1),
                ("flow_rms_m_s", "flow m/s", 3),
                ("parameter_error", "param", 3),
                ("faults_survived", "survived", 1),
                ("limits_broken", "broken", 0),
            ];
            let wide = s.laws.iter().map(|l| l.name.len()).max().unwrap_or(0).max(10);
            let _ = write!(out, "  {:wide$}", "controller");
            for (_, head, _) in columns {
                let _ = write!(out, " {head:>9}");
            }
            out.push('\n');
            for l in &s.laws {
                let _ = write!(out, "  {:wide$}", l.name);
                for (name, _, digits) in columns {
                    let _ = match l.score(name) {
                        Some(score) => write!(out, " {:>9.*}", digits, score.mean),
                        None => write!(out, " {:>9}", "-"),
                    };
                }
                let _ = writeln!(out, "{}", if l.efficient(&s.laws) { "  *" } else { "" });
            }
            let _ = writeln!(out, "  {}\n", s.verdict);
        }
        let _ = writeln!(
            out,
            "* no other law is better in both thrust error and energy; {:.0} virtual seconds in all",
            self.virtual_seconds
        );
        out
    }
}
