//! Opens one answer beside one report.

use kort_truth::{Answer, CaseKind, HiddenEffect};
use serde::Serialize;
use serde_json::Value;

use crate::report::Report;

/// A name given with its probability, and whether it is right.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Claim {
    /// Effect id.
    pub effect: String,
    /// Stated probability.
    pub probability: f64,
    /// It is hidden in the case, or is a right name for a noise that is in it. Of two ids of the same
    /// physics that are both named, the one that was not hidden is wrong.
    pub right: bool,
}

/// One case with its answer open.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Scored {
    /// What the case hides.
    pub kind: CaseKind,
    /// Its seed.
    pub seed: u64,
    /// Machine class.
    pub class: String,
    /// There is no water.
    pub dry: bool,
    /// Hidden ids.
    pub hidden: Vec<String>,
    /// Share of full scale wanted of the weakest hidden effect; zero where nothing is hidden.
    pub strength: f64,
    /// A re-fit within the stated tolerances leaves enough of every effect to ask for it.
    pub askable: bool,
    /// The report's verdict.
    pub verdict: String,
    /// Named effects, best first.
    pub claims: Vec<Claim>,
    /// The first name is right.
    pub first_right: bool,
    /// The (first) hidden effect is among the names and their rivals.
    pub in_set: bool,
    /// Hidden effects that are named.
    pub named: usize,
    /// Every rival of a confounded case is listed.
    pub rivals_listed: bool,
    /// Physics without a name is flagged.
    pub flagged: bool,
    /// The path blamed for it is the right one.
    pub right_path: bool,
    /// A mismatch is reported, and not only noise by its right name.
    pub alarm: bool,
    /// `explained` with a wrong name.
    pub wrong_unique: bool,
    /// Held-out excess error that the first finding removes, if it is right.
    pub removed: f64,
    /// Time of the diagnosis, s.
    pub seconds: f64,
}

/// Share of an effect's size that a re-fit must leave for the effect to be asked for.
const ASKED: f64 = 0.15;

/// A name stands for a hidden effect: its id, another id of the same physics, or one of a set that
/// together does the same.
pub(crate) fn stands_for(name: &str, hidden: &HiddenEffect) -> bool {
    hidden.effect == name
        || hidden.same_physics.contains(&name)
        || hidden.same_sets.iter().any(|set| set.contains(&name))
}

/// A hidden effect is named: by an id of the same physics, or by a whole set that does the same.
fn is_named(hidden: &HiddenEffect, names: &[&str]) -> bool {
    names.iter().any(|name| hidden.effect == *name || hidden.same_physics.contains(name))
        || hidden.same_sets.iter().any(|set| set.iter().all(|id| names.contains(id)))
}

/// Counts one report against its answer.
pub fn open(answer: &Answer, report: &Value) -> Scored {
    let report = Report(report);
    let findings = report.findings();
    let names: Vec<&str> = findings.iter().map(|named| named.effect).collect();
    let noise = |name: &str| answer.noises.iter().any(|noise| noise.names.contains(&name));
    let hides = |name: &str| answer.effects.iter().any(|hidden| hidden.effect == name);
    let right = |name: &str| answer.effects.iter().any(|hidden| stands_for(name, hidden));
    // For the calibration just one of two ids of the same physics is right where both are named.
    let right_alone = |name: &str| {
        hides(name)
            || noise(name)
            || answer.effects.iter().any(|hidden| {
                stands_for(name, hidden)
                    && !(hidden.same_physics.contains(&name) && names.contains(&hidden.effect.as_str()))
            })
    };
    let candidates = report.candidates();
    let first = findings.first();
    let first_right = first.is_some_and(|named| right(named.effect));
    let verdict = report.verdict();
    let quiet = matches!(verdict, "no_mismatch" | "insufficient_data" | "error");
    Scored {
        kind: answer.kind,
        seed: answer.seed,
        class: answer.class.to_owned(),
        dry: answer.dry,
        hidden: answer.effects.iter().map(|hidden| hidden.effect.clone()).collect(),
        strength: answer.effects.iter().map(|hidden| hidden.wanted).reduce(f64::min).unwrap_or(0.0),
        askable: answer
            .effects
            .iter()
            .all(|hidden| hidden.visible_after_refit >= ASKED * hidden.share_of_full_scale),
        verdict: verdict.to_owned(),
        claims: findings
            .iter()
            .map(|named| Claim {
                effect: named.effect.to_owned(),
                probability: named.probability,
                right: right_alone(named.effect),
            })
            .collect(),
        first_right,
        in_set: answer
            .effects
            .first()
            .is_some_and(|hidden| candidates.iter().any(|id| stands_for(id, hidden))),
        named: answer.effects.iter().filter(|hidden| is_named(hidden, &names)).count(),
        rivals_listed: answer.confounded.iter().all(|id| candidates.contains(id)),
        flagged: report.flags_nameless(),
        right_path: answer.effects.first().is_some_and(|hidden| report.nameless_path() == Some(hidden.path)),
        alarm: !quiet && (names.is_empty() || names.iter().any(|name| !noise(name))),
        wrong_unique: verdict == "explained" && names.iter().any(|name| !right(name) && !noise(name)),
        removed: first.filter(|_| first_right).map_or(0.0, |named| named.removed),
        seconds: report.seconds(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_truth::Nuisance;
    use serde_json::json;

    fn hidden(effect: &str, path: &'static str) -> HiddenEffect {
        HiddenEffect {
            effect: effect.to_owned(),
            form: String::new(),
            same_physics: Vec::new(),
            same_sets: Vec::new(),
            path,
            wanted: 0.03,
            share_of_full_scale: 0.03,
            channel: "thrust_n",
            visible_after_refit: 0.02,
        }
    }

    fn answer(kind: CaseKind, effects: Vec<HiddenEffect>, confounded: &[&'static str]) -> Answer {
        Answer {
            kind,
            seed: 1,
            class: "small brushless",
            dry: false,
            sections: 1,
            excitation: "Full".into(),
            closed_loop: None,
            stamps: "Even".into(),
            noises: Vec::new(),
            effects,
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
        json!({ "verdict": verdict, "findings": findings, "took_seconds": 2.0 })
    }

    #[test]
    fn a_right_name_counts_and_a_wrong_one_counts_against() {
        let truth = answer(CaseKind::Single, vec![hidden("transport_delay", "drive")], &[]);
        let good = open(&truth, &named("explained", &[("transport_delay", 0.9)]));
        assert!(
            good.first_right && good.in_set && !good.wrong_unique && good.removed == 0.8 && good.named == 1
        );
        let bad = open(&truth, &named("explained", &[("amplifier_lag", 0.9)]));
        assert!(!bad.first_right && !bad.in_set && bad.wrong_unique && bad.removed == 0.0 && bad.named == 0);
        let doubtful = open(&truth, &named("ambiguous", &[("amplifier_lag", 0.5), ("transport_delay", 0.4)]));
        assert!(!doubtful.first_right && doubtful.in_set && !doubtful.wrong_unique);
    }

    #[test]
    fn two_ids_of_the_same_physics_are_one_but_both_cannot_be_right() {
        let mut inertia = hidden("entrained_water_inertia", "shaft");
        inertia.same_physics = vec!["rotor_inertia_error"];
        let truth = answer(CaseKind::Single, vec![inertia], &[]);
        let twin = open(&truth, &named("explained", &[("rotor_inertia_error", 0.9)]));
        assert!(twin.first_right && twin.claims[0].right);
        let both = open(
            &truth,
            &named("ambiguous", &[("rotor_inertia_error", 0.5), ("entrained_water_inertia", 0.5)]),
        );
        assert_eq!(both.claims.iter().filter(|claim| claim.right).count(), 1);
    }

    #[test]
    fn a_set_that_does_the_same_counts_only_whole() {
        let mut friction = hidden("direction_dependent_friction", "shaft");
        friction.same_sets = vec![vec!["coulomb_friction", "torque_channel_bias"]];
        let truth = answer(CaseKind::Single, vec![friction], &[]);
        let half = open(&truth, &named("explained", &[("coulomb_friction", 0.9)]));
        assert!(half.first_right && half.named == 0);
        let whole =
            open(&truth, &named("explained", &[("coulomb_friction", 0.9), ("torque_channel_bias", 0.9)]));
        assert!(whole.named == 1 && !whole.wrong_unique);
    }

    #[test]
    fn noise_by_its_right_name_is_no_alarm() {
        let mut truth = answer(CaseKind::Clean, Vec::new(), &[]);
        truth.noises = vec![Nuisance { noise: "turn_ripple", names: vec!["encoder_eccentricity"] }];
        assert!(!open(&truth, &named("explained", &[("encoder_eccentricity", 0.9)])).alarm);
        assert!(open(&truth, &named("explained", &[("clock_skew", 0.9)])).alarm);
        assert!(open(&truth, &json!({ "verdict": "unexplained", "findings": [] })).alarm);
        assert!(!open(&truth, &json!({ "verdict": "no_mismatch", "findings": [] })).alarm);
    }

    #[test]
    fn confounded_cases_need_every_rival() {
        let rivals = ["coulomb_friction", "torque_channel_bias"];
        let case = answer(CaseKind::Confounded, vec![hidden("coulomb_friction", "shaft")], &rivals);
        assert!(!open(&case, &named("explained", &[("coulomb_friction", 0.9)])).rivals_listed);
        let listed = named("ambiguous", &[("torque_channel_bias", 0.5), ("coulomb_friction", 0.5)]);
        assert!(open(&case, &listed).rivals_listed);
    }

    #[test]
    fn unknown_physics_is_flagged_and_placed() {
        let truth = answer(CaseKind::Outside, vec![hidden("outside_shaft", "shaft")], &[]);
        let report = |path: &str| json!({ "verdict": "unexplained", "findings": [], "empirical_term": { "path": path } });
        let right = open(&truth, &report("shaft"));
        assert!(right.flagged && right.right_path);
        let wrong = open(&truth, &report("blade"));
        assert!(wrong.flagged && !wrong.right_path);
        assert!(!open(&truth, &named("no_mismatch", &[])).flagged);
        let partly =
            json!({ "verdict": "partly_explained", "remainder": { "path": "shaft" }, "findings": [] });
        assert!(open(&truth, &partly).right_path);
    }

    #[test]
    fn a_report_without_the_expected_fields_counts_as_an_error() {
        assert_eq!(open(&answer(CaseKind::Clean, Vec::new(), &[]), &json!({})).verdict, "error");
    }
}
