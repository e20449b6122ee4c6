//! From a session's record to a rig description, a recording and a diagnosis.

use std::path::Path;

use kort_calibrate::{Estimate, Facts, Log, estimate};
use kort_diagnose::constants::Constants;
use kort_diagnose::diagnose::{Diagnosis, Options, diagnose};
use kort_recording::{Column, Recording};
use kort_thruster::models::ModelName;
use kort_thruster::rig::{FoundEffect, Rig};

use crate::failure::Failure;
use crate::fitted_rig::{quantity, with_fitted};

/// What stands behind each value in the rig description.
const MEASURED: &str = "measured by kort calibrate";

/// Estimates from a record.
///
/// # Errors
/// The record cannot be compared with a model.
pub fn estimated(
    log: &Log,
    period_s: f64,
    rig: &Rig,
    facts: &Facts,
    told: &(dyn Fn(&str) + Sync),
) -> Result<Estimate, Failure> {
    let criterion = Constants::built_in().criterion;
    estimate(log, period_s, rig, facts, criterion, told).map_err(Failure::failed)
}

/// The rig description with what was estimated: values in place, effects that stand out of their uncertainty at the
/// end. Also returned: what could not be written, and why.
///
/// # Errors
/// The text is no rig description.
pub fn rig_text(text: &str, estimate: &Estimate) -> Result<(String, Vec<String>), Failure> {
    let fit = &estimate.fit;
    let (text, mut left_out) = with_fitted(text, &fit.parameters, MEASURED).map_err(Failure::failed)?;
    let mut found = Vec::new();
    for effect in &fit.effects {
        let stands_out =
            effect.parameters.iter().any(|p| p.value.abs() > 2.0 * p.std_error && p.value != 0.0);
        if !stands_out {
            left_out.push(format!("{}: none seen within its uncertainty", effect.effect));
            continue;
        }
        found.push(FoundEffect {
            effect: &effect.effect,
            parameters: effect.parameters.iter().map(|p| (p.name.as_str(), quantity(p))).collect(),
        });
    }
    let text = Rig::with_effects_toml(&text, &found, MEASURED).map_err(Failure::failed)?;
    Ok((text, left_out))
}

/// Writes the record.
///
/// # Errors
/// The file cannot be written, or its name asks for no known format.
pub fn save(estimate: &Estimate, path: &Path) -> Result<(), Failure> {
    let series = &estimate.series;
    let columns =
        series.columns.iter().map(|(name, values)| Column::new(name.clone(), values.clone())).collect();
    let recording = Recording {
        name: series.name.clone(),
        time_s: series.time_s.clone(),
        columns,
        ..Recording::default()
    };
    recording.save(path).map_err(Failure::failed)
}

/// What the calibrated rig leaves of the recording.
///
/// # Errors
/// The recording cannot be compared with the rig.
pub fn diagnosed(
    estimate: &Estimate,
    rig: &Rig,
    seed: u64,
    told: &(dyn Fn(&str) + Sync),
) -> Result<Diagnosis, Failure> {
    let options = Options { model: ModelName::Model2, seed, with: Vec::new() };
    diagnose(std::slice::from_ref(&estimate.series), rig, &options, told).map_err(Failure::failed)
}
