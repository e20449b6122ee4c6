//! Records for calibration: every probability that was stated beside what became of it, and folds by
//! effect family, machine or noise, so that constants are fitted on some and tested on the others.

use kort_truth::{Answer, families};
use serde::Serialize;
use serde_json::Value;

use crate::report::Report;
use crate::score::Scored;

/// By what cases are parted into folds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fold {
    /// The (first) hidden effect.
    Effect,
    /// The machine's class.
    Rig,
    /// The kinds of noise.
    Noise,
}

/// One stated probability.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Record {
    /// Kind of the case.
    pub kind: &'static str,
    /// Its seed.
    pub seed: u64,
    /// Machine class.
    pub class: String,
    /// Kinds of noise.
    pub noises: Vec<&'static str>,
    /// What was hidden.
    pub hidden: Vec<String>,
    /// Verdict.
    pub verdict: String,
    /// Named effect; none in the record of a case without a finding.
    pub effect: Option<String>,
    /// Stated probability of the finding.
    pub probability: Option<f64>,
    /// It is right.
    pub right: Option<bool>,
    /// Sets with their scores and probabilities, as the report gives them.
    pub explanations: Value,
    /// Evidence of the finding beside the rest, where the report gives numbers for it.
    pub evidence: Value,
    /// Fold of the case.
    pub fold: usize,
}

/// Fold of a case out of `count`: fixed by name, so that a fold never depends on what else is run.
pub fn fold_of(answer: &Answer, by: Fold, count: usize) -> usize {
    let count = count.max(1);
    match by {
        Fold::Effect => match answer.effects.first() {
            Some(hidden) => families::ALL
                .iter()
                .position(|family| family.id == hidden.effect)
                .map_or(count - 1, |place| place % count),
            None => answer.seed as usize % count,
        },
        Fold::Rig => answer.class.bytes().map(usize::from).sum::<usize>() % count,
        Fold::Noise => {
            answer
                .noises
                .iter()
                .filter(|noise| noise.noise != "white")
                .map(|noise| noise.noise.len())
                .sum::<usize>()
                % count
        }
    }
}

/// Records of one case: one a finding, or one that says that nothing was found.
pub fn records(scored: &Scored, answer: &Answer, report: &Value, by: Fold, folds: usize) -> Vec<Record> {
    let fold = fold_of(answer, by, folds);
    let record = |claim: Option<&crate::score::Claim>, evidence: Value| Record {
        kind: scored.kind.name(),
        seed: scored.seed,
        class: scored.class.clone(),
        noises: answer.noises.iter().map(|noise| noise.noise).collect(),
        hidden: scored.hidden.clone(),
        verdict: scored.verdict.clone(),
        effect: claim.map(|claim| claim.effect.clone()),
        probability: claim.map(|claim| claim.probability),
        right: claim.map(|claim| claim.right),
        explanations: report["explanations"].clone(),
        evidence,
        fold,
    };
    if scored.claims.is_empty() {
        return vec![record(None, Value::Null)];
    }
    let findings = Report(report).findings();
    scored
        .claims
        .iter()
        .zip(findings)
        .map(|(claim, named)| record(Some(claim), named.body.get("evidence").cloned().unwrap_or(Value::Null)))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_truth::{CaseKind, Selection, case};
    use serde_json::json;

    #[test]
    fn folds_are_fixed_by_name() {
        let of = |effect: &str, seed| {
            let selection = Selection { effect: Some(effect.into()), ..Selection::default() };
            fold_of(&case(CaseKind::Single, seed, &selection).answer, Fold::Effect, 5)
        };
        assert_eq!(of("amplifier_lag", 1), of("amplifier_lag", 6));
        assert_ne!(of("amplifier_lag", 1), of("blade_stall", 1));
    }

    #[test]
    fn a_case_without_findings_leaves_a_record_too() {
        let answer = case(CaseKind::Clean, 1, &Selection::default()).answer;
        let report = json!({ "verdict": "no_mismatch", "findings": [] });
        let scored = crate::score::open(&answer, &report);
        let list = records(&scored, &answer, &report, Fold::Rig, 3);
        assert_eq!((list.len(), &list[0].effect, list[0].fold < 3), (1, &None, true));
    }
}
