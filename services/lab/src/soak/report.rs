//! The whole comparison, as text and as JSON.

use std::fmt::Write;

use kort_soak::{AGAINST_PLAIN, OF_PLAIN, ScenarioResult, Score};
use serde_json::{Map, Value, json};

use super::adoption::{self, Adoption};

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
    /// What adopting diagnoses did, where that was asked for.
    pub adoption: Option<Vec<Adoption>>,
}

impl Report {
    /// All of it.
    pub fn new(seconds: f64, virtual_seconds: f64, scenarios: Vec<ScenarioResult>) -> Self {
        Self { seconds, virtual_seconds, scenarios, adoption: None }
    }

    /// With what adopting diagnoses did.
    pub fn with_adoption(self, adoption: Vec<Adoption>) -> Self {
        Self { adoption: Some(adoption), ..self }
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
                json!({ "name": s.name, "rig": s.rig, "what": s.what, "thrust_max_n": s.thrust_max_n, "laws": laws, "verdict": s.verdict })
            })
            .collect();
        let mut document = json!({
            "schema": "kort.soak/1",
            "seconds": self.seconds,
            "virtual_seconds": self.virtual_seconds,
            "scenarios": scenarios,
        });
        if let Some(adoption) = &self.adoption {
            document["adoption"] = json!(adoption);
        }
        document
    }

    /// Tables for a terminal.
    pub fn text(&self) -> String {
        let mut out = String::new();
        for s in &self.scenarios {
            let _ = writeln!(out, "{} on {}: {}", s.name, s.rig, s.what);
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
        if let Some(all) = &self.adoption {
            let _ = writeln!(out, "{}", adoption::text(all));
        }
        let _ = writeln!(
            out,
            "* no other law is better in both thrust error and energy per useful newton-second; {:.0} virtual seconds in all",
            self.virtual_seconds
        );
        out
    }
}
