//! The diagnosis report: the JSON of `kort diagnose`, schema `kort.diagnosis/2`.

use std::collections::BTreeMap;

pub use kort_identify::scores::{BeforeAfter, ChannelReport, FittedEffect, HeldOut, ParameterReport};
use serde::Serialize;

/// Outcome of a diagnosis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// A re-fit within the stated tolerances explains the recording.
    NoMismatch,
    /// Named effects explain it, and no rival comes close.
    Explained,
    /// Named effects are probable, and real mismatch is left.
    PartlyExplained,
    /// Several named effects explain it and this excitation cannot part them.
    Ambiguous,
    /// The mismatch is real and no named effect explains it.
    Unexplained,
    /// The recording cannot tell.
    InsufficientData,
}

/// The re-fitted baseline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Baseline {
    /// Model's name.
    pub model: String,
    /// Its parameters, and those of the effects that are taken to be there.
    pub parameters: Vec<ParameterReport>,
    /// The effects that are taken to be there, because the rig states them or the command line does.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub effects: Vec<FittedEffect>,
    /// Its errors.
    pub channels: BTreeMap<String, ChannelReport>,
}

/// Where model and recording differ.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Mismatch {
    /// drive, shaft, blade, flow or sensor.
    pub path: String,
    /// The column where it shows most.
    pub channel: String,
    /// Words: when and where.
    pub regime: String,
    /// Spans in which most of it lies.
    pub time_s: Vec<[f64; 2]>,
    /// How far beyond the noise, in standard deviations.
    pub significance_sigma: f64,
    /// Its share of the error above the noise.
    pub share_of_excess_error: f64,
}

/// A named effect that explains the mismatch.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// Catalogue identifier.
    pub effect: String,
    /// Where it enters.
    pub path: String,
    /// Calibrated probability that this is the right name.
    pub probability: f64,
    /// In an engineer's words.
    pub statement: String,
    /// Equation.
    pub equation: String,
    /// Fitted values.
    pub parameters: Vec<ParameterReport>,
    /// Gain on held-out rows.
    pub heldout: HeldOut,
    /// Effects that this recording cannot tell from it.
    pub confounded_with: Vec<String>,
    /// Why.
    pub evidence: Vec<String>,
    /// Why a rig description does not take it over; null where it does.
    pub not_adopted: Option<String>,
}

/// A set of effects that explains the recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SetReport {
    /// Effects that are right together; none: not one of the catalogue.
    pub effects: Vec<String>,
    /// Its probability.
    pub probability: f64,
}

/// What the named effects leave; where one of them is in doubt and nothing else is left, what stays without that one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Remainder {
    /// Of the squared error above the noise.
    pub share_of_excess_error: f64,
    /// Where it acts, as far as a term that bends to anything tells.
    pub path: String,
    /// The column where it shows most.
    pub channel: String,
    /// Words: when and where.
    pub regime: String,
    /// Root mean square over full scale by channel, everything named taken into account.
    pub nrmse: BTreeMap<String, f64>,
}

impl Remainder {
    /// What is left at a place.
    pub fn at(place: Mismatch, share_of_excess_error: f64, nrmse: BTreeMap<String, f64>) -> Self {
        let Mismatch { path, channel, regime, .. } = place;
        Self { share_of_excess_error, path, channel, regime, nrmse }
    }
}

/// An effect that was tried and set aside.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Alternative {
    /// Catalogue identifier.
    pub effect: String,
    /// Calibrated probability.
    pub probability: f64,
    /// Words.
    pub why_not: String,
}

/// What is known of a mismatch without a name.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EmpiricalTerm {
    /// Where it enters.
    pub path: String,
    /// What it adds to, with its unit.
    pub enters: String,
    /// Formula with numbers.
    pub expression: String,
    /// Variables in it.
    pub variables: Vec<String>,
    /// Fitted values.
    pub parameters: Vec<ParameterReport>,
    /// Gain on held-out rows.
    pub heldout: HeldOut,
}

/// The run that would settle what this one cannot.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct NextExperiment {
    /// Effects it parts.
    pub separates: Vec<String>,
    /// Words.
    pub excitation: String,
    /// Words.
    pub why: String,
    /// A scenario that `kort simulate` runs.
    pub scenario: serde_json::Value,
}

/// The whole report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// `kort.diagnosis/2`
    pub schema: String,
    /// Version of kort.
    pub kort_version: String,
    /// Recordings by name.
    pub recordings: Vec<String>,
    /// Rig by name.
    pub rig: String,
    /// Seed of the bootstrap.
    pub seed: u64,
    /// Length of the recordings together, s (the same in every run: time spent goes to stderr).
    pub seconds: f64,
    /// Outcome.
    pub verdict: Verdict,
    /// One paragraph to act on.
    pub summary: String,
    /// The re-fitted baseline.
    pub baseline: Baseline,
    /// Where model and recording differ.
    pub mismatch: Vec<Mismatch>,
    /// Named effects.
    pub findings: Vec<Finding>,
    /// Sets of effects, likeliest first, until 0.95 is reached.
    pub explanations: Vec<SetReport>,
    /// What is left, where that is real.
    pub remainder: Option<Remainder>,
    /// Effects set aside.
    pub alternatives: Vec<Alternative>,
    /// What is known where no name fits.
    pub empirical_term: Option<EmpiricalTerm>,
    /// What to run next.
    pub next_experiment: Option<NextExperiment>,
    /// Cheap checks that found something, unused columns, effects that cannot be seen here.
    pub notes: Vec<String>,
}
