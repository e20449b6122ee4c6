//! The controller: setpoint and telemetry in, drive command out.
//!
//! [`tick`] is the pure step: which setpoint counts, what a loss leads to, and the control law of
//! `kort-control` under it. The process (feature `process`) adds clock and shared memory; it wakes
//! when the servo has sent telemetry.

pub mod pace;
#[cfg(feature = "process")]
mod process;
pub mod slew;
#[cfg(test)]
mod tests;
pub mod tick;
#[cfg(feature = "process")]
mod workshop;

#[cfg(feature = "process")]
pub use process::{ControllerError, check, doubtful, problems, run};
