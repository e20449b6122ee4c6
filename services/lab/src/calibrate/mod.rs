//! Calibration around the pure session: the stand of a rehearsal, the wire to a living servo, and what is made of
//! the record.

pub mod concealed;
pub mod conclude;
pub mod live;
pub mod rehearse;
mod servo;
pub mod stand;
