//! A VESC (or one of its many kin) on a serial port or USB, firmware 6 and 7, motor type FOC.
//!
//! Read for this: the framing and command pages of the VESC documentation, and what `datatypes.h`, `commands.c`,
//! `confgenerator.c` and `timeout.c` of the firmware (vedderb/bldc, 7.01 and its history back to 6.00) say about
//! fields, scales and signs.
//!
//! Units on the wire: current 1 mA to the drive and 10 mA from it, duty 1e-5, speed in electrical turns a minute
//! (shaft speed times pole pairs), supply 0.1 V, temperature 0.1 deg C, angle in sixths of an electrical turn. Signs are
//! the drive's; `reversed` turns all of them. The current told is the torque-producing one (`iq`, positive ahead), averaged since
//! the last answer.
//!
//! A rig of kind `current` is driven by current, `voltage` by duty (volts over the supply the drive tells), `speed` by
//! the drive's own speed loop. Output off is current zero: the shaft coasts.
//!
//! Its own watchdog: `timeout_msec` of the app configuration; after it the drive brakes with `timeout_brake_current`, which must
//! be zero. kort reads both. If they are not as they must be it sets them until the next power-off
//! (`COMM_SET_APPCONF_NO_STORE`, all other settings as they were) and reads them again; what is not confirmed then is `drive_unguarded`,
//! and nobody can arm. Nothing is ever stored in the drive.
//!
//! Unplugged: the port hangs up, `drive_lost` within one tick of that (within `reading_life_ms` on a plain UART), and
//! the drive's time-out takes the torque away. A reset shows by the counter of motor steps, which only grows.

pub mod frame;
mod protocol;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;

pub use protocol::Protocol;

use super::forms::{DEVICE, NUMBER_OF_24};
use super::wired::LIFE_MS;
use super::{Own, Wired, kind_of};

/// What of the section `drive` is its own.
const OWN: Own =
    Own { keys: &["pole_pairs"], port: DEVICE, identity: NUMBER_OF_24, reading_life_ms: LIFE_MS };

/// A VESC as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Vesc {
    /// The wire.
    pub wired: Wired,
    /// Unit of the drive.
    pub kind: DriveKind,
    /// Pole pairs of the motor.
    pub pole_pairs: f64,
    /// Supply that duty is reckoned with until the drive tells its own, V.
    pub supply_v: f64,
}

impl Vesc {
    /// Reads the section `drive`.
    ///
    /// # Errors
    /// [`ConfigError`] names key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let mut wrong = Vec::new();
        let wired = Wired::read(config, id, thruster, &OWN, &mut wrong)?;
        let key = format!("thrusters.{id}.drive.pole_pairs");
        let hint = "half the number of the rotor's magnets; 7 for a T200";
        let pole_pairs = match wired.pole_pairs {
            Some(pairs) if (1..=100).contains(&pairs) => pairs as f64,
            Some(pairs) => {
                wrong.push(config.error(format!("`{key}` = {pairs} is outside 1 to 100\nhint: {hint}")));
                1.0
            }
            None => {
                wrong.push(
                    config.error(format!("`{key}` is missing: a VESC tells electrical speed\nhint: {hint}")),
                );
                1.0
            }
        };
        config.first_of(wrong.into_iter()).map_or(Ok(()), Err)?;
        let supply_v = rig.amplifier.supply_v.unwrap_or(f64::NAN);
        Ok(Self { wired, kind: kind_of(rig), pole_pairs, supply_v })
    }
}
