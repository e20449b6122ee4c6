//! Diagnosis: which physics did the model leave out?
//!
//! Data go one way: probes and screens say which effects are worth a fit, the search fits sets of them, the
//! posterior weighs the sets, one function decides, and words come last.

mod adoption;
mod cancelling;
mod choices;
mod column;
pub mod constants;
pub mod decide;
pub mod diagnose;
mod differs;
mod experiment;
pub mod flexible;
mod follows;
mod left;
mod left_aside;
mod load_steps;
mod locate;
mod nameless;
mod place;
pub mod posterior;
mod probe;
pub mod report;
mod screen;
mod search;
#[cfg(test)]
mod stand;
pub mod traces;
mod unfinished;
mod unknown;
mod unparted;
mod words;
mod write;
