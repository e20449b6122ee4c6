//! Records for fitting constants, a JSON line a finding; and the temper of the odds, fitted and tested.

use std::path::Path;

use kort_diagnose::constants::Constants;
use kort_diagnose::posterior::trusted;
use kort_proof::calibrate::{Fold, fold_of, records};
use kort_proof::score::Scored;
use kort_proof::temper::{FORM_SHARES, LEAST_TEMPERS, Temper, Weighed, best, cross_validate, mean_score};
use kort_proof::trust::{self, Law, SURPRISES, Stated};
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
    print_temper(results, by, folds);
    print_trust(results);
    Ok(())
}

/// How often names that have no rival to speak of were right, by how many stand together, and which trust that asks for.
fn print_trust(results: &[(Scored, Answer, Value)]) {
    let in_use = Constants::built_in().posterior.surprise;
    let all: Vec<Stated> = results
        .iter()
        .flat_map(|(scored, _, report)| trust::stated(scored, report, |names| trusted(names, in_use)))
        .collect();
    eprintln!("names in the set  right  stated without a rival");
    for (names, right, count) in trust::counted(&all) {
        eprintln!("{names:16}  {right:5}  {count:22}");
    }
    eprintln!("odds against one name  {}", Law::ALL.map(|law| format!("{:>16}", law.name())).join("  "));
    for surprise in SURPRISES {
        let of = |law: Law| format!("{:16.2}", trust::score(&all, |names| law.trust(names, surprise)));
        eprintln!("{surprise:21}  {}", Law::ALL.map(of).join("  "));
    }
    let (law, surprise) = trust::best(&all);
    eprintln!("best {surprise} {}, in use {in_use} {}", law.name(), Law::Number.name());
}

/// The temper that these cases ask for, and what it is worth on folds left out.
fn print_temper(results: &[(Scored, Answer, Value)], by: Fold, folds: usize) {
    let cases: Vec<Weighed> = results
        .iter()
        .filter_map(|(_, answer, report)| Weighed::of(answer, report, fold_of(answer, by, folds)))
        .collect();
    let odds = Constants::built_in().posterior;
    let trust = |effects| trusted(effects, odds.surprise);
    let all: Vec<&Weighed> = cases.iter().collect();
    eprintln!(
        "mean log score of the names in {} cases (0 is best), by least temper and share of the gain",
        all.len()
    );
    eprintln!("        {}", FORM_SHARES.map(|share| format!("{share:7}")).join("  "));
    for least in LEAST_TEMPERS {
        let of = |form_share| format!("{:7.3}", mean_score(&all, Temper { least, form_share }, &trust));
        eprintln!("{least:6}  {}", FORM_SHARES.map(of).join("  "));
    }
    let words = |temper: Temper| format!("{} and {}", temper.least, temper.form_share);
    let in_use = Temper { least: odds.temper, form_share: odds.form_share };
    eprintln!("best {}, in use {}", words(best(&all, &trust)), words(in_use));
    eprintln!("fold  cases  fitted on the others  its score here  in use");
    for left in cross_validate(&cases, in_use, &trust) {
        let (fold, count, temper) = (left.fold, left.cases, words(left.temper));
        eprintln!("{fold:4}  {count:5}  {temper:20}  {:14.3}  {:6.3}", left.score, left.in_use);
    }
}
