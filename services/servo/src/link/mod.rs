//! A device on a wire, served by a thread of its own: the tick leaves its newest command in one lock-free
//! slot and finds the newest reading in another, and never waits for a device.
//!
//! What is said on the wire is a [`Protocol`]: pure, fed with bytes, one file a device. The thread here is
//! the same for all: it opens the port (again and again while it is not there), has the protocol confirm the
//! drive's own time-out, and from then on exchanges a command and a question at the link's rate. A command is
//! sent once: a servo that stands still feeds nothing, and the drive's time-out takes the torque away.

pub mod can;
mod lines;
#[cfg(feature = "process")]
mod port;
#[cfg(any(feature = "process", test))]
mod questions;
#[cfg(any(feature = "process", test))]
mod stamps;
#[cfg(feature = "process")]
mod thread;
#[cfg(feature = "process")]
mod wire;

use std::fmt;
use std::net::SocketAddr;
use std::path::PathBuf;

use kort_proto::signals::Signals;

pub use lines::Lines;
#[cfg(feature = "process")]
pub(crate) use thread::{below_the_loop, printable};
#[cfg(feature = "process")]
pub(crate) use wire::{Ends, Told};
#[cfg(feature = "process")]
pub use wire::{Link, Wire};

/// What leads to a device.
#[derive(Clone, Debug, PartialEq)]
pub enum Medium {
    /// A serial port or an USB device that looks like one.
    Serial {
        /// The device.
        port: PathBuf,
        /// Bits a second; an USB device takes any.
        baud: u32,
    },
    /// A CAN interface of the system.
    Can {
        /// Its name.
        interface: PathBuf,
        /// The device's node there; what others say is left out.
        node: u8,
    },
    /// An address that is spoken to first, by UDP.
    Udp(SocketAddr),
}

impl Medium {
    /// What to look for when it cannot be opened.
    pub fn hint(&self) -> String {
        match self {
            Self::Serial { .. } => {
                "is it plugged in, powered, free, and may this user read and write it?".into()
            }
            Self::Can { interface, .. } => format!(
                "is it there and up? as root: ip link set {} up type can bitrate 1000000",
                interface.display()
            ),
            Self::Udp(_) => "is it reached (ping), and does an endpoint wait for clients there?".into(),
        }
    }
}

impl fmt::Display for Medium {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Serial { port, .. } => port.display().fmt(f),
            Self::Can { interface, .. } => interface.display().fmt(f),
            Self::Udp(address) => write!(f, "udp:{address}"),
        }
    }
}

/// What a protocol heard.
#[derive(Clone, Debug, PartialEq)]
pub enum Heard {
    /// Who answers, in words.
    Known(String),
    /// A whole answer with its measurements.
    Reading(Signals),
    /// The same, with the device's clock at them, us; it may begin anywhere, and does not go back in a conversation.
    ReadAt(Signals, u64),
    /// The answer to a question that is no reading: what comes behind it was sent after that was asked. With the
    /// device's clock then, us, if it tells one.
    Marked(Option<u64>),
    /// What the device says of itself, with each reading: its fault in words, or none.
    Fault(Option<String>),
    /// The device was reset.
    Restarted,
    /// The device is the right one and its own time-out is as it must be; the words say so.
    Guarded(String),
    /// It is not, and why.
    Unguarded(String),
}

/// What tells the age of a device's readings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ages {
    /// Each answers a question, and one is asked at a time.
    Questions,
    /// Each answers an exchange, and exchanges go on whether answered or not. The answer to a question among them, a mark,
    /// parts what was sent before the mark from what was sent after it.
    Exchanges,
    /// Each carries the device's clock, and answers to questions tell how that one stands to ours.
    Clock,
    /// Nothing: the device speaks by itself, and is as late as its wire.
    Unknown,
}

/// What is said on a wire. Pure: no clock, no port, no panic on any bytes.
pub trait Protocol: Send {
    /// A new conversation: the port was just opened, or the device reset.
    fn begin(&mut self);

    /// What to say next until the device is known and its time-out confirmed; called some times a second. What
    /// stays unanswered is heard too.
    fn ask(&mut self, out: &mut Vec<u8>, heard: &mut dyn FnMut(Heard));

    /// What is to be said at once after what was just heard: the next step of a conversation in many.
    fn reply(&mut self, _out: &mut Vec<u8>) {}

    /// One exchange: the command (`None`: output off) and, where `question` says so, the question for the measurements, or
    /// for the mark that tells their age.
    fn tell(&mut self, drive: Option<f64>, question: bool, out: &mut Vec<u8>);

    /// What tells the age of its readings.
    fn ages(&self) -> Ages {
        Ages::Questions
    }

    /// Takes bytes as they come, split and joined at will.
    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard));
}
