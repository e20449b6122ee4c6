//! From a session's record to a rig description, a recording and a diagnosis.

use std::path::Path;

use kort_calibrate::{Estimate, Facts, Log, estimate, recorded, stands_out};
use kort_diagnose::constants::Constants;
use kort_diagnose::diagnose::{Diagnosis, Options, diagnose};
use kort_identify::scores::FittedEffect;
use kort_recording::{Column, Recording};
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

use crate::failure::Failure;
use crate::fitted_rig::{open, parted, with_fitted, with_fitted_effects};

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

/// The rig description with what was estimated: values in place, zeros and effects that stand out of their uncertainty at
/// the end. Also returned: what was not written, and why.
///
/// # Errors
/// The text is no rig description.
pub fn rig_text(text: &str, estimate: &Estimate) -> Result<(String, Vec<String>), Failure> {
    let fit = &estimate.fit;
    let (kept, fixed) = parted(fit);
    let (mut text, mut left_out) = with_fitted(text, &fixed, MEASURED).map_err(Failure::failed)?;
    left_out.extend(kept.iter().map(|p| format!("{} stays as stated: the session does not fix it", p.name)));
    let rig = Rig::from_toml(&text).map_err(Failure::failed)?;
    let (effects, not_seen) = standing_out(estimate, &rig);
    left_out.extend(not_seen);
    let (written, not_written) =
        with_fitted_effects(&text, &effects, &open(fit), MEASURED).map_err(Failure::failed)?;
    text = written;
    left_out.extend(not_written);
    Ok((text, left_out))
}

/// The effects that are written: those that stand out of their uncertainty, and those that the rig states already, which
/// gets what they are now. Also returned: in words, what was not seen.
fn standing_out(estimate: &Estimate, rig: &Rig) -> (Vec<FittedEffect>, Vec<String>) {
    let stated = |effect: &str, name: Option<&str>| {
        rig.effects
            .iter()
            .any(|known| known.effect == effect && name.is_none_or(|name| known.value(name) != 0.0))
    };
    let mut not_seen = Vec::new();
    let mut effects: Vec<FittedEffect> = estimate.fit.effects.clone();
    effects.retain(|effect| {
        let there = stated(&effect.effect, None) || effect.parameters.iter().any(stands_out);
        if !there {
            not_seen.push(format!("{}: none seen within its uncertainty", effect.effect));
        }
        there
    });
    for zero in &estimate.zeros {
        if !stated(zero.effect, Some(&zero.parameter.name)) && !stands_out(&zero.parameter) {
            not_seen.push(format!("zero of {}: none seen within its uncertainty", zero.signal));
            continue;
        }
        match effects.iter_mut().find(|effect| effect.effect == zero.effect) {
            Some(effect) => effect.parameters.push(zero.parameter.clone()),
            None => effects.push(FittedEffect {
                effect: zero.effect.into(),
                path: String::new(),
                equation: String::new(),
                parameters: vec![zero.parameter.clone()],
            }),
        }
    }
    (effects, not_seen)
}

/// Writes the record of a session, however it ended; false where it holds nothing.
///
/// # Errors
/// The file cannot be written, or its name asks for no known format.
pub fn save(log: &Log, period_s: f64, path: &Path) -> Result<bool, Failure> {
    let series = recorded(log, period_s);
    if series.time_s.is_empty() || series.columns.is_empty() {
        return Ok(false);
    }
    let columns = series.columns.into_iter().map(|(name, values)| Column::new(name, values)).collect();
    let recording = Recording { name: series.name, time_s: series.time_s, columns, ..Recording::default() };
    recording.save(path).map_err(Failure::failed)?;
    Ok(true)
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

#[cfg(test)]
mod tests {
    use kort_calibrate::Zero;
    use kort_diagnose::report::ParameterReport;
    use kort_identify::data::Series;
    use kort_identify::identifiable::NotIdentifiable;
    use kort_identify::identify::{FitReport, Starts};

    use super::*;

    const RIG: &str = include_str!("../../../../config/thrusters/t200.toml");

    fn fitted(name: &str, value: f64, std_error: f64) -> ParameterReport {
        let (name, unit) = (name.into(), "1".into());
        ParameterReport { name, value, unit, std_error, stated: None, at_bound: None }
    }

    fn effect(id: &str, parameters: Vec<ParameterReport>) -> FittedEffect {
        FittedEffect { effect: id.into(), path: String::new(), equation: String::new(), parameters }
    }

    fn estimate(
        parameters: Vec<ParameterReport>,
        effects: Vec<FittedEffect>,
        open: &[&str],
        bias: ParameterReport,
    ) -> Estimate {
        let group = NotIdentifiable {
            parameters: open.iter().map(|name| (*name).to_owned()).collect(),
            why: String::new(),
            excitation: String::new(),
            relative_std_error: 1.0,
        };
        let fit = FitReport {
            schema: String::new(),
            kort_version: String::new(),
            recordings: Vec::new(),
            rig: String::new(),
            model: String::new(),
            seed: 1,
            seconds: 1.0,
            parameters,
            effects,
            channels: Default::default(),
            not_identifiable: vec![group],
            correlations: Vec::new(),
            symptoms: Vec::new(),
            starts: Starts { tried: 0, agreed: 0, worst_gap: 0.0 },
            initial_states: Vec::new(),
            notes: Vec::new(),
        };
        let zero = Zero { signal: "thrust_n", effect: "thrust_bias_gain_hysteresis", parameter: bias };
        let series = Series { name: String::new(), time_s: Vec::new(), columns: Vec::new() };
        Estimate { fit, zeros: vec![zero], series }
    }

    /// Found by the session, it is no discovery of the diagnosis that follows.
    #[test]
    fn a_zero_that_stands_out_is_written_as_the_effect_that_carries_it() {
        let found = estimate(Vec::new(), Vec::new(), &[], fitted("bias_n", 1.0, 0.01));
        let (text, left_out) = rig_text(RIG, &found).unwrap();
        let rig = Rig::from_toml(&text).unwrap();
        assert_eq!((rig.effects.len(), rig.effects[0].value("bias_n")), (1, 1.0), "{text}");
        assert!(left_out.is_empty(), "{left_out:?}");
        // One that is none is not; but what the rig says of it until now is no more so.
        let none = estimate(Vec::new(), Vec::new(), &[], fitted("bias_n", 0.02, 0.01));
        let (same, left_out) = rig_text(RIG, &none).unwrap();
        assert_eq!((same.as_str(), left_out.len()), (RIG, 1));
        assert!(left_out[0].contains("zero of thrust_n"), "{left_out:?}");
        let (again, _) = rig_text(&text, &none).unwrap();
        assert_eq!(Rig::from_toml(&again).unwrap().effects[0].value("bias_n"), 0.02);
        // Also of a cell that was set back to zero since, within what a tolerance cannot say.
        for zero in [0.004, 0.0] {
            let set_back = estimate(Vec::new(), Vec::new(), &[], fitted("bias_n", zero, 0.01));
            let (again, left_out) = rig_text(&text, &set_back).unwrap();
            let known = &Rig::from_toml(&again).unwrap().effects[0];
            assert_eq!((known.value("bias_n"), left_out.len()), (zero, 0), "{again} {left_out:?}");
        }
    }

    #[test]
    fn a_dead_time_within_its_stated_tolerance_is_none() {
        let delay = |value| effect("transport_delay", vec![fitted("delay_s", value, 0.5e-3)]);
        for (value, written) in [(1.0e-3, false), (1.7e-3, false), (4e-3, true)] {
            let found = estimate(Vec::new(), vec![delay(value)], &[], fitted("bias_n", 0.0, 1.0));
            let (text, left_out) = rig_text(RIG, &found).unwrap();
            assert_eq!(text.contains("transport_delay"), written, "{value}");
            assert_eq!(left_out.iter().any(|words| words.contains("transport_delay")), !written);
        }
    }

    #[test]
    fn what_the_session_does_not_fix_stays_as_stated_and_is_said() {
        let parameters = vec![fitted("added_mass_coefficient", 0.99, 0.2), fitted("lift_max", 0.7, 0.01)];
        let open = &["added_mass_coefficient", "kept_outside"];
        let found = estimate(parameters, Vec::new(), open, fitted("bias_n", 0.0, 1.0));
        let (text, left_out) = rig_text(RIG, &found).unwrap();
        assert!(text.contains("added_mass_coefficient = { value = 1.0, tol = 1.0 } # 1, the bare water"));
        assert!(text.contains("lift_max = { value = 0.7, tol = 0.0285714 } # 1, measured by kort calibrate"));
        assert!(left_out[0].starts_with("added_mass_coefficient stays as stated"), "{left_out:?}");
    }

    /// What was measured is kept whatever the session stopped for.
    #[test]
    fn a_session_that_measured_anything_has_a_recording() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut log = Log::new("current_cmd_a");
        assert!(!save(&log, 1e-3, &path).unwrap() && !path.exists());
        for k in 0..100 {
            let row = kort_proto::signals::Signals { thrust_n: 1.0, ..kort_proto::signals::Signals::UNKNOWN };
            log.push(f64::from(k) * 1e-3, &row);
        }
        assert!(save(&log, 1e-3, &path).unwrap());
        assert_eq!(Recording::read(&path, None).unwrap().time_s.len(), 25);
    }
}
