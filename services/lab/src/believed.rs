//! What of a diagnosis belongs to the rig from now on.

use kort_diagnose::report::Report;
use kort_thruster::rig::FoundEffect;

use crate::fitted_rig::quantity;

/// What stands behind each value that is taken over into a rig description.
pub const DIAGNOSED: &str = "found by kort diagnose";

/// Findings that a rig takes over, with twice the standard error as tolerance.
pub fn believed(report: &Report) -> Vec<FoundEffect<'_>> {
    report
        .findings
        .iter()
        .filter(|f| f.not_adopted.is_none())
        .map(|f| FoundEffect {
            effect: &f.effect,
            parameters: f.parameters.iter().map(|p| (p.name.as_str(), quantity(p))).collect(),
        })
        .collect()
}

/// The others by name, each with why it is not taken over.
pub fn left_out(report: &Report) -> impl Iterator<Item = (&str, &str)> {
    report.findings.iter().filter_map(|f| Some((f.effect.as_str(), f.not_adopted.as_deref()?)))
}
