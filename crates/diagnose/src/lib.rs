//! Diagnosis: which physics did the model leave out?
pub mod probe;
pub mod screen;
pub mod search;
