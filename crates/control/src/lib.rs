//! Control laws, observers and estimators for marine thrusters.
//!
//! Pure: no clock, thread, file or socket, and no allocation once built. One [`Controller`] is an
//! observer, an estimator, a control law and the limits, ticked in that order on one
//! [`Measurement`] and one [`Reference`]:
//!
//! ```text
//! measurement -> observer -> estimate -+-> law -> torque -> limits -> drive command
//!             -> estimator -> model ---+                      |
//!                                      ^---- applied torque --+   (anti-windup, prediction)
//! ```
//!
//! Each law, observer and estimator is one file that says where it comes from, what it assumes,
//! what it needs measured and how it fails; each kind is an enum with `ALL`, so that the shared
//! suites in `tests/` reach every one.

pub mod about;
pub mod advice;
pub mod config;
pub mod controller;
pub mod estimators;
pub mod known;
pub mod laws;
pub mod limits;
pub mod mismatch;
pub mod model;
pub mod observers;
pub mod signals;

pub use about::About;
pub use advice::{Advice, TimeScales, advise};
pub use config::{ConfigError, ControllerConfig, TUNABLES, Tunable};
pub use controller::{Controller, Output};
pub use estimators::EstimatorKind;
pub use laws::LawKind;
pub use limits::{Limit, LimitSet};
pub use mismatch::Mismatch;
pub use model::{ControlModel, ModelError};
pub use observers::ObserverKind;
pub use signals::{DriveCommand, Estimate, Estimated, Measurement, Reference};
