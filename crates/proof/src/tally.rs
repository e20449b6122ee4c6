//! Measures over all cases.

use std::collections::BTreeMap;

use kort_truth::CaseKind;
use serde_json::{Value, json};

use crate::Stamp;
use crate::measure::{Bar, Measure, by_name};
use crate::score::{Claim, Scored};

/// Bins of the calibration.
pub const BINS: usize = 10;
/// A finding above this is sure.
const SURE: f64 = 0.9;

/// Findings whose probability lies in one bin.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Bin {
    /// Findings.
    pub count: usize,
    /// Mean stated probability.
    pub stated: f64,
    /// Share that is right.
    pub right: f64,
}

/// The blind proof, counted.
pub struct Proof {
    /// First seed.
    pub seed: u64,
    /// Seeds are for tuning: nothing here is to be reported.
    pub tuning: bool,
    /// What it was made with.
    pub stamp: Stamp,
    /// Every case.
    pub cases: Vec<Scored>,
    /// The measures of the contract, in its order, and more.
    pub measures: Vec<Measure>,
    /// Calibration of `probability`.
    pub bins: Vec<Bin>,
}

impl Proof {
    /// Counts.
    pub fn new(seed: u64, tuning: bool, stamp: Stamp, cases: Vec<Scored>) -> Self {
        let bins = calibration(cases.iter().flat_map(|case| &case.claims));
        let measures = measures(&cases, &bins);
        Proof { seed, tuning, stamp, cases, measures, bins }
    }

    /// Hidden id (single effects) against the first name given, or the verdict where none is given.
    pub fn confusion(&self) -> BTreeMap<String, BTreeMap<String, usize>> {
        let mut table: BTreeMap<String, BTreeMap<String, usize>> = BTreeMap::new();
        for case in self.cases.iter().filter(|case| matches!(case.kind, CaseKind::Single | CaseKind::Clean)) {
            let hidden = case.hidden.first().map_or("nothing", String::as_str);
            let named = case.claims.first().map_or(case.verdict.as_str(), |claim| claim.effect.as_str());
            *table.entry(hidden.to_owned()).or_default().entry(named.to_owned()).or_default() += 1;
        }
        table
    }

    /// The document `kort.prove/1`.
    pub fn json(&self) -> Value {
        let bins: Vec<Value> = self
            .bins
            .iter()
            .map(|bin| json!({ "count": bin.count, "stated": bin.stated, "right": bin.right }))
            .collect();
        json!({ "schema": "kort.prove/1", "kort_version": env!("CARGO_PKG_VERSION"), "commit": self.stamp.commit,
                "constants": self.stamp.constants, "seed": self.seed, "tuning": self.tuning,
                "cases": self.cases.len(), "measures": by_name(&self.measures), "confusion": self.confusion(),
                "calibration": bins, "results": self.cases })
    }
}

fn measures(cases: &[Scored], bins: &[Bin]) -> Vec<Measure> {
    use CaseKind::*;
    let of = |kind: CaseKind| cases.iter().filter(move |case| case.kind == kind);
    let asked = || of(Single).filter(|case| case.askable);
    let strong = || asked().filter(|case| case.strength >= 0.03);
    let seconds: f64 = cases.iter().map(|case| case.seconds).sum();
    let claims: usize = bins.iter().map(|bin| bin.count).sum();
    let off: f64 = bins.iter().map(|bin| bin.count as f64 * (bin.right - bin.stated).abs()).sum();
    let sure = || cases.iter().flat_map(|case| &case.claims).filter(|claim| claim.probability > SURE);
    vec![
        Measure::share(
            "top1_strong",
            "right effect first, 3 % of full scale and above",
            Some(Bar::AtLeast(0.96)),
            strong().map(|case| case.first_right),
        ),
        Measure::share(
            "top1_weak",
            "right effect first, 1.2 % of full scale",
            Some(Bar::AtLeast(0.85)),
            asked().filter(|case| case.strength < 0.03).map(|case| case.first_right),
        ),
        Measure::share(
            "in_ambiguity_set",
            "truth among the names and their rivals",
            Some(Bar::AtLeast(0.97)),
            asked().map(|case| case.in_set),
        ),
        Measure::share(
            "false_alarm",
            "a mismatch reported where nothing is hidden",
            Some(Bar::AtMost(0.02)),
            of(Clean).map(|case| case.alarm),
        ),
        Measure::share(
            "wrong_unique_claim",
            "`explained` with a wrong name, all cases",
            Some(Bar::AtMost(0.02)),
            cases.iter().map(|case| case.wrong_unique),
        ),
        Measure::share(
            "wrong_and_sure",
            "findings above 0.9 that are wrong",
            Some(Bar::AtMost(0.02)),
            sure().map(|claim| !claim.right),
        ),
        Measure::median(
            "median_excess_error_removed",
            "median held-out excess error removed, 3 % and above; a wrong name removes nothing",
            Bar::AtLeast(0.75),
            strong().map(|case| case.removed).collect(),
        ),
        Measure::share(
            "pairs_both",
            "both effects of a pair named",
            Some(Bar::AtLeast(0.80)),
            of(Pair).filter(|case| case.askable).map(|case| case.named == case.hidden.len()),
        ),
        Measure::share(
            "several_named",
            "effects of three to six at once that are named",
            None,
            of(Several).flat_map(|case| (0..case.hidden.len()).map(move |place| place < case.named)),
        ),
        Measure::share(
            "confounded_listed",
            "confounded cases that list all rivals",
            Some(Bar::AtLeast(0.95)),
            of(Confounded).map(|case| case.rivals_listed),
        ),
        Measure::share(
            "unknown_flagged",
            "outside the catalogue: said to have no name",
            Some(Bar::AtLeast(0.80)),
            of(Outside).map(|case| case.flagged),
        ),
        Measure::share(
            "unknown_on_its_path",
            "outside the catalogue: said to have no name, on the right path",
            Some(Bar::AtLeast(0.65)),
            of(Outside).map(|case| case.flagged && case.right_path),
        ),
        Measure::mean(
            "calibration_error",
            "expected calibration error of `probability` over all findings",
            Some(Bar::AtMost(0.05)),
            off,
            claims,
        ),
        Measure::mean(
            "calibration_error_by_chance",
            "the same, were every `probability` right: what chance leaves of so many findings",
            None,
            bins.iter().map(off_by_chance).sum(),
            claims,
        ),
        Measure::share(
            "refused",
            "cases that were refused or failed",
            Some(Bar::AtMost(0.0)),
            cases.iter().map(|case| case.verdict == "error"),
        ),
        Measure::share(
            "not_asked",
            "single effects of which a re-fit within the tolerances leaves too little (left out above)",
            None,
            of(Single).map(|case| !case.askable),
        ),
        Measure::mean(
            "seconds_per_case",
            "mean seconds of a diagnosis, with the other jobs running beside it",
            Some(Bar::AtMost(3.0)),
            seconds,
            cases.len(),
        ),
    ]
}

/// Bins of stated probability over some claims.
pub fn calibration<'a>(claims: impl Iterator<Item = &'a Claim>) -> Vec<Bin> {
    let mut bins = vec![Bin::default(); BINS];
    for claim in claims {
        let index = ((claim.probability * BINS as f64) as usize).min(BINS - 1);
        bins[index].count += 1;
        bins[index].stated += claim.probability;
        bins[index].right += f64::from(claim.right);
    }
    for bin in bins.iter_mut().filter(|bin| bin.count > 0) {
        bin.stated /= bin.count as f64;
        bin.right /= bin.count as f64;
    }
    bins
}

/// By how many findings a bin is off on average where each is right with the probability that is stated of it: the mean size of a
/// normal number, with the binomial's variance.
fn off_by_chance(bin: &Bin) -> f64 {
    (std::f64::consts::FRAC_2_PI * bin.count as f64 * bin.stated * (1.0 - bin.stated)).sqrt()
}

#[cfg(test)]
mod tests {
    use statrs::distribution::Discrete;

    use super::*;

    /// Against the binomial itself.
    #[test]
    fn what_chance_leaves_of_a_bin_is_what_a_binomial_is_off() {
        let (count, stated) = (12_u64, 0.26);
        let binomial = statrs::distribution::Binomial::new(stated, count).unwrap();
        let off = |right: u64| binomial.pmf(right) * (right as f64 - stated * count as f64).abs();
        let mean: f64 = (0..=count).map(off).sum();
        let bin = Bin { count: count as usize, stated, right: 0.0 };
        assert!((off_by_chance(&bin) - mean).abs() < 0.05 * mean, "{} {mean}", off_by_chance(&bin));
    }

    fn scored(kind: CaseKind, verdict: &str, probability: f64, right: bool, strength: f64) -> Scored {
        let named = verdict == "explained";
        let claim = Claim { effect: "duct_loss".into(), probability, right };
        Scored {
            kind,
            seed: 1,
            class: "small brushless".into(),
            dry: false,
            hidden: vec!["duct_loss".into()],
            strength,
            askable: true,
            verdict: verdict.into(),
            claims: if named { vec![claim] } else { Vec::new() },
            first_right: right,
            in_set: right,
            named: usize::from(right),
            rivals_listed: right,
            flagged: false,
            right_path: false,
            alarm: verdict != "no_mismatch",
            wrong_unique: named && !right,
            removed: if right { 0.8 } else { 0.0 },
            seconds: 2.0,
        }
    }

    fn measure<'a>(proof: &'a Proof, name: &str) -> &'a Measure {
        proof.measures.iter().find(|m| m.name == name).unwrap()
    }

    #[test]
    fn measures_carry_numerator_denominator_and_interval() {
        let mut absorbed = scored(CaseKind::Single, "no_mismatch", 0.0, false, 0.03);
        absorbed.askable = false;
        let stamp = Stamp { commit: "abc".into(), constants: "none".into() };
        let proof = Proof::new(
            1,
            false,
            stamp,
            vec![
                scored(CaseKind::Single, "explained", 0.95, true, 0.03),
                scored(CaseKind::Single, "explained", 0.95, false, 0.06),
                scored(CaseKind::Single, "no_mismatch", 0.0, false, 0.012),
                absorbed,
                scored(CaseKind::Clean, "no_mismatch", 0.0, false, 0.0),
                scored(CaseKind::Clean, "unexplained", 0.0, false, 0.0),
            ],
        );
        let strong = measure(&proof, "top1_strong");
        assert_eq!((strong.numerator, strong.denominator, strong.met()), (1.0, 2, Some(false)));
        let [low, high] = strong.wilson_95.unwrap();
        assert!(low < 0.1 + 0.01 && high > 0.9, "one of two says little: {low} to {high}");
        assert_eq!(measure(&proof, "top1_weak").value, Some(0.0));
        assert_eq!(measure(&proof, "false_alarm").value, Some(0.5));
        assert_eq!(measure(&proof, "wrong_unique_claim").numerator, 1.0);
        assert_eq!(measure(&proof, "wrong_and_sure").value, Some(0.5));
        assert_eq!(measure(&proof, "not_asked").numerator, 1.0);
        assert_eq!(measure(&proof, "pairs_both").value, None);
        // Two findings stated at 0.95, one right: off by 0.45.
        assert!((measure(&proof, "calibration_error").value.unwrap() - 0.45).abs() < 1e-9);
        assert_eq!(proof.confusion()["duct_loss"]["duct_loss"], 2);
        let json = proof.json();
        assert_eq!((&json["commit"], &json["constants"]), (&json!("abc"), &json!("none")));
        for name in
            ["top1_strong", "in_ambiguity_set", "confounded_listed", "unknown_flagged", "seconds_per_case"]
        {
            assert!(json["measures"][name]["denominator"].is_number(), "{name}");
        }
    }
}
