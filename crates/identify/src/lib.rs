//! Identification from recordings, and diagnosis: which physics did the model leave out?

pub mod baseline;
pub mod changes;
pub mod checks;
pub mod data;
pub mod diagnose;
pub mod edges;
pub mod errors;
pub mod experiment;
pub mod fit;
pub mod heldout;
pub mod identifiable;
pub mod identify;
pub mod judge;
pub mod library;
pub mod locate;
mod look;
pub mod noise;
mod refit;
pub mod refuse;
pub mod report;
pub mod rules;
pub mod screen;
pub mod search;
mod smooth;
mod step;
mod together;
pub mod words;
