//! Sources of measurements beside the drive: a force cell, an encoder, a flow meter on wires of their own.
//! One kind, one file; [`Devices`](crate::devices::Devices) merges what they show by the signal table.

pub mod iio;
mod plausible;
#[cfg(feature = "process")]
mod polled;
pub mod serial_line;
mod settings;
mod units;

use kort_proto::signals::SIGNALS;

use crate::devices::{At, Shown};

pub use plausible::Plausible;
pub use settings::{Chosen, Kind, choose};

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

/// Which part of a source is which signal, and what its numbers mean.
#[derive(Clone, Debug, PartialEq)]
pub struct Channel<F> {
    /// The part: a column, a file.
    pub from: F,
    /// Place of the signal in the table.
    pub place: usize,
    /// SI units in one of the source's; negative where it points the other way.
    pub scale: f64,
    /// Value at the source's zero, SI.
    pub offset: f64,
    /// Largest magnitude that can be, SI.
    pub most: f64,
}

impl<F> Channel<F> {
    /// A number of the source in SI.
    ///
    /// # Errors
    /// No thruster or water can be so, in words.
    pub fn si(&self, value: f64) -> Result<f64, String> {
        let si = value * self.scale + self.offset;
        if si.abs() <= self.most {
            return Ok(si);
        }
        let (name, unit) = SIGNALS.get(self.place).map_or(("", ""), |signal| (signal.name, signal.unit));
        Err(format!("gives {name} = {si:.4e} {unit}, beyond the {:.4e} that can be: no reading", self.most))
    }
}

/// Place of a signal in the table.
pub fn place(name: &str) -> Option<usize> {
    SIGNALS.iter().position(|signal| signal.name == name)
}
