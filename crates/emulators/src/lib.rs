//! Drives and instruments on pseudo terminals, behind UDP, or behind files as the kernel shows them, for tests.
//!
//! Each is written from the protocol's public description and shares no code with kort's drivers: its framing, its check sums
//! and its text are its own. Behind each a simulated thruster turns in real time, with the drive's own limits, quantisation and
//! time-out. [`Bench`] is the same for all: it carries bytes, and spoils them when a test asks for it.
//!
//! What an emulator cannot show: the timing of USB and of a real UART (bytes arrive at once), a real power stage, and
//! whatever a firmware does that its description does not say.

pub mod ardusub;
mod bench;
mod canopen;
pub mod cia402;
mod far;
mod folder;
pub mod iio;
mod mavlink;
pub mod moteus;
pub mod odrive;
mod printer;
mod pty;
pub mod slcan;
mod stand;
pub mod vesc;

pub use ardusub::ArduSub;
pub use bench::{Bench, Device, Mischief, Truth};
pub use cia402::Cia402;
pub use folder::InFiles;
pub use iio::Amplifier;
pub use moteus::Moteus;
pub use odrive::ODrive;
pub use printer::Printer;
pub use slcan::Adapter;
pub use stand::Stand;
pub use vesc::Vesc;
