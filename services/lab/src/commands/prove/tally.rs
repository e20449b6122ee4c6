//! Measures over all cases, each with numerator and denominator.

use std::collections::BTreeMap;

use kort_truth::CaseKind;
use serde_json::{Value, json};

use super::score::Scored;

/// One measure and the bar it is held against.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Name in the JSON.
    pub name: &'static str,
    /// What it counts, in words.
    pub what: &'static str,
    /// Cases (or the sum) that count.
    pub numerator: f64,
    /// Cases they are counted over.
    pub denominator: usize,
    /// Value; none over no cases.
    pub value: Option<f64>,
    /// The bar.
    pub bar: Bar,
}

/// Where a measure should lie.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Bar {
    /// At least.
    AtLeast(f64),
    /// At most.
    AtMost(f64),
}

impl Measure {
    /// The bar is met; none over no cases.
    pub fn met(&self) -> Option<bool> {
        self.value.map(|value| match self.bar {
            Bar::AtLeast(bar) => value >= bar,
            Bar::AtMost(bar) => value <= bar,
        })
    }
}

/// Bins of the calibration.
pub const BINS: usize = 10;

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

/// The proof.
pub struct Proof {
    /// First seed.
    pub seed: u64,
    /// Every case.
    pub cases: Vec<Scored>,
    /// The measures of the contract, in its order.
    pub measures: Vec<Measure>,
    /// Calibration of `probability`.
    pub bins: Vec<Bin>,
}

impl Proof {
    /// Counts.
    pub fn new(seed: u64, cases: Vec<Scored>) -> Self {
        let bins = calibration(&cases);
        let measures = measures(&cases, &bins);
        Proof { seed, cases, measures, bins }
    }

    /// Hidden id (single effects) against first name given, or the verdict where no name is given.
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
        let measures: serde_json::Map<String, Value> = self
            .measures
            .iter()
            .map(|m| {
                let bar = match m.bar {
                    Bar::AtLeast(bar) => json!({ "at_least": bar }),
                    Bar::AtMost(bar) => json!({ "at_most": bar }),
                };
                let body = json!({ "value": m.value, "numerator": m.numerator, "denominator": m.denominator,
                                   "what": m.what, "bar": bar, "met": m.met() });
                (m.name.to_owned(), body)
            })
            .collect();
        let bins: Vec<Value> = self
            .bins
            .iter()
            .map(|b| json!({ "count": b.count, "stated": b.stated, "right": b.right }))
            .collect();
        json!({ "schema": "kort.prove/1", "kort_version": env!("CARGO_PKG_VERSION"), "seed": self.seed,
                "cases": self.cases.len(), "measures": measures, "confusion": self.confusion(),
                "calibration": bins, "results": self.cases })
    }
}

fn measures(cases: &[Scored], bins: &[Bin]) -> Vec<Measure> {
    use CaseKind::*;
    let of = |kind: CaseKind| cases.iter().filter(move |case| case.kind == kind);
    let share = |name, what, bar, all: &mut dyn Iterator<Item = bool>| {
        let marks: Vec<bool> = all.collect();
        let hits = marks.iter().filter(|mark| **mark).count();
        let value = (!marks.is_empty()).then(|| hits as f64 / marks.len() as f64);
        Measure { name, what, numerator: hits as f64, denominator: marks.len(), value, bar }
    };
    let strong = |case: &&Scored| case.strength >= 0.03;
    let mut removed: Vec<f64> = of(Single).filter(strong).map(|case| case.removed).collect();
    removed.sort_by(f64::total_cmp);
    let seconds: f64 = cases.iter().map(|case| case.seconds).sum();
    let claims: usize = bins.iter().map(|bin| bin.count).sum();
    let off: f64 = bins.iter().map(|bin| bin.count as f64 * (bin.right - bin.stated).abs()).sum();
    let alarm =
        |case: &Scored| !matches!(case.verdict.as_str(), "no_mismatch" | "insufficient_data" | "error");
    vec![
        share(
            "top1_strong",
            "right effect first, 3 % of full scale and above",
            Bar::AtLeast(0.97),
            &mut of(Single).filter(strong).map(|c| c.first_right),
        ),
        share(
            "top1_weak",
            "right effect first, 1.2 % of full scale",
            Bar::AtLeast(0.88),
            &mut of(Single).filter(|c| c.strength < 0.03).map(|c| c.first_right),
        ),
        share(
            "in_ambiguity_set",
            "truth among the names and their rivals",
            Bar::AtLeast(0.99),
            &mut of(Single).map(|c| c.in_set),
        ),
        share(
            "false_alarm",
            "a mismatch reported where nothing is hidden",
            Bar::AtMost(0.01),
            &mut of(Clean).map(alarm),
        ),
        share(
            "wrong_unique_claim",
            "`explained` with a wrong name, all cases",
            Bar::AtMost(0.02),
            &mut cases.iter().map(|c| c.wrong_unique),
        ),
        Measure {
            name: "median_excess_error_removed",
            what: "median held-out excess error removed, 3 % and above; a wrong name removes nothing",
            numerator: removed.iter().filter(|value| **value >= 0.75).count() as f64,
            denominator: removed.len(),
            value: (!removed.is_empty()).then(|| removed[removed.len() / 2]),
            bar: Bar::AtLeast(0.75),
        },
        share(
            "pairs_both",
            "both effects of a pair named",
            Bar::AtLeast(0.80),
            &mut of(Pair).map(|c| c.all_named),
        ),
        share(
            "confounded_listed",
            "confounded cases that list all rivals",
            Bar::AtLeast(0.95),
            &mut of(Confounded).map(|c| c.rivals_listed),
        ),
        share(
            "unknown_flagged",
            "outside the catalogue: `unexplained`, right path",
            Bar::AtLeast(0.85),
            &mut of(Outside).map(|c| c.flagged_unknown),
        ),
        Measure {
            name: "calibration_error",
            what: "expected calibration error of `probability` over all findings",
            numerator: off,
            denominator: claims,
            value: (claims > 0).then(|| off / claims as f64),
            bar: Bar::AtMost(0.05),
        },
        Measure {
            name: "seconds_per_case",
            what: "mean seconds of a diagnosis, with the other jobs running beside it",
            numerator: seconds,
            denominator: cases.len(),
            value: (!cases.is_empty()).then(|| seconds / cases.len() as f64),
            bar: Bar::AtMost(8.0),
        },
    ]
}

fn calibration(cases: &[Scored]) -> Vec<Bin> {
    let mut bins = vec![Bin::default(); BINS];
    for claim in cases.iter().flat_map(|case| &case.claims) {
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

#[cfg(test)]
mod tests {
    use super::super::score::Claim;
    use super::*;

    fn scored(kind: CaseKind, verdict: &str, probability: f64, right: bool, strength: f64) -> Scored {
        let claims = if verdict == "explained" {
            vec![Claim { effect: "duct_loss".into(), probability, right }]
        } else {
            vec![]
        };
        Scored {
            kind,
            seed: 1,
            hidden: vec!["duct_loss".into()],
            strength,
            verdict: verdict.into(),
            claims,
            first_right: right,
            in_set: right,
            all_named: right,
            rivals_listed: right,
            flagged_unknown: false,
            wrong_unique: verdict == "explained" && !right,
            removed: if right { 0.8 } else { 0.0 },
            seconds: 2.0,
        }
    }

    fn measure<'a>(proof: &'a Proof, name: &str) -> &'a Measure {
        proof.measures.iter().find(|m| m.name == name).unwrap()
    }

    #[test]
    fn measures_carry_numerator_and_denominator() {
        let proof = Proof::new(
            1,
            vec![
                scored(CaseKind::Single, "explained", 0.9, true, 0.03),
                scored(CaseKind::Single, "explained", 0.9, false, 0.06),
                scored(CaseKind::Single, "no_mismatch", 0.0, false, 0.012),
                scored(CaseKind::Clean, "no_mismatch", 0.0, false, 0.0),
                scored(CaseKind::Clean, "unexplained", 0.0, false, 0.0),
            ],
        );
        let strong = measure(&proof, "top1_strong");
        assert_eq!((strong.numerator, strong.denominator, strong.met()), (1.0, 2, Some(false)));
        assert_eq!(measure(&proof, "top1_weak").value, Some(0.0));
        assert_eq!(measure(&proof, "false_alarm").value, Some(0.5));
        assert_eq!(measure(&proof, "wrong_unique_claim").numerator, 1.0);
        assert_eq!(measure(&proof, "pairs_both").value, None);
        // Two findings stated at 0.9, one right: off by 0.4.
        assert!((measure(&proof, "calibration_error").value.unwrap() - 0.4).abs() < 1e-9);
        assert_eq!(proof.confusion()["duct_loss"]["duct_loss"], 2);
        let json = proof.json();
        for name in
            ["top1_strong", "in_ambiguity_set", "confounded_listed", "unknown_flagged", "seconds_per_case"]
        {
            assert!(json["measures"][name]["denominator"].is_number(), "{name}");
        }
    }
}
