//! The diagnosis or the fit of a thruster, for its state.

use std::time::Instant;

use super::{Thruster, lock};
use crate::analysis::{AnalysisKind, JobStep, Underway};

impl Thruster {
    /// A diagnosis or a fit of it has come so far, or is over.
    pub fn set_analysis(&self, at: Option<Underway>) {
        *lock(&self.analysis) = at;
    }

    /// How far the one of this kind is, if it runs.
    pub fn analysis(&self, kind: AnalysisKind, now: Instant) -> Option<JobStep> {
        lock(&self.analysis).as_ref().filter(|underway| underway.kind == kind).map(|underway| JobStep {
            id: underway.id.clone(),
            step: underway.step.clone(),
            elapsed_s: now.saturating_duration_since(underway.began).as_secs_f64(),
        })
    }
}
