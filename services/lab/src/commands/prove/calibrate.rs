//! Records for fitting constants: a JSON line a finding.

use std::path::Path;

use kort_proof::calibrate::{Fold, records};
use kort_proof::score::Scored;
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
    Ok(())
}
