//! A moteus controller behind an fdcanusb adapter, or on its UART, which speaks the same lines.
//!
//! Read for this: the register, CAN, diagnostic, UART and configuration pages of the moteus documentation (mjbots/moteus), and
//! `moteus/error.h` there for the faults.
//!
//! Units on the wire: torque in N m, speed in turns a second, angle in turns, Q current in A, all as 32-bit floats. Signs are the
//! drive's; `reversed` turns all of them. A rig of kind `current` is driven in position mode with every gain at zero and the torque
//! fed forward, current times the *rig's* torque constant: the amperes are as right as that constant, and the Q current told
//! shows it. `speed` is position mode with a velocity and no position. Volts it does not take.
//!
//! Its own watchdog: each command carries the time it is valid for (register 0x027). What the drive does after it is
//! `servo.timeout_mode`, which must be 0, stopped: the factory's 12 would brake. kort reads it through the diagnostic channel and sets it in
//! RAM where it differs (`conf set`, never `conf write`), and reads it again.
//!
//! Which one it is: the serial number of 96 bits in registers 0x120 to 0x122, least significant word first, here in hexadecimal with the
//! most significant first. With `identity` another one, or one that tells none, is not armed.
//!
//! Output off is mode 0, stopped: the shaft coasts; it also clears the drive's faults, which are `amplifier_fault` as long as they
//! stand. A drive that leaves position mode by itself, or whose millisecond counter goes back, was reset. Lines carry a
//! check sum wherever the far end uses one, which a UART always does; over USB the bus has its own.

mod protocol;
pub mod text;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;

pub use protocol::Protocol;

use super::forms::{DEVICE, NUMBER_OF_24};
use super::wired::LIFE_MS;
use super::{Own, Wired, current_or_speed};

/// What of the section `drive` is its own.
const OWN: Own = Own { keys: &["address"], port: DEVICE, identity: NUMBER_OF_24, reading_life_ms: LIFE_MS };

/// A moteus as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Moteus {
    /// The wire.
    pub wired: Wired,
    /// Unit of the drive.
    pub kind: DriveKind,
    /// Its number on the bus.
    pub address: u8,
    /// Torque of an ampere, N m/A.
    pub torque_constant_nm_a: f64,
}

impl Moteus {
    /// Reads the section `drive`.
    ///
    /// # Errors
    /// [`ConfigError`] names key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let mut wrong = Vec::new();
        let wired = Wired::read(config, id, thruster, &OWN, &mut wrong)?;
        let kind = current_or_speed(config, id, thruster, rig, &mut wrong);
        let address = wired.address.unwrap_or(1);
        if !(1..=126).contains(&address) {
            wrong.push(config.error(format!(
                "`thrusters.{id}.drive.address` = {address} is outside 1 to 126\nhint: 1 unless it was changed with moteus_tool"
            )));
        }
        config.first_of(wrong.into_iter()).map_or(Ok(()), Err)?;
        let address = u8::try_from(address).unwrap_or(1);
        Ok(Self { wired, kind, address, torque_constant_nm_a: rig.motor.torque_constant_nm_a.value })
    }
}
