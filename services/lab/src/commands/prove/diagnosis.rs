//! `kort diagnose`, as the proof calls it: files in, the report's JSON out.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_identify::data::Series;
use kort_proof::{Diagnosis, File};
use kort_recording::Recording;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;
use serde_json::{Value, json};

/// The diagnosis of this program.
pub struct Ours;

impl Diagnosis for Ours {
    fn diagnose(&self, recordings: &[File], rig_toml: &str) -> Result<Value, String> {
        let rig = Rig::from_toml(rig_toml).map_err(|error| error.to_string())?;
        let series = recordings.iter().map(series).collect::<Result<Vec<_>, _>>()?;
        let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
        let started = std::time::Instant::now();
        let diagnosis = diagnose(&series, &rig, &options, &|_| ()).map_err(|error| error.to_string())?;
        let mut report = serde_json::to_value(&diagnosis.report).map_err(|error| error.to_string())?;
        // Not part of the report: what its odds are made of, for the calibration.
        report["evidence"] = serde_json::to_value(&diagnosis.evidence).map_err(|error| error.to_string())?;
        report["took_seconds"] = json!(started.elapsed().as_secs_f64());
        Ok(report)
    }
}

fn series(file: &File) -> Result<Series, String> {
    let recording =
        Recording::decode(&file.name, file.bytes.as_slice(), None).map_err(|error| error.to_string())?;
    Ok(Series {
        name: recording.name,
        time_s: recording.time_s,
        columns: recording.columns.into_iter().map(|column| (column.name, column.values)).collect(),
    })
}
