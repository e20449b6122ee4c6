//! How a setpoint ends, what passes from one controller to the next, and what one leaves when its work ends, or its servo's
//! does.

use kort_proto::faults::Fault;
use kort_proto::messages::{Command, SetpointKind};

use super::Tick;

/// After the lease's end the setpoint falls to zero in this time, then the servo is stopped: all within 500 ms.
const LEASE_RAMP_NS: u64 = 400_000_000;
/// The same where the gateway fell silent, which took its time to be noticed.
const GATEWAY_RAMP_NS: u64 = 300_000_000;

/// The setpoint goes to zero, and why.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ending {
    /// When it began, on CLOCK_MONOTONIC, ns.
    pub since_ns: u64,
    /// Fault to latch when zero is reached; none for a lease that ended.
    pub cause: Option<Fault>,
    /// At zero the law goes on holding it, until somebody disarms: the service is about to end.
    pub hold: bool,
}

impl Ending {
    /// Does a setpoint of the next lease take its place? What only says that nobody commands does not: the ramp is gentler.
    pub fn gives_way_to(&self, kind: Option<SetpointKind>) -> bool {
        self.cause.is_none() && !self.hold && kind != Some(SetpointKind::Zero)
    }

    fn ramp_ns(&self) -> u64 {
        if self.cause.is_some() { GATEWAY_RAMP_NS } else { LEASE_RAMP_NS }
    }

    /// Has the ramp come to zero?
    pub fn is_over(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.since_ns) >= self.ramp_ns()
    }

    /// What is left of the setpoint.
    pub fn share(&self, now_ns: u64) -> f64 {
        (1.0 - now_ns.saturating_sub(self.since_ns) as f64 / self.ramp_ns() as f64).max(0.0)
    }
}

impl Tick {
    /// Lets the setpoint end; the first reason stays, but a fault is not forgotten for a lease that ends too.
    pub(super) fn end(&mut self, now_ns: u64, cause: Option<Fault>) {
        match &mut self.ending {
            Some(ending) => ending.cause = ending.cause.or(cause.filter(|_| !ending.hold)),
            None => self.ending = Some(Ending { since_ns: now_ns, cause, hold: false }),
        }
    }

    /// A setpoint of the next lease counts: it goes on from where the ramp of the one before has come to.
    pub(super) fn end_ramp(&mut self) {
        if self.ending.take().is_some() {
            self.slew.goes_on_from(self.in_force);
        }
    }

    /// Zero is reached; must the servo be stopped? Not where somebody else has taken command meanwhile and given no setpoint
    /// yet: that one finds the drive armed, at rest. The old setpoint under a lease that lives on is none of that.
    pub(super) fn end_over(&mut self, cause: Option<Fault>, now_ns: u64) -> bool {
        let led_anew =
            now_ns < self.lease_until_ns && self.setpoint.is_some_and(|over| over.generation != self.asked);
        match cause {
            Some(fault) => self.trip(fault),
            None if led_anew => {
                self.forget();
                self.slew.reset();
                return false;
            }
            None => (),
        }
        true
    }

    /// With the faults that a predecessor had latched.
    pub fn with_latched(self, latched: u64) -> Self {
        Self { latched, ..self }
    }

    /// What stands latched when another servo, with a shared memory of its own, takes the place of the one that is heard: that
    /// one knows nothing of the faults of this, nor that it drove.
    pub fn leaves_behind(&self) -> u64 {
        let lost = self.armed || self.servo_faults != 0;
        self.latched | if lost { Fault::ServoLost.bit() } else { 0 }
    }

    /// The last command before the process ends.
    pub fn last_command(&self, command: Command) -> Command {
        let stop = if self.latched == 0 { Command::ENDS } else { Command::STOPS };
        Command { drive: 0.0, stop, ..command }
    }
}
