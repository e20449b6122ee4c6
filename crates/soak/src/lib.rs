//! Controllers compared on the same plant, faults and references, on virtual time.
//!
//! ```text
//! Scenario (what is true, asked, measured, broken) + rig -> Prepared
//! Prepared + controller + seed -> run -> Outcome -> LawResult -> ScenarioResult (verdict in words)
//! ```
//!
//! Pure: no clock, thread, file or socket. What stands between controller and plant (the servo, its
//! guards, an operator) is a [`Chain`] of the caller's: `kort soak` passes the production ticks.

mod chain;
mod check;
mod comparison;
mod disc;
mod faults;
pub mod hidden;
pub mod limits;
mod log;
mod read;
mod reference;
mod run;
mod scenario;
mod score;
mod script;
mod sea;
mod sensors;
mod summary;
mod truth;
mod verdict;

pub use chain::{Chain, Driven};
pub use comparison::{AGAINST_PLAIN, LawResult, OF_PLAIN, PLAIN, ScenarioResult};
pub use disc::Disc;
pub use hidden::{Drawn, Hidden};
pub use log::Log;
pub use reference::{Player, Replayed};
pub use run::{Knows, Prepared, Progress, run, run_logged, stream};
pub use scenario::{
    Ambient, CONTROL_RATES_HZ, Change, Channel, Depth, EffectSpec, Fitted, Lie, NEVER_WORSE, Noise,
    ProcessFault, ProcessFaultKind, Sag, Scenario, Segment, SensorFault, Truth,
};
pub use score::{Outcome, Point, SCORES, Sample, Tally, Window};
pub use summary::{Score, summarise, summarise_ratios};
pub use truth::{Hooked, effects};
