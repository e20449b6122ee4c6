//! The seed paper's tables and figures, computed: L. L. Whitcomb and D. R. Yoerger, "Comparative
//! Experiments in the Dynamics and Model-Based Control of Marine Thrusters".
//!
//! Only what is printed there stands here as a number; everything beside it comes out of the
//! models, the composed plant or a fit. Where the print and its own equations disagree, both are
//! shown and nothing is tuned.

mod figure;
mod identification;
mod servo;
mod steady;
mod steps;

use kort_thruster::parameters::Parameters;
use kort_thruster::rig::{Rig, RigError};
use serde::Serialize;

pub use figure::{Figure, Mark, Series};

/// The stand's description, as shipped.
const STAND: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

/// A value in a table: a number, words, or nothing.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Shown {
    /// A number, SI.
    Number(f64),
    /// Words where the paper has words.
    Words(String),
    /// Not printed, or not computable.
    Nothing,
}

/// What the comparison says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// Within the tolerance that the note names, or the same in words.
    Agrees,
    /// Not so.
    Disagrees,
    /// The paper shows it as a curve or not at all.
    NotCheckable,
}

impl Verdict {
    /// In words.
    pub const fn words(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Disagrees => "disagrees",
            Self::NotCheckable => "not checkable",
        }
    }
}

/// One printed value beside ours.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Row {
    /// Stable name.
    pub id: &'static str,
    /// What it is, with its unit.
    pub what: String,
    /// As printed.
    pub printed: Shown,
    /// As computed.
    pub ours: Shown,
    /// `100 (ours/printed - 1)`, where both are numbers.
    pub deviation_pct: Option<f64>,
    /// What the comparison says.
    pub verdict: Verdict,
    /// Tolerance, cause of a disagreement, how it was computed.
    pub note: String,
}

impl Row {
    /// Two numbers: agrees within `within_pct`.
    fn number(id: &'static str, what: &str, printed: f64, ours: f64, within_pct: f64, note: &str) -> Self {
        let deviation = 100.0 * (ours / printed - 1.0);
        let verdict = if deviation.abs() <= within_pct { Verdict::Agrees } else { Verdict::Disagrees };
        Self {
            id,
            what: what.into(),
            printed: Shown::Number(printed),
            ours: Shown::Number(ours),
            deviation_pct: Some(deviation),
            verdict,
            note: format!("tolerance {within_pct} %. {note}"),
        }
    }

    /// Words of the paper against a computed finding.
    fn words(id: &'static str, what: &str, printed: &str, ours: String, same: bool, note: &str) -> Self {
        Self {
            id,
            what: what.into(),
            printed: Shown::Words(printed.into()),
            ours: Shown::Words(ours),
            deviation_pct: None,
            verdict: if same { Verdict::Agrees } else { Verdict::Disagrees },
            note: note.into(),
        }
    }

    /// A value of ours with nothing printed to hold it against.
    fn alone(id: &'static str, what: &str, ours: f64, note: &str) -> Self {
        Self {
            id,
            what: what.into(),
            printed: Shown::Nothing,
            ours: Shown::Number(ours),
            deviation_pct: None,
            verdict: Verdict::NotCheckable,
            note: note.into(),
        }
    }
}

/// One table or figure of the paper.
pub struct Part {
    /// Heading.
    pub title: &'static str,
    /// What was done.
    pub text: String,
    /// Values.
    pub rows: Vec<Row>,
    /// Plots.
    pub figures: Vec<Figure>,
}

/// The stand with its stated parameters.
struct Paper {
    rig: Rig,
    parameters: Parameters,
}

/// Computes everything.
///
/// # Errors
/// The shipped description of the stand cannot be read: an error of the program.
pub fn all(seed: u64) -> Result<Vec<Part>, RigError> {
    let rig = Rig::from_toml(STAND)?;
    let paper = Paper { parameters: Parameters::stated(&rig), rig };
    Ok(vec![
        steady::relations(&paper),
        steady::efficiencies(&paper),
        identification::part(&paper, seed),
        steps::one_step(&paper),
        steps::eighteen_steps(&paper),
        steps::overshoot(&paper),
        steady::attack(&paper),
        servo::part(&paper),
    ])
}

/// Settled mean of the last tenth.
fn settled(y: &[f64]) -> f64 {
    let tail = &y[y.len() - y.len().div_ceil(10)..];
    tail.iter().sum::<f64>() / tail.len() as f64
}

/// How far a response passes its settled value, percent of it; zero if it never does.
fn overshoot_pct(y: &[f64]) -> f64 {
    let end = settled(y);
    let peak = y.iter().map(|v| v / end).fold(f64::NEG_INFINITY, f64::max);
    (100.0 * (peak - 1.0)).max(0.0)
}

/// Time until a response first reaches 90 % of its settled value, s.
fn rise_s(t: &[f64], y: &[f64]) -> f64 {
    let end = settled(y);
    t.iter().zip(y).find(|(_, v)| **v / end >= 0.9).map_or(f64::NAN, |(t, _)| *t)
}

#[cfg(test)]
mod tests {
    use crate::*;

    #[test]
    fn every_row_is_finite_and_named_once() {
        let parts = all(1).unwrap();
        let rows: Vec<&Row> = parts.iter().flat_map(|p| &p.rows).collect();
        let mut ids: Vec<_> = rows.iter().map(|r| r.id).collect();
        ids.sort_unstable();
        let count = ids.len();
        ids.dedup();
        assert_eq!(ids.len(), count);
        for row in &rows {
            if let Shown::Number(x) = row.ours {
                assert!(x.is_finite(), "{row:?}");
            }
        }
        let verdict = |id: &str| rows.iter().find(|r| r.id == id).unwrap().verdict;
        assert_eq!(verdict("fig8_attack_angle"), Verdict::Disagrees);
        assert_eq!(verdict("eta_from_eq20"), Verdict::Disagrees);
        for id in ["eq18", "eq19", "eq20", "eta_from_eq18", "fig7_lift_max", "friction_nothing_hidden"] {
            assert_eq!(verdict(id), Verdict::Agrees, "{id}");
        }
    }
}
