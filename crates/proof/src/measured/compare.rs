//! One report against the key of its recording.

use serde::Serialize;
use serde_json::Value;

use super::key::Answer;
use super::sizes::{Size, sizes};
use crate::report::Report;

/// Above this a finding is sure.
const SURE: f64 = 0.9;
/// Above this an absent effect is claimed.
const CLAIMED: f64 = 0.5;

/// One recording, diagnosed and compared.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Compared {
    /// Folder.
    pub set: String,
    /// File.
    pub recording: String,
    /// Verdict; `error` if it was refused.
    pub verdict: String,
    /// Why it was refused.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub refused: Option<String>,
    /// Effects of the key that are in the catalogue.
    pub present: Vec<String>,
    /// Those that are findings.
    pub found: Vec<String>,
    /// Those that are no finding but named as a rival of one.
    pub listed: Vec<String>,
    /// Those that are neither.
    pub missed: Vec<String>,
    /// Findings with their probability.
    pub findings: Vec<(String, f64)>,
    /// Findings above 0.9 that the key does not know: neither present, nor untellable, nor acceptable.
    pub sure_and_wrong: Vec<String>,
    /// Effects that the key says are absent and the report gives more than 0.5.
    pub absent_claimed: Vec<String>,
    /// Findings above 0.9, alone in an `explained` verdict, that the key says cannot be told.
    pub unique_but_untellable: Vec<String>,
    /// Effects of the key that no catalogue entry stands for.
    pub not_in_catalogue: Vec<String>,
    /// Sizes that both give.
    pub sizes: Vec<Size>,
    /// Mean error of the baseline over its channels, held out, share of full scale.
    pub nrmse_before: Option<f64>,
    /// And with what was found.
    pub nrmse_after: Option<f64>,
    /// Held-out excess error that the best right finding removes.
    pub removed: Option<f64>,
    /// Errors of the key's own fits without and with what is present, % of full scale.
    pub key_error_pct_fs: (Option<f64>, Option<f64>),
    /// Time of the diagnosis, s.
    pub seconds: f64,
}

/// Holds a report, or a refusal, against what the key says.
pub fn compare(
    set: &str,
    recording: &str,
    answer: &Answer,
    report: Result<Value, String>,
    catalogue: &[&str],
) -> Compared {
    let (body, refused) = match report {
        Ok(body) => (body, None),
        Err(message) => (Value::Null, Some(message)),
    };
    let report = Report(&body);
    let findings = report.findings();
    let known = |id: &str| catalogue.contains(&id);
    let (present, unknown): (Vec<_>, Vec<_>) =
        answer.present.iter().partition(|present| known(&present.effect));
    let ids = |list: Vec<&super::key::Present>| {
        list.into_iter().map(|present| present.effect.clone()).collect::<Vec<_>>()
    };
    let not_in_catalogue = ids(unknown);
    let is_found = |id: &str| findings.iter().any(|named| named.effect == id);
    let candidates = report.candidates();
    let sizes = present.iter().flat_map(|present| sizes(&present.effect, &present.size, &report)).collect();
    let present = ids(present);
    let holds = |list: &[String], id: &str| list.iter().any(|other| other == id);
    let sure: Vec<&str> =
        findings.iter().filter(|named| named.probability > SURE).map(|named| named.effect).collect();
    let wrong =
        |id: &&str| !holds(&present, id) && !holds(&answer.cannot_tell, id) && !holds(&answer.reduced, id);
    let alone = report.verdict() == "explained" && findings.len() == 1;
    let (nrmse_before, nrmse_after) = report.errors();
    let part =
        |pick: &dyn Fn(&str) -> bool| present.iter().filter(|id| pick(id)).cloned().collect::<Vec<_>>();
    Compared {
        set: set.into(),
        recording: recording.into(),
        verdict: report.verdict().into(),
        refused,
        found: part(&|id| is_found(id)),
        listed: part(&|id| !is_found(id) && candidates.contains(&id)),
        missed: part(&|id| !candidates.contains(&id)),
        sure_and_wrong: sure.iter().filter(|id| wrong(id)).map(|id| (*id).to_owned()).collect(),
        absent_claimed: answer.absent.iter().filter(|id| report.probability(id) > CLAIMED).cloned().collect(),
        unique_but_untellable: sure
            .iter()
            .filter(|id| alone && holds(&answer.cannot_tell, id) && !holds(&present, id))
            .map(|id| (*id).to_owned())
            .collect(),
        removed: findings
            .iter()
            .filter(|named| holds(&present, named.effect))
            .map(|named| named.removed)
            .max_by(f64::total_cmp),
        findings: findings.iter().map(|named| (named.effect.to_owned(), named.probability)).collect(),
        present,
        not_in_catalogue,
        sizes,
        nrmse_before,
        nrmse_after,
        key_error_pct_fs: answer.error_pct_fs,
        seconds: report.seconds(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::key::Present;
    use super::*;
    use serde_json::json;

    fn answer() -> Answer {
        let present = |effect: &str| Present { effect: effect.into(), size: toml::Table::new() };
        Answer {
            present: vec![present("coulomb_friction"), present("transport_delay"), present("drive_released")],
            absent: vec!["windage_drag".into()],
            cannot_tell: vec!["viscous_friction".into()],
            reduced: vec!["amplifier_lag".into()],
            error_pct_fs: (Some(5.0), None),
        }
    }

    const CATALOGUE: [&str; 5] =
        ["coulomb_friction", "transport_delay", "windage_drag", "viscous_friction", "amplifier_lag"];

    fn finding(effect: &str, probability: f64, rivals: &[&str]) -> Value {
        json!({ "effect": effect, "probability": probability, "confounded_with": rivals,
                "heldout": { "excess_error_removed": 0.6 } })
    }

    #[test]
    fn what_is_found_listed_missed_and_wrong() {
        let report = json!({ "verdict": "explained", "findings": [
            finding("coulomb_friction", 0.95, &[]), finding("windage_drag", 0.95, &["transport_delay"]),
            finding("amplifier_lag", 0.95, &[]), finding("viscous_friction", 0.95, &[]) ] });
        let compared = compare("s", "r", &answer(), Ok(report), &CATALOGUE);
        assert_eq!(
            (compared.found.as_slice(), compared.listed.as_slice()),
            (&["coulomb_friction".to_string()][..], &["transport_delay".to_string()][..])
        );
        assert!(compared.missed.is_empty());
        assert_eq!(compared.not_in_catalogue, ["drive_released"]);
        assert_eq!(
            compared.sure_and_wrong,
            ["windage_drag"],
            "neither what is acceptable nor what cannot be told"
        );
        assert_eq!(compared.absent_claimed, ["windage_drag"]);
        assert!(compared.unique_but_untellable.is_empty());
        assert_eq!(compared.removed, Some(0.6));
    }

    #[test]
    fn a_unique_claim_of_what_cannot_be_told_is_marked() {
        let report = json!({ "verdict": "explained", "findings": [finding("viscous_friction", 0.95, &[])] });
        assert_eq!(
            compare("s", "r", &answer(), Ok(report), &CATALOGUE).unique_but_untellable,
            ["viscous_friction"]
        );
    }

    #[test]
    fn a_refusal_misses_all_and_says_why() {
        let compared = compare("s", "r", &answer(), Err("no driving column".into()), &CATALOGUE);
        assert_eq!((compared.verdict.as_str(), compared.missed.len()), ("error", 2));
        assert_eq!(compared.refused.as_deref(), Some("no driving column"));
    }
}
