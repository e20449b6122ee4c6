//! Identification from recordings, and diagnosis: which physics did the model leave out?
