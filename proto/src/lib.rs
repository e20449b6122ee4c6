//! What the processes say to each other: fixed-layout messages, the table of signals, faults and
//! limits, service names, and (feature `transport`) the shared memory that carries them.
//!
//! ```text
//! gateway --Setpoint--> controller --Command--> servo --Telemetry--> all
//!                       controller --ControllerState--> gateway
//! gateway --Request--> controller, servo --Reply--> gateway
//! ```

pub mod complaint;
#[cfg(feature = "config")]
pub mod config;
#[cfg(feature = "config")]
pub mod cores;
#[cfg(feature = "events")]
pub mod events;
pub mod faults;
pub mod limits;
pub mod messages;
pub mod names;
#[cfg(feature = "events")]
pub mod ours;
#[cfg(feature = "config")]
pub mod revision;
pub mod signals;
pub mod text;
#[cfg(feature = "transport")]
pub mod transport;
