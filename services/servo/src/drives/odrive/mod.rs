//! An ODrive (firmware 0.5, its first axis) on USB or a serial port, by its ASCII protocol with check sums.
//!
//! Read for this: the ASCII protocol page of the ODrive documentation, and what the firmware's interface description and
//! `ascii_protocol.cpp` (odriverobotics/ODrive, 0.5.6) say about properties, formats and the watchdog.
//!
//! Units on the wire: torque in N m, speed in turns a second, angle in turns, current (`Iq_measured`) in A. Signs are
//! the drive's; `reversed` turns all of them. A rig of kind `current` is driven by torque, current times the torque constant that the
//! *drive* was given, which kort reads, so that the amperes are right; `speed` by the drive's own speed loop; volts it does not take.
//!
//! Its own watchdog: `axis0.config.enable_watchdog` and `watchdog_timeout`. kort sets both at each start, saves nothing, reads them
//! again, and asks for the first with every exchange; after the time-out the axis reports `WATCHDOG_TIMER_EXPIRED` and lets the
//! motor go. That error, which every silence leaves, is cleared at the start; any other is `amplifier_fault` until
//! somebody clears it in the drive.
//!
//! Which one it is: the serial number that `i` prints, twelve hexadecimal digits, as `odrivetool` shows it. Property `serial_number` would
//! not do: `r` prints the first nine characters of a number. With `identity` another one, or one that tells none, is not armed.
//!
//! Output on is the axis in closed loop control, off is idle: the shaft coasts. An axis that leaves closed loop by
//! itself is `amplifier_fault`. A reset shows by the watchdog being off again, or by USB going away.

mod protocol;
pub mod text;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;

pub use protocol::Protocol;

use super::forms::{DEVICE, NUMBER_OF_12};
use super::{Own, Wired, current_or_speed};

/// Life of a reading where `reading_life_ms` is left out. An exchange is seven lines of text and their six answers: some 270
/// bytes, 24 ms at 115200 baud, and by USB as long on a machine that is busy elsewhere. An answer with a line lost is none. One
/// is missed after twice the way that the last one took, and asked for again: with the way of the answer that stands, of
/// the lost one's patience and of the new one that is four ways, 96 ms. Half as much again for a machine that holds the thread up.
const READING_LIFE_MS: f64 = 150.0;

/// What of the section `drive` is its own.
const OWN: Own = Own { keys: &[], port: DEVICE, identity: NUMBER_OF_12, reading_life_ms: READING_LIFE_MS };

/// An ODrive as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct ODrive {
    /// The wire.
    pub wired: Wired,
    /// Unit of the drive.
    pub kind: DriveKind,
}

impl ODrive {
    /// Reads the section `drive`.
    ///
    /// # Errors
    /// [`ConfigError`] names key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let mut wrong = Vec::new();
        let wired = Wired::read(config, id, thruster, &OWN, &mut wrong)?;
        let kind = current_or_speed(config, id, thruster, rig, &mut wrong);
        config.first_of(wrong.into_iter()).map_or(Ok(()), Err)?;
        Ok(Self { wired, kind })
    }
}
