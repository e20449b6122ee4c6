//! Calibration of a thruster on its drive: a session of stages, each of which says what it is about to do and how
//! far the shaft will turn, starts small and stops on anything unexpected; and what its record says.
//!
//! Pure: the caller hands measurements in tick by tick and gets the drive back ([`Session::tick`]), on a real drive
//! as in a rehearsal on virtual time. [`estimate`] leaves all that can be estimated together to `kort-identify`.

mod estimate;
mod facts;
mod log;
mod plan;
mod pulse;
mod report;
mod session;
pub mod stages;
mod stop;
mod zeros;

pub use estimate::{Estimate, estimate, loosened, recorded};
pub use facts::{Answer, Breakaway, Facts, Level, RestReading};
pub use log::Log;
pub use plan::Plan;
pub use report::{Report, Stated, StepReport, stands_out, steps};
pub use session::{Next, Session};
pub use stop::Stop;
pub use zeros::{Zero, zeros};
