//! Physics that a rig is known to have (`[[effects]]`), used the same way under every law and observer.
//!
//! Laws and observers are written for an ideal plant: torque in proportion to current, the command obeyed, sensors
//! that show what is, friction a function of speed. [`Known`] stands between that plant and the one the rig
//! states, and is the inverse of what composes it:
//!
//! ```text
//! sensors -> measured()  what the effects add to the sensors taken off          -> ideal measurement
//!            ideal_a()   torque of a current, as the current of the ideal motor -> observer, estimator
//! law     -> actual_a()  the current that gives the torque, ripple included     -> limits
//!         -> command()   the command that the drive turns into that current, voltage or speed
//! ```
//!
//! It is the catalogue's own code that is asked, not a second set of equations: what is static is probed
//! once and put into the [`ControlModel`] ([`design`]); what has a memory, follows the shaft angle, or sits in the
//! drive's command is asked at every tick, a bounded number of times. An effect that comes new into the catalogue
//! is used without a line here; [`uses`] says by the same probing what each is used for, and names
//! what none of it reaches.

mod building;
mod curves;
mod design;
mod drive;
mod motion;
mod sensing;
pub mod uses;

use kort_thruster::effects::{Context, Descriptor, Effect};
use kort_thruster::parameters::Parameters;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::model::{ControlModel, HeldLift};
use crate::signals::{Estimate, Measurement};

use building::Building;
pub use curves::{FoilCurve, FrictionCurve};
pub use design::command_late_s;
pub(crate) use design::design;
use drive::DriveChain;
pub use drive::{OperatingPoint, Reach};
use motion::Motion;
use sensing::Sensing;

/// An effect with the values that a rig states.
pub(crate) type Built = (&'static Descriptor, Box<dyn Effect>);

/// The rig's effects as the catalogue builds them, for a tick of that length. A tick longer than any memory gives
/// what each does once it has settled.
pub(crate) fn built(rig: &Rig, tick_s: f64) -> Vec<Built> {
    let parameters = Parameters::stated(rig);
    let context = Context { parameters: &parameters, rig, tick_s };
    rig.effects
        .iter()
        .filter_map(|known| {
            let descriptor = known.descriptor()?;
            let values: Vec<f64> = known.values().collect();
            Some((descriptor, (descriptor.build.plain)(&values, &context)))
        })
        .collect()
}

/// A tick beside which every memory of an effect is short, s.
pub(crate) const SETTLED_S: f64 = 1e9;

/// The inverse of what a rig's effects do, at work.
pub struct Known {
    drive: DriveChain,
    motion: Motion,
    sensing: Sensing,
    building: Building,
    /// A speed drive's torque is its own affair.
    by_speed: bool,
}

impl std::fmt::Debug for Known {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let (drive, motion, sensing) =
            (!self.drive.is_idle(), !self.motion.is_idle(), !self.sensing.is_idle());
        let building = !self.building.is_idle();
        write!(f, "Known {{ drive: {drive}, motion: {motion}, sensing: {sensing}, building: {building} }}")
    }
}

impl Known {
    /// Of a rig, with the model designed for it.
    pub fn new(rig: &Rig, model: &ControlModel) -> Self {
        Self {
            drive: DriveChain::new(rig, model),
            motion: Motion::new(rig, model),
            sensing: Sensing::new(rig, model),
            building: Building::new(rig, model),
            by_speed: rig.amplifier.kind == AmplifierKind::Speed,
        }
    }

    /// What ideal sensors would show: what the effects are expected to add to them, at the last estimate, taken off.
    pub fn measured(
        &mut self,
        measured: &Measurement,
        last: Option<&Estimate>,
        model: &ControlModel,
    ) -> Measurement {
        if self.sensing.is_idle() { *measured } else { self.sensing.corrected(measured, last, model) }
    }

    /// Where the shaft is and what has become of slow effects, once a tick; whether there is anything to follow.
    pub fn advance(
        &mut self,
        measured: &Measurement,
        last: Option<&Estimate>,
        current_a: f64,
        dt_s: f64,
    ) -> bool {
        if !self.motion.is_idle() {
            self.motion.advance(measured, last, current_a, dt_s);
        }
        !self.motion.is_idle()
    }

    /// What the blades' lift lacks now, where it is known to build up: once a tick, for the observers' prediction.
    pub fn held_lift(
        &mut self,
        last: Option<&Estimate>,
        model: &ControlModel,
        dt_s: f64,
    ) -> Option<HeldLift> {
        self.building.held(last, model, dt_s)
    }

    /// Ambient flow that effects bring, m/s.
    pub fn ambient_m_s(&self) -> f64 {
        self.motion.ambient_m_s()
    }

    /// Current of an ideal motor that gives the torque of this current, A.
    pub fn ideal_a(&self, model: &ControlModel, current_a: f64) -> f64 {
        if self.motion.is_idle() || self.by_speed { current_a } else { self.motion.ideal_a(model, current_a) }
    }

    /// Current that gives the torque of this current of an ideal motor, A.
    pub fn actual_a(&self, model: &ControlModel, ideal_a: f64) -> f64 {
        if self.motion.is_idle() || self.by_speed { ideal_a } else { self.motion.actual_a(model, ideal_a) }
    }

    /// What the drive can give now; `None` where no effect is at work on it.
    pub fn reach(&mut self, at: OperatingPoint) -> Option<Reach> {
        (!self.drive.is_idle()).then(|| self.drive.reach(at))
    }

    /// The command that the drive turns into what is wanted (A, V or rad/s, as the drive takes it).
    pub fn command(&mut self, wanted: f64, at: OperatingPoint) -> f64 {
        if self.drive.is_idle() { wanted } else { self.drive.command(wanted, at) }
    }

    /// What the drive turns a command into.
    pub fn given(&mut self, command: f64, at: OperatingPoint) -> f64 {
        if self.drive.is_idle() { command } else { self.drive.pass(command, at).command }
    }
}
