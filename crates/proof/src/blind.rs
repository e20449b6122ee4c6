//! The blind proof: which cases, and how each is put before the diagnosis.

use kort_truth::{Answer, Case, CaseKind, Selection, case};
use serde_json::{Value, json};

use crate::score::{self, Scored};
use crate::{Diagnosis, File};

/// Cases of each kind in the full proof.
pub const FULL: [(CaseKind, u32); 6] = [
    (CaseKind::Single, 150),
    (CaseKind::Clean, 100),
    (CaseKind::Pair, 30),
    (CaseKind::Several, 20),
    (CaseKind::Confounded, 30),
    (CaseKind::Outside, 30),
];

/// Kind and seed of every case of a proof of about `wanted` cases from a first seed; some of each kind
/// that is asked for (none named: all kinds).
pub fn plan(wanted: Option<u32>, first_seed: u64, kinds: &[CaseKind]) -> Vec<(CaseKind, u64)> {
    let chosen = || FULL.iter().filter(|(kind, _)| kinds.is_empty() || kinds.contains(kind));
    let full: u32 = chosen().map(|(_, count)| count).sum();
    let wanted = wanted.unwrap_or(full);
    let share = |count: u32| (f64::from(count) * f64::from(wanted) / f64::from(full)).round().max(1.0) as u64;
    chosen()
        .flat_map(|&(kind, count)| (0..share(count)).map(move |index| (kind, first_seed + index)))
        .collect()
}

/// Seeds that a plan uses, first and one past the last.
pub fn seeds(plan: &[(CaseKind, u64)]) -> std::ops::Range<u64> {
    let first = plan.iter().map(|(_, seed)| *seed).min().unwrap_or(0);
    first..plan.iter().map(|(_, seed)| seed + 1).max().unwrap_or(first)
}

/// Builds a case, diagnoses its two files, and only then opens the answer. A refusal counts as a report
/// whose verdict is `error`.
pub fn prove_one(
    kind: CaseKind,
    seed: u64,
    selection: &Selection,
    diagnosis: &dyn Diagnosis,
) -> (Scored, Answer, Value) {
    let Case { recording_csv, rig_toml, answer } = case(kind, seed, selection);
    let recording = File { name: "recording.csv".into(), bytes: recording_csv.into_bytes() };
    let report = diagnosis
        .diagnose(&[recording], &rig_toml)
        .unwrap_or_else(|message| json!({ "verdict": "error", "summary": message }));
    (score::open(&answer, &report), answer, report)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_small_proof_keeps_every_kind_and_a_full_one_its_sizes() {
        let small = plan(Some(6), 5, &[]);
        assert!(CaseKind::ALL.into_iter().all(|kind| small.iter().any(|(k, _)| *k == kind)));
        let full = plan(None, 100, &[]);
        for (kind, count) in FULL {
            assert_eq!(full.iter().filter(|(k, _)| *k == kind).count(), count as usize);
        }
        assert_eq!(seeds(&full), 100..250);
        assert!(plan(Some(40), 1, &[CaseKind::Pair]).iter().all(|(kind, _)| *kind == CaseKind::Pair));
        assert_eq!(plan(Some(40), 1, &[CaseKind::Pair]).len(), 40);
    }
}
