//! What is stated in the end, with its tolerance.

use kort_identify::scores::ParameterReport;
use kort_thruster::parameters::Parameter;
use serde::Serialize;

use crate::estimate::Estimate;
use crate::facts::{ALL_INSIDE, Facts, WITNESSES};
use crate::stages;

/// A quantity with its tolerance.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stated {
    /// Name, unit last.
    pub name: String,
    /// Value, in the unit.
    pub value: f64,
    /// How far the true value may lie, in the unit: in 99 sessions of 100 none of some thirty quantities lies outside
    /// ([`ALL_INSIDE`]). A rig description's `tol` is two sigma.
    pub tolerance: f64,
    /// Unit.
    pub unit: String,
}

/// What a step found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StepReport {
    /// The step.
    pub name: String,
    /// In words.
    pub result: String,
    /// What it states.
    pub quantities: Vec<Stated>,
    /// What was left out of it and why.
    pub skipped_because: Vec<String>,
}

/// The report of `kort calibrate`, schema `kort.calibration/1`.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// `kort.calibration/1`
    pub schema: &'static str,
    /// Version of kort.
    pub kort_version: &'static str,
    /// The thruster.
    pub thruster: String,
    /// What was done, in order.
    pub steps: Vec<StepReport>,
    /// The rig description written.
    pub rig: Option<String>,
    /// The recording written.
    pub recording: Option<String>,
    /// Verdict of the diagnosis of that recording with that rig.
    pub diagnosis: Option<String>,
    /// Why the session stopped, where it did.
    pub stopped: Option<String>,
}

fn stated(name: impl Into<String>, value: f64, tolerance: f64, unit: &str) -> Stated {
    Stated { name: name.into(), value, tolerance, unit: unit.into() }
}

fn of_fit(p: &ParameterReport) -> Stated {
    stated(p.name.clone(), p.value, ALL_INSIDE * p.std_error, &p.unit)
}

/// Whether it is more than nothing: by the tolerance that is stated of it.
pub fn stands_out(p: &ParameterReport) -> bool {
    p.value.abs() > ALL_INSIDE * p.std_error
}

/// The estimated torque constant over the stated one, and its relative tolerance.
fn torque_constant(estimate: &Estimate) -> Option<(f64, f64)> {
    let name = Parameter::TorqueConstantNmA.name();
    let found = estimate.fit.parameters.iter().find(|p| p.name == name)?;
    Some((found.value / found.stated?, ALL_INSIDE * found.std_error / found.value))
}

/// A parameter for the report: by its key where the rig description has it, in words where its name alone says nothing.
fn in_words(name: &str) -> &str {
    match name {
        "half_width" => "the half width of the dead band",
        "centre" => "the centre of the dead band",
        "kept_outside" => "how much of a command beyond the dead band the drive gives",
        "delay_s" => "the drive's dead time",
        name => name,
    }
}

/// What was found, step by step; the estimated together come last.
pub fn steps(facts: &Facts, estimate: Option<&Estimate>) -> Vec<StepReport> {
    let left_out = |step: &str| {
        facts.left_out.iter().filter(|(s, _)| *s == step).map(|(_, words)| words.clone()).collect::<Vec<_>>()
    };
    let step = |name: &str, result: String, quantities: Vec<Stated>| StepReport {
        name: name.into(),
        result,
        quantities,
        skipped_because: left_out(name),
    };
    let mut out = Vec::new();
    if !facts.rest.is_empty() {
        let zeros = [("thrust_n", "N"), ("flow_m_s", "m/s"), ("torque_n_m", "N m"), ("current_a", "A")];
        let mut zeros_of =
            step("zeros", "the shaft stands; every sensor's reading at rest".into(), Vec::new());
        for (signal, unit) in zeros.into_iter().filter(|(signal, _)| facts.measures(signal)) {
            let rest = facts.at_rest(signal);
            if rest.tolerance() > 0.0 {
                let zero = stated(format!("zero_of_{signal}"), rest.mean, rest.tolerance(), unit);
                zeros_of.quantities.push(zero);
            } else {
                zeros_of.skipped_because.push(format!(
                    "{signal}: it read 0 throughout, so its zero lies within a digit, and how large that is did not show"
                ));
            }
        }
        out.push(zeros_of);
    }
    if facts.side != 0.0 {
        let words = format!(
            "the shaft moved at {:.4} of the drive's unit; driven ahead its sensor shows {}",
            facts.first_drive,
            if facts.side > 0.0 { "ahead" } else { "astern" }
        );
        out.push(step("first_movement", words, Vec::new()));
        let signs = WITNESSES.iter().enumerate().filter(|(_, s)| facts.measures(s)).map(|(k, signal)| {
            let way = match facts.sign_of(k) {
                s if s > 0.0 => "ahead",
                s if s < 0.0 => "ASTERN",
                _ => "not seen",
            };
            format!("{signal} {way}")
        });
        let words = signs.collect::<Vec<_>>().join(", ");
        let words =
            if words.is_empty() { "nothing measures thrust, flow or blade torque".into() } else { words };
        out.push(step("direction", words, Vec::new()));
    }
    if facts.breakaway.iter().any(Option::is_some) || !left_out("breakaway").is_empty() {
        // They were currents; what torque these were is as sure as the torque constant.
        let (factor, spread) = estimate.and_then(torque_constant).unwrap_or((1.0, 0.0));
        let quantities = ["breakaway_ahead_n_m", "breakaway_astern_n_m"]
            .into_iter()
            .zip(&facts.breakaway)
            .filter_map(|(name, found)| {
                let torque = factor * found.as_ref()?.torque_n_m;
                let tolerance = (factor * found.as_ref()?.tolerance_n_m).hypot(spread * torque);
                Some(stated(name, torque, tolerance, "N m"))
            });
        out.push(step(
            "breakaway",
            "motor torque at which the shaft begins to turn".into(),
            quantities.collect(),
        ));
    }
    if !facts.levels.is_empty() {
        let quantities = facts.levels.iter().filter(|l| l.thrust_n.is_finite()).map(|l| {
            let name = format!("thrust_n at {:.2} rad/s", l.shaft_speed_rad_s);
            stated(name, l.thrust_n, l.thrust_tolerance_n, "N")
        });
        let words = format!("{} levels held, ahead and astern", facts.levels.len());
        out.push(step("working_range", words, quantities.collect()));
    }
    if let Some(estimate) = estimate {
        let fit = &estimate.fit;
        let of_rig = |p: &&ParameterReport| Parameter::ALL.iter().any(|q| q.name() == p.name);
        let quantities: Vec<Stated> = fit
            .parameters
            .iter()
            .filter(of_rig)
            .chain(fit.effects.iter().flat_map(|e| &e.parameters))
            .map(of_fit)
            .collect();
        let mut together =
            step("estimated_together", "fitted to the whole record by kort fit".into(), quantities);
        for group in &fit.not_identifiable {
            // When within a tick sensors are read is nobody's question here.
            let names: Vec<&str> = group
                .parameters
                .iter()
                .filter(|name| *name != "sampling_delay_s")
                .map(|name| in_words(name))
                .collect();
            if !names.is_empty() {
                let are = if names.len() > 1 { "are not fixed" } else { "is not fixed" };
                together.skipped_because.push(format!("{} {are}: {}", names.join(", "), group.why));
            }
        }
        if torque_constant(estimate).is_none() {
            together.skipped_because.push("torque_constant_nm_a: nothing measures torque; as stated".into());
        }
        if !facts.measures("current_a") {
            together
                .skipped_because
                .push("time_constant_s, dead band: nothing measures current; the lag is as stated".into());
        }
        out.push(together);
    }
    debug_assert!(
        out.iter().all(|s| s.name == "estimated_together" || stages::ALL.contains(&s.name.as_str()))
    );
    out
}
