//! Opens one answer beside one report.

use std::collections::BTreeSet;

use kort_truth::{Answer, CaseKind};
use serde::Serialize;
use serde_json::Value;

/// A name given with its probability, and whether it is right.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Effect id.
    pub effect: String,
    /// Stated probability.
    pub probability: f64,
    /// Just this effect is hidden in the case: of two ids of the same physics one is wrong.
    pub right: bool,
}

/// One case with its answer open.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scored {
    /// What the case hides.
    pub kind: CaseKind,
    /// Its seed.
    pub seed: u64,
    /// Hidden ids.
    pub hidden: Vec<String>,
    /// Share of full scale wanted of the (weakest) hidden effect.
    pub strength: f64,
    /// The report's verdict.
    pub verdict: String,
    /// Named effects, best first.
    pub claims: Vec<Claim>,
    /// The first name is right.
    pub first_right: bool,
    /// The (first) hidden effect is among the names and their rivals.
    pub in_set: bool,
    /// Every hidden effect is named.
    pub all_named: bool,
    /// Every rival of a confounded case is listed.
    pub rivals_listed: bool,
    /// `unexplained`, and the right path.
    pub flagged_unknown: bool,
    /// A single name was claimed, and it is wrong.
    pub wrong_unique: bool,
    /// Held-out excess error that the first finding removes, if it is right.
    pub removed: f64,
    /// Time of the diagnosis, s.
    pub seconds: f64,
}

/// Counts one report against its answer.
pub fn open(answer: &Answer, report: &Value) -> Scored {
    let verdict = report["verdict"].as_str().unwrap_or("error").to_owned();
    let findings = report["findings"].as_array().map(Vec::as_slice).unwrap_or_default();
    let names: Vec<&str> = findings.iter().filter_map(|finding| finding["effect"].as_str()).collect();
    // A name is right if it, or another id of the same physics, is hidden.
    let truths: Vec<Vec<&str>> = answer
        .effects
        .iter()
        .map(|effect| std::iter::once(effect.effect).chain(effect.same_physics.iter().copied()).collect())
        .collect();
    let right = |name: &str| truths.iter().any(|ids| ids.contains(&name));
    let mut set: BTreeSet<&str> = names.iter().copied().collect();
    for finding in findings {
        set.extend(finding["confounded_with"].as_array().into_iter().flatten().filter_map(Value::as_str));
    }
    let listed = |id: &str| set.contains(id) || (same_physics(id).is_some_and(|other| set.contains(other)));
    let first_right = names.first().is_some_and(|name| right(name));
    Scored {
        kind: answer.kind,
        seed: answer.seed,
        hidden: answer.effects.iter().map(|effect| effect.effect.to_owned()).collect(),
        strength: answer.effects.iter().map(|effect| effect.wanted).fold(f64::INFINITY, f64::min),
        claims: findings
            .iter()
            .zip(&names)
            .map(|(finding, name)| Claim {
                effect: (*name).to_owned(),
                probability: finding["probability"].as_f64().unwrap_or(0.0),
                right: answer.effects.iter().any(|effect| effect.effect == *name),
            })
            .collect(),
        first_right,
        in_set: truths.first().is_some_and(|ids| ids.iter().any(|id| listed(id))),
        all_named: truths.iter().all(|ids| ids.iter().any(|id| names.contains(id))),
        rivals_listed: answer.confounded.iter().all(|id| set.contains(id)),
        flagged_unknown: verdict == "unexplained"
            && answer.effects.first().is_some_and(|e| path(report) == Some(e.path)),
        wrong_unique: verdict == "explained" && names.iter().any(|name| !right(name)),
        removed: if first_right {
            findings[0]["heldout"]["excess_error_removed"].as_f64().unwrap_or(0.0)
        } else {
            0.0
        },
        seconds: report["seconds"].as_f64().unwrap_or(0.0),
        verdict,
    }
}

/// Path that the report blames: of the empirical term, else of the first mismatch.
fn path(report: &Value) -> Option<&str> {
    report["empirical_term"]["path"].as_str().or_else(|| report["mismatch"][0]["path"].as_str())
}

fn same_physics(id: &str) -> Option<&'static str> {
    kort_truth::effects::Effect::ALL
        .into_iter()
        .find(|e| e.id() == id)
        .and_then(|e| e.same_physics().first().copied())
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_truth::HiddenEffect;
    use serde_json::json;

    fn answer(
        kind: CaseKind,
        effects: &[(&'static str, &'static str)],
        confounded: &[&'static str],
    ) -> Answer {
        let hidden = |&(effect, path): &(&'static str, &'static str)| HiddenEffect {
            effect,
            same_physics: same_physics(effect).into_iter().collect(),
            path,
            wanted: 0.03,
            share_of_full_scale: 0.03,
            channel: "thrust_n",
            visible_after_refit: 0.02,
        };
        Answer {
            kind,
            seed: 1,
            class: "small brushless",
            sections: 1,
            programme: "Full".into(),
            effects: effects.iter().map(hidden).collect(),
            confounded: confounded.to_vec(),
        }
    }

    fn named(verdict: &str, names: &[(&str, f64)]) -> Value {
        let findings: Vec<Value> = names
            .iter()
            .map(|(name, p)| {
                let others: Vec<&str> = names.iter().map(|n| n.0).filter(|other| other != name).collect();
                json!({ "effect": name, "probability": p, "confounded_with": others,
                        "heldout": { "excess_error_removed": 0.8 } })
            })
            .collect();
        json!({ "verdict": verdict, "findings": findings, "seconds": 2.0 })
    }

    #[test]
    fn a_right_name_counts_once_and_a_wrong_one_against() {
        let truth = answer(CaseKind::Single, &[("transport_delay", "drive")], &[]);
        let good = open(&truth, &named("explained", &[("transport_delay", 0.9)]));
        assert!(good.first_right && good.in_set && !good.wrong_unique && good.removed == 0.8);
        let bad = open(&truth, &named("explained", &[("amplifier_lag", 0.9)]));
        assert!(!bad.first_right && !bad.in_set && bad.wrong_unique && bad.removed == 0.0);
        let doubtful = open(&truth, &named("ambiguous", &[("amplifier_lag", 0.5), ("transport_delay", 0.4)]));
        assert!(!doubtful.first_right && doubtful.in_set && !doubtful.wrong_unique);
    }

    #[test]
    fn two_ids_of_the_same_physics_are_one() {
        let truth = answer(CaseKind::Single, &[("entrained_water_inertia", "shaft")], &[]);
        assert!(open(&truth, &named("explained", &[("rotor_inertia_error", 0.9)])).first_right);
    }

    #[test]
    fn pairs_need_both_and_confounded_cases_every_rival() {
        let pair = answer(CaseKind::Pair, &[("duct_loss", "flow"), ("clock_skew", "sensor")], &[]);
        assert!(!open(&pair, &named("explained", &[("duct_loss", 0.9)])).all_named);
        assert!(open(&pair, &named("explained", &[("clock_skew", 0.9), ("duct_loss", 0.9)])).all_named);
        let rivals = ["coulomb_friction", "torque_channel_bias"];
        let case = answer(CaseKind::Confounded, &[("coulomb_friction", "shaft")], &rivals);
        assert!(!open(&case, &named("explained", &[("coulomb_friction", 0.9)])).rivals_listed);
        assert!(
            open(&case, &named("ambiguous", &[("torque_channel_bias", 0.5), ("coulomb_friction", 0.5)]))
                .rivals_listed
        );
    }

    #[test]
    fn unknown_physics_is_flagged_only_on_its_path() {
        let truth = answer(CaseKind::Outside, &[("switched_load", "shaft")], &[]);
        let report = |path: &str| json!({ "verdict": "unexplained", "findings": [], "empirical_term": { "path": path } });
        assert!(open(&truth, &report("shaft")).flagged_unknown);
        assert!(!open(&truth, &report("blade")).flagged_unknown);
        assert!(!open(&truth, &named("no_mismatch", &[])).flagged_unknown);
    }

    #[test]
    fn a_report_without_the_expected_fields_counts_as_an_error() {
        let scored = open(&answer(CaseKind::Clean, &[], &[]), &json!({}));
        assert_eq!(scored.verdict, "error");
    }
}
