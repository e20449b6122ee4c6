//! Drives. One drive, one file, behind one trait; the loop knows no hardware.

mod lying;
pub mod simulated;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;
use kort_thruster::rig::Rig;

pub use simulated::Simulated;

/// The drive reports a fault of its own, or does not answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AmplifierFault;

/// A drive with the sensors that hang on it.
///
/// Both calls happen once a tick, `measure` first; neither may block, allocate or panic. Dropping
/// a drive must switch its output off, and real hardware must have a time-out of its own for a
/// host that goes silent.
pub trait Amplifier {
    /// Unit of the drive.
    fn kind(&self) -> DriveKind;

    /// Reads all sensors; what is not measured (now) is left alone. `ticks` is how many periods
    /// passed since the last call.
    ///
    /// # Errors
    /// [`AmplifierFault`] if the drive reports a fault or does not answer.
    fn measure(&mut self, ticks: u64, into: &mut Signals) -> Result<(), AmplifierFault>;

    /// Sets the drive, in the unit of [`Self::kind`]; `None` switches the output stage off.
    fn drive(&mut self, drive: Option<f64>);
}

/// Builds the drive that the configuration names.
///
/// # Errors
/// [`ConfigError`] names the kinds there are.
pub fn build(
    config: &Config,
    id: &str,
    thruster: &Thruster,
    rig: &Rig,
) -> Result<Box<dyn Amplifier>, ConfigError> {
    match thruster.amplifier.as_str() {
        "simulated" => Ok(Box::new(Simulated::new(config, id, thruster, rig)?)),
        other => Err(config.error(format!(
            "`thrusters.{id}.amplifier` = \"{other}\" is no drive\nhint: known is \"simulated\""
        ))),
    }
}
