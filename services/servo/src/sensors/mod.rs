//! Sources of measurements beside the drive: a force cell, an encoder, a flow meter on wires of their own.
//! One kind, one file; [`Devices`](crate::devices::Devices) merges what they show by the signal table.

use kort_proto::signals::SIGNALS;

use crate::devices::{At, Shown};

/// Something that measures.
pub trait Source {
    /// What it shows at this tick. Called once a tick; may neither wait, allocate nor panic.
    fn show(&mut self, at: At) -> Shown;
}

/// A source as a thruster has it.
pub struct Sensor {
    /// The source.
    pub source: Box<dyn Source>,
    /// Places in the signal table of what it gives.
    pub gives: Vec<usize>,
    /// How long a reading stands before silence counts, ns.
    pub life_ns: u64,
    /// Its silence is a fault; without, the thruster goes on as if it had no such sensor.
    pub required: bool,
    /// When its newest reading came, on CLOCK_MONOTONIC, ns.
    pub read_ns: u64,
}

/// Place of a signal in the table.
pub fn place(name: &str) -> Option<usize> {
    SIGNALS.iter().position(|signal| signal.name == name)
}
