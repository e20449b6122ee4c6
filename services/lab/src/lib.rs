//! The laboratory: simulate, fit, diagnose, explain, soak, reproduce, prove.
