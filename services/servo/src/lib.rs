//! The servo: the loop between controller and drive.
//!
//! ```text
//! deadline -> requests, newest command -> measure -> tick (guard) -> drive -> telemetry
//! ```
//!
//! [`tick`] is the pure step, [`guard`] holds limits and trips, [`drives`] and [`sensors`] are what
//! hangs on wires, merged by [`devices`]; what each has to itself is in [`claims`]; the process (feature `process`) adds the clock, real-time
//! scheduling and shared memory. Once the loop runs it allocates nothing, takes no lock and has no path
//! that panics; `tests/no_allocation.rs` counts, and says what iceoryx2 does when a sample is sent.

pub mod claims;
pub mod devices;
pub mod direction;
pub mod drives;
pub mod guard;
pub mod link;
#[cfg(feature = "process")]
mod process;
pub mod sensors;
pub mod settings;
mod still;
pub mod sysfs;
pub mod tick;
pub mod water;

#[cfg(feature = "process")]
pub use process::{Inherited, ServoError, check, problems, run};
