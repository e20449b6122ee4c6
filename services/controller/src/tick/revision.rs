//! Another revision of the rig, taken over while the thruster drives.

use kort_control::{Controller, ControllerConfig, ModelError};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;

use super::{Tick, drive_kind};

/// A controller for another revision of the rig, designed beside the tick. After [`Tick::adopt`] it holds the one that
/// was replaced, for whoever may free memory.
#[derive(Debug)]
pub struct Revision {
    controller: Controller,
    kind: DriveKind,
    number: u64,
}

impl Revision {
    /// Designs it; `number` is what the state will name it by.
    ///
    /// # Errors
    /// [`ModelError`] if no controller can be built for the rig.
    pub fn new(rig: &Rig, period_ns: u64, number: u64) -> Result<Self, ModelError> {
        // The configuration in force comes with the taking over.
        let controller = Controller::new(rig, &ControllerConfig::default(), period_ns as f64 * 1e-9)?;
        Ok(Self { controller, kind: drive_kind(rig), number })
    }
}

impl Tick {
    /// On this revision of the rig, as the state says.
    pub fn with_revision(self, number: u64) -> Self {
        Self { rig_revision: number, ..self }
    }

    /// Goes on with another revision: the command, what is believed of the water and the setpoint's ramp stay, so the
    /// drive sees no step. Neither allocates nor blocks.
    ///
    /// # Errors
    /// The kind of drive that this controller commands, if the revision states another: nothing has changed then.
    pub fn adopt(&mut self, next: &mut Revision) -> Result<(), DriveKind> {
        if next.kind != self.kind {
            return Err(self.kind);
        }
        next.controller.go_on_from(&self.controller);
        std::mem::swap(&mut self.controller, &mut next.controller);
        std::mem::swap(&mut self.rig_revision, &mut next.number);
        Ok(())
    }
}
