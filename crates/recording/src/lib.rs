//! Recordings with SI columns: read, write, and map foreign logs.
//!
//! A recording is a table over strictly increasing `time_s`; every other column holds a number or
//! NaN for "not sampled then". Files are CSV (plain or gzip) or MCAP, recognised by content. A log
//! with other names or units comes in through a [`ColumnMap`]; nothing is guessed.
//!
//! [`Recording::decode`] takes any reader and opens nothing itself; [`Recording::read`] is the
//! same for a path.

mod assemble;
mod cell;
pub mod columns;
mod dates;
mod decimal;
mod error;
pub mod formats;
pub mod log;
pub mod map;
mod recording;
pub mod units;

pub use dates::Order;
pub use error::{Place, Problem, RecordingError};
pub use formats::{Format, LiveMcap, TOPIC, Writer, message_schema, state_schema};
pub use log::{Survey, survey};
pub use map::{ColumnMap, MapError, MapErrors};
pub use recording::{Column, Gap, Recording, logs_in};
