//! Records for fitting constants, a JSON line a finding; and the temper of the odds, fitted and tested.

use std::path::Path;

use kort_diagnose::constants::{Constants, PosteriorConstants};
use kort_diagnose::posterior;
use kort_proof::calibrate::{Fold, fold_of, records};
use kort_proof::score::Scored;
use kort_proof::temper::{
    FORM_SHARES, LEAST_TEMPERS, Odds, Temper, Weighed, best, cross_validate, mean_score,
};
use kort_proof::trust::{self, Doubt, Law, POWERS, SURPRISES};
use kort_truth::Answer;
use serde_json::Value;

use super::FoldBy;
use crate::failure::{Failure, write_text};

/// Writes them.
///
/// # Errors
/// The file cannot be written.
pub fn write(
    path: &Path,
    results: &[(Scored, Answer, Value)],
    by: FoldBy,
    folds: usize,
) -> Result<(), Failure> {
    let by = match by {
        FoldBy::Effect => Fold::Effect,
        FoldBy::Rig => Fold::Rig,
        FoldBy::Noise => Fold::Noise,
    };
    let mut text = String::new();
    let mut count = 0;
    for record in
        results.iter().flat_map(|(scored, answer, report)| records(scored, answer, report, by, folds))
    {
        text += &serde_json::to_string(&record).map_err(Failure::failed)?;
        text.push('\n');
        count += 1;
    }
    write_text(path, &text)?;
    eprintln!("wrote {count} records to {}", path.display());
    print_weighed(results, by, folds);
    Ok(())
}

/// Temper and doubt that these cases ask for.
fn print_weighed(results: &[(Scored, Answer, Value)], by: Fold, folds: usize) {
    let cases: Vec<Weighed> = results
        .iter()
        .filter_map(|(_, answer, report)| Weighed::of(answer, report, fold_of(answer, by, folds)))
        .collect();
    let odds = Constants::built_in().posterior;
    let in_use = Temper { least: odds.temper, form_share: odds.form_share };
    let law = |doubt: Doubt, effects, gain| {
        let tried = PosteriorConstants { surprise: doubt.surprise, surprise_power: doubt.power, ..odds };
        posterior::doubt(&tried, effects, gain)
    };
    let doubt = Doubt { surprise: odds.surprise, power: odds.surprise_power };
    print_temper(&cases, in_use, &|effects, gain| law(doubt, effects, gain));
    print_doubt(&cases, in_use, doubt, &law);
}

/// The temper, and what it is worth on folds left out.
fn print_temper(cases: &[Weighed], in_use: Temper, doubt: Odds) {
    let all: Vec<&Weighed> = cases.iter().collect();
    eprintln!(
        "mean log score of the names in {} cases (0 is best), by least temper and share of the gain",
        all.len()
    );
    eprintln!("        {}", FORM_SHARES.map(|share| format!("{share:7}")).join("  "));
    for least in LEAST_TEMPERS {
        let of = |form_share| format!("{:7.3}", mean_score(&all, Temper { least, form_share }, doubt));
        eprintln!("{least:6}  {}", FORM_SHARES.map(of).join("  "));
    }
    let words = |temper: Temper| format!("{} and {}", temper.least, temper.form_share);
    eprintln!("best {}, in use {}", words(best(&all, doubt)), words(in_use));
    eprintln!("fold  cases  fitted on the others  its score here  in use");
    for left in cross_validate(cases, in_use, doubt) {
        let (fold, count, temper) = (left.fold, left.cases, words(left.temper));
        eprintln!("{fold:4}  {count:5}  {temper:20}  {:14.3}  {:6.3}", left.score, left.in_use);
    }
}

/// How often names that no other comes near were right, by what leaving them out costs for each that stands together, and
/// which doubt that asks for.
fn print_doubt(cases: &[Weighed], temper: Temper, in_use: Doubt, law: Law) {
    let names: Vec<(f64, bool)> = cases.iter().flat_map(|case| case.without_rival(temper)).collect();
    eprintln!("cost a name  right  stated without a rival");
    for (from, to, right, count) in trust::counted(&names) {
        eprintln!("{:>11}  {right:5}  {count:22}", format!("{from} to {to}"));
    }
    let all: Vec<&Weighed> = cases.iter().collect();
    eprintln!("mean log score of the names, by the cost a name of even odds and their power");
    eprintln!("        {}", POWERS.map(|power| format!("{power:7}")).join("  "));
    for surprise in SURPRISES {
        let of = |power| format!("{:7.3}", trust::score(&all, temper, Doubt { surprise, power }, law));
        eprintln!("{surprise:6}  {}", POWERS.map(of).join("  "));
    }
    let words = |doubt: Doubt| format!("{} to the power {}", doubt.surprise, doubt.power);
    eprintln!("best {}, in use {}", words(trust::best(&all, temper, law)), words(in_use));
}
