//! Identification: a model's free numbers from recordings, and what the recordings say for a hypothesis.
//!
//! Data go one way: recording, data (checks, edges), hypothesis (free numbers, priors, effects), simulate,
//! noise, fit.

mod averages;
pub mod between;
mod between_rows;
pub mod checks;
pub mod data;
pub mod edges;
mod excerpt;
pub mod fit;
mod free;
mod gaps;
mod held;
pub mod heldout;
pub mod hypothesis;
pub mod identifiable;
pub mod identify;
mod lag_on_command;
mod misread;
mod mistaken;
pub mod noise;
mod over_the_top;
mod quadratic;
mod readings;
mod refuse;
mod rest;
pub mod sampling;
pub mod scores;
pub mod setup;
mod shared_lanes;
pub mod simulate;
mod smooth;
pub mod spectrum;
mod step;
pub mod thin;
mod too_slow;
pub use quadratic::{Minimum, Quadratic, products};
