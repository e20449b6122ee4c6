//! Cases on disk, and cases before `diagnose`.

use std::path::Path;

use kort_diagnose::diagnose::{Options, diagnose};
use kort_identify::data::Series;
use kort_recording::Recording;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;
use kort_truth::{Answer, CaseKind, Selection, case};
use serde_json::{Value, json};

use crate::failure::{Failure, write_text};

/// Writes one case to a folder of its own.
pub fn write(folder: &Path, kind: CaseKind, seed: u64) -> Result<(), Failure> {
    let case = case(kind, seed, &Selection::default());
    let place = folder.join(format!("{}-{seed}", kind.name()));
    std::fs::create_dir_all(&place).map_err(|error| Failure::unwritten(&place, error))?;
    let answer = serde_json::to_string_pretty(&case.answer).map_err(Failure::failed)?;
    write_text(&place.join("recording.csv"), &case.recording_csv)?;
    write_text(&place.join("rig.toml"), &case.rig_toml)?;
    write_text(&place.join("answer.json"), &answer)
}

/// Builds a case and diagnoses its two files; the answer is handed on unopened.
///
/// The report is the JSON that `kort diagnose --json` prints, with the time it took; a refusal is a
/// report whose verdict is `error`.
pub fn diagnose_blind(kind: CaseKind, seed: u64) -> (Answer, Value) {
    let case = case(kind, seed, &Selection::default());
    let started = std::time::Instant::now();
    let mut report = report(&case.recording_csv, &case.rig_toml)
        .unwrap_or_else(|message| json!({ "verdict": "error", "summary": message }));
    report["seconds"] = json!(started.elapsed().as_secs_f64());
    (case.answer, report)
}

fn report(recording_csv: &str, rig_toml: &str) -> Result<Value, String> {
    let rig = Rig::from_toml(rig_toml).map_err(|error| error.to_string())?;
    let recording = Recording::decode("recording.csv", recording_csv.as_bytes(), None)
        .map_err(|error| error.to_string())?;
    let series = Series {
        name: recording.name,
        time_s: recording.time_s,
        columns: recording.columns.into_iter().map(|column| (column.name, column.values)).collect(),
    };
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    let diagnosis = diagnose(&[series], &rig, &options, &|_| ()).map_err(|error| error.to_string())?;
    serde_json::to_value(&diagnosis.report).map_err(|error| error.to_string())
}
