//! A truth simulation for the blind proof. Shares no equation code with the models that kort fits;
//! only `kort prove` and tests may use it.
//!
//! [`case`] builds a recording, the rig file stated for it, and the sealed answer. The thruster is
//! either one blade section at 0.7 r or several along the blade ([`thruster`]), integrated by Heun's
//! method at 0.2 ms ([`dynamics`]), seen through a sensor chain of its own ([`chain`], [`stand`]).
//! Each hidden effect has one strength, set so that it moves its best channel by a wanted share of
//! full scale ([`calibrate`]).
//!
//! Seeds 1 to 999 are for tuning; reports use seeds from [`REPORTING_SEED`] on.

pub mod calibrate;
mod case;
pub mod chain;
pub mod dynamics;
pub mod effects;
pub mod hidden;
pub mod noise;
pub mod programme;
mod refit;
pub mod rig;
pub mod stand;
pub mod thruster;

pub use case::{Answer, Case, CaseKind, HiddenEffect, Selection, case};

/// First seed of reported runs; tuning never looks at these.
pub const REPORTING_SEED: u64 = 1_000_000;
