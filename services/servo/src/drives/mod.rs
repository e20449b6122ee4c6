//! Drives. One drive, one file, behind one trait; the loop knows no hardware.

pub mod cia402;
mod forms;
pub mod iio;
mod lying;
pub mod mavlink;
pub mod moteus;
pub mod odrive;
pub mod simulated;
pub mod vesc;
mod wired;
mod wrong;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::claims::Claim;
use crate::devices::{At, Shown};
use crate::link::Protocol;

use cia402::Cia402;
pub(crate) use forms::DEVICE;
use iio::Iio;
use mavlink::Mavlink;
use moteus::Moteus;
use odrive::ODrive;
pub use simulated::Simulated;
use vesc::Vesc;
pub use wired::{Own, Wired};
pub(crate) use wrong::Wrong;

/// A drive: takes commands, and tells what it measures itself.
///
/// Both [`show`](Self::show) and [`drive`](Self::drive) happen once a tick, in this order; neither may wait,
/// allocate or panic. Dropping a drive must switch its output off, and real hardware must have a time-out of its
/// own for a host that goes silent.
pub trait Drive {
    /// How long a reading stands before silence is `drive_lost`, ns; zero: every tick has one.
    fn reading_life_ns(&self) -> u64;

    /// What it shows at this tick.
    fn show(&mut self, at: At) -> Shown;

    /// Sets the drive, in the unit of the rig's amplifier; `None` switches the output stage off.
    fn drive(&mut self, now_ns: u64, drive: Option<f64>);
}

/// A drive as the configuration describes it; nothing is opened yet.
pub enum Chosen {
    /// A model of the rig in real time.
    Simulated(Box<Simulated>),
    /// A drive on a wire, and what is said on it.
    OnWire(Box<Wired>, Box<dyn Protocol>),
    /// An analogue amplifier behind the kernel's files.
    Iio(Box<Iio>),
}

/// Names of the drives, as `amplifier` gives them.
pub const ALL: [&str; 7] = ["simulated", "vesc", "odrive", "moteus", "cia402", "mavlink", "iio"];

/// Reads what the configuration says of the drive.
///
/// # Errors
/// [`ConfigError`] names the kinds there are.
pub fn choose(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Chosen, ConfigError> {
    // What waits is told beside what is read, and is as much a reason not to start.
    let waiting = unread(config, id, thruster);
    let chosen = read(config, id, thruster, rig);
    waiting.and(chosen)
}

/// The drive's own section.
fn read(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Chosen, ConfigError> {
    match thruster.amplifier.as_str() {
        "simulated" => Ok(Chosen::Simulated(Box::new(Simulated::new(config, id, thruster, rig)?))),
        "vesc" => {
            let vesc = Vesc::new(config, id, thruster, rig)?;
            Ok(Chosen::OnWire(Box::new(vesc.wired.clone()), Box::new(vesc::Protocol::new(vesc))))
        }
        "odrive" => {
            let odrive = ODrive::new(config, id, thruster, rig)?;
            Ok(Chosen::OnWire(Box::new(odrive.wired.clone()), Box::new(odrive::Protocol::new(odrive))))
        }
        "moteus" => {
            let moteus = Moteus::new(config, id, thruster, rig)?;
            Ok(Chosen::OnWire(Box::new(moteus.wired.clone()), Box::new(moteus::Protocol::new(moteus))))
        }
        "cia402" => {
            let drive = Cia402::new(config, id, thruster, rig)?;
            Ok(Chosen::OnWire(Box::new(drive.wired.clone()), Box::new(cia402::Protocol::new(drive))))
        }
        "mavlink" => {
            let drive = Mavlink::new(config, id, thruster, rig)?;
            Ok(Chosen::OnWire(Box::new(drive.wired.clone()), Box::new(mavlink::Protocol::new(drive))))
        }
        "iio" => Ok(Chosen::Iio(Box::new(Iio::new(config, id, thruster, rig)?))),
        other => Err(config.error(format!(
            "`thrusters.{id}.amplifier` = \"{other}\" is no drive\nhint: known are \"{}\"",
            ALL.join("\", \"")
        ))),
    }
}

/// The section that this drive does not read: it waits for another `amplifier`, and is held to the names of its keys all the
/// same, for what is misspelt there is found on the day of the change.
fn unread(config: &Config, id: &str, thruster: &Thruster) -> Result<(), ConfigError> {
    if thruster.amplifier != "simulated" {
        return simulated::check_keys(config, &format!("thrusters.{id}.simulation"), thruster);
    }
    let section = format!("thrusters.{id}.drive");
    if thruster.drive.contains_key("dac") {
        iio::check_keys(config, &section, thruster)
    } else {
        wired::check_keys(config, &section, thruster)
    }
}

impl Chosen {
    /// What no other device may have too.
    pub fn claims(&self) -> Vec<Claim> {
        match self {
            Self::Simulated(_) => Vec::new(),
            Self::OnWire(wired, _) => wired.claims.clone(),
            Self::Iio(iio) => iio.claims(),
        }
    }
}

#[cfg(feature = "process")]
impl Chosen {
    /// Starts it; `priority` is the loop's.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had. A device that is not there is a fault, not an error.
    pub fn start(self, id: &str, priority: i32) -> std::io::Result<Box<dyn Drive>> {
        match self {
            Self::Simulated(drive) => Ok(drive),
            Self::OnWire(wired, protocol) => {
                Ok(Box::new(crate::link::Link::start(wired.wire(id, priority), protocol)?))
            }
            Self::Iio(iio) => Ok(Box::new(iio.start(id, priority)?)),
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

/// The same for a drive that takes current or speed, and no volts.
fn current_or_speed(
    config: &Config,
    id: &str,
    thruster: &Thruster,
    rig: &Rig,
    wrong: &mut Vec<ConfigError>,
) -> DriveKind {
    let kind = kind_of(rig);
    if kind == DriveKind::Voltage {
        wrong.push(config.error(format!(
            "`thrusters.{id}.amplifier` = \"{}\" takes current or speed, but the rig's amplifier is of kind voltage\nhint: amplifier.kind = \"current\" in the rig, with its current_limit_a",
            thruster.amplifier
        )));
    }
    kind
}

#[cfg(test)]
mod tests;
