//! What of a diagnosis belongs to the rig from now on.

use kort_diagnose::report::Report;
use kort_thruster::rig::FoundEffect;

use crate::fitted_rig::quantity;

/// Least probability with which a name belongs to the rig from now on.
const BELIEVED: f64 = 0.7;

/// What stands behind each value that is taken over into a rig description.
pub const DIAGNOSED: &str = "found by kort diagnose";

/// Findings that a rig can take over, with twice the standard error as tolerance.
pub fn believed(report: &Report) -> Vec<FoundEffect<'_>> {
    report
        .findings
        .iter()
        .filter(|f| f.probability >= BELIEVED && f.confounded_with.is_empty())
        .map(|f| FoundEffect {
            effect: &f.effect,
            parameters: f.parameters.iter().map(|p| (p.name.as_str(), quantity(p))).collect(),
        })
        .collect()
}
