//! Identification from recordings, and diagnosis: which physics did the model leave out?

pub mod baseline;
pub mod data;
pub mod edges;
pub mod fit;
pub mod heldout;
pub mod library;
pub mod noise;
pub mod screen;
pub mod search;
