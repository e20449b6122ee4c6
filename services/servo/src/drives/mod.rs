//! Drives. One drive, one file, behind one trait; the loop knows no hardware.

mod lying;
pub mod moteus;
pub mod odrive;
pub mod simulated;
pub mod vesc;
mod wired;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::devices::{At, Shown};
use crate::link::Protocol;

pub use moteus::Moteus;
pub use odrive::ODrive;
pub use simulated::Simulated;
pub use vesc::Vesc;
pub use wired::Wired;

/// A drive: takes commands, and tells what it measures itself.
///
/// Both [`show`](Self::show) and [`drive`](Self::drive) happen once a tick, in this order; neither may wait,
/// allocate or panic. Dropping a drive must switch its output off, and real hardware must have a time-out of its
/// own for a host that goes silent.
pub trait Drive {
    /// Unit of the drive.
    fn kind(&self) -> DriveKind;

    /// How long a reading stands before silence is `drive_lost`, ns; zero: every tick has one.
    fn reading_life_ns(&self) -> u64;

    /// What it shows at this tick.
    fn show(&mut self, at: At) -> Shown;

    /// Sets the drive, in the unit of [`Self::kind`]; `None` switches the output stage off.
    fn drive(&mut self, now_ns: u64, drive: Option<f64>);
}

/// A drive as the configuration describes it; nothing is opened yet.
pub enum Chosen {
    /// A model of the rig in real time.
    Simulated(Box<Simulated>),
    /// A VESC on a serial port or USB.
    Vesc(Vesc),
    /// An ODrive on USB or a serial port.
    ODrive(ODrive),
    /// A moteus behind an fdcanusb adapter, or on its UART.
    Moteus(Moteus),
}

/// A drive on a wire: the wire, its unit, and what is said on it.
pub type OnWire = (Wired, DriveKind, Box<dyn Protocol>);

/// Names of the drives, as `amplifier` gives them.
pub const ALL: [&str; 4] = ["simulated", "vesc", "odrive", "moteus"];

/// Reads what the configuration says of the drive.
///
/// # Errors
/// [`ConfigError`] names the kinds there are.
pub fn choose(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Chosen, ConfigError> {
    match thruster.amplifier.as_str() {
        "simulated" => Ok(Chosen::Simulated(Box::new(Simulated::new(config, id, thruster, rig)?))),
        "vesc" => Ok(Chosen::Vesc(Vesc::new(config, id, thruster, rig)?)),
        "odrive" => Ok(Chosen::ODrive(ODrive::new(config, id, thruster, rig)?)),
        "moteus" => Ok(Chosen::Moteus(Moteus::new(config, id, thruster, rig)?)),
        other => Err(config.error(format!(
            "`thrusters.{id}.amplifier` = \"{other}\" is no drive\nhint: known are \"{}\"",
            ALL.join("\", \"")
        ))),
    }
}

impl Chosen {
    /// The wire of a real drive and what is said on it; the simulated one has none, and is ready.
    ///
    /// # Errors
    /// The simulated drive.
    pub fn on_wire(self) -> Result<OnWire, Box<dyn Drive>> {
        Ok(match self {
            Self::Simulated(drive) => return Err(drive),
            Self::Vesc(vesc) => (vesc.wired.clone(), vesc.kind, Box::new(vesc::Protocol::new(vesc))),
            Self::ODrive(odrive) => {
                (odrive.wired.clone(), odrive.kind, Box::new(odrive::Protocol::new(odrive)))
            }
            Self::Moteus(moteus) => {
                (moteus.wired.clone(), moteus.kind, Box::new(moteus::Protocol::new(moteus)))
            }
        })
    }

    /// Starts it; `priority` is the loop's.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had. A device that is not there is a fault, not an error.
    #[cfg(feature = "process")]
    pub fn start(self, id: &str, priority: i32) -> std::io::Result<Box<dyn Drive>> {
        match self.on_wire() {
            Ok((wired, kind, protocol)) => {
                Ok(Box::new(crate::link::Link::start(wired.wire(id, priority), kind, protocol)?))
            }
            Err(drive) => Ok(drive),
        }
    }
}

/// Unit of the drive that the rig's amplifier is.
pub fn kind_of(rig: &Rig) -> DriveKind {
    match rig.amplifier.kind {
        AmplifierKind::Current => DriveKind::Current,
        AmplifierKind::Voltage => DriveKind::Voltage,
        AmplifierKind::Speed => DriveKind::Speed,
    }
}
