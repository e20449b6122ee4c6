//! What stands between an operator's thrust and the drive: controller, servo and operator.

use kort_control::{Controller, ControllerConfig, ModelError, Output};
use kort_proto::signals::Signals;
use kort_thruster::rig::Rig;

/// What the drive gets at one tick.
#[derive(Clone, Copy, Debug)]
pub struct Driven {
    /// Command in the amplifier's unit; zero while not armed.
    pub command: f64,
    /// The output stage is on.
    pub armed: bool,
}

/// One thruster's controller with all that runs beside it, ticked on virtual time.
pub trait Chain: Sized {
    /// At rest, with a controller designed for the rig.
    ///
    /// # Errors
    /// [`ModelError`] if no controller can be designed for it.
    fn start(rig: &Rig, config: &ControllerConfig, period_s: f64) -> Result<Self, ModelError>;

    /// One tick: what is measured and what thrust is asked for, N; `alive` says whether the controller
    /// ticks at all.
    fn tick(&mut self, measured: &Signals, thrust_n: f64, alive: bool) -> Driven;

    /// The controller comes up afresh: nothing of the old one is left.
    fn restart(&mut self);

    /// The law with its observer and estimator.
    fn controller(&self) -> &Controller;

    /// The last output of the controller.
    fn output(&self) -> &Output;

    /// How often the drive has gone off by itself.
    fn trips(&self) -> u32;
}
