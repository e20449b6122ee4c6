//! What was last heard of servo and controller, and for how long it counts.

use std::time::{Duration, Instant};

use kort_proto::faults::Fault;
use kort_proto::messages::{ControllerState, Telemetry};

/// A process not heard for this long is away.
pub const AWAY_AFTER: Duration = Duration::from_millis(300);

/// Last word of servo and controller.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heard {
    /// Silence of the servo after which nothing is claimed of its drive any more: some of its periods.
    pub servo_silence: Duration,
    /// Counts up with every sample.
    pub version: u64,
    /// The servo's last telemetry and when it came.
    pub servo: Option<(Instant, Telemetry)>,
    /// The controller's last state and when it came.
    pub controller: Option<(Instant, ControllerState)>,
    /// Faults of the gateway's own, as a bitset.
    pub own_faults: u64,
}

impl Heard {
    /// The servo's last word, unless it is away.
    pub fn telemetry(&self, now: Instant) -> Option<&Telemetry> {
        self.servo
            .as_ref()
            .filter(|(at, _)| now.saturating_duration_since(*at) < AWAY_AFTER)
            .map(|(_, heard)| heard)
    }

    /// The controller's last word, unless it is away.
    pub fn controller(&self, now: Instant) -> Option<&ControllerState> {
        self.controller
            .as_ref()
            .filter(|(at, _)| now.saturating_duration_since(*at) < AWAY_AFTER)
            .map(|(_, heard)| heard)
    }

    /// Latched faults of both processes, as a bitset.
    pub fn faults(&self, now: Instant) -> u64 {
        self.telemetry(now).map_or(0, |t| t.faults) | self.controller(now).map_or(0, |c| c.faults)
    }

    /// Limits in force in both processes, as a bitset.
    pub fn limits(&self, now: Instant) -> u64 {
        self.telemetry(now).map_or(0, |t| t.limits) | self.controller(now).map_or(0, |c| c.limits)
    }

    /// Is the drive known to be armed now? A servo that is silent for some of its periods may be dead: what is
    /// shown must not say armed then.
    pub fn shown_armed(&self, now: Instant) -> bool {
        self.armed(now) && !self.servo_silent(now)
    }

    /// Is the servo silent for longer than its loop takes?
    pub fn servo_silent(&self, now: Instant) -> bool {
        self.servo.as_ref().is_none_or(|(at, _)| now.saturating_duration_since(*at) > self.servo_silence)
    }

    /// Faults as shown: the gateway's own too, which stop nothing, and a servo that fell silent while armed, before its
    /// successor can say so.
    pub fn shown_faults(&self, now: Instant) -> u64 {
        let armed_last = self.servo.as_ref().is_some_and(|(_, telemetry)| telemetry.armed != 0);
        let lost = if armed_last && self.servo_silent(now) { Fault::ServoLost.bit() } else { 0 };
        self.faults(now) | self.own_faults | lost
    }

    /// Was the drive armed when the servo was last heard, not long ago? A hiccup of this process is no reason to
    /// forget a setpoint.
    pub fn armed(&self, now: Instant) -> bool {
        self.telemetry(now).is_some_and(|t| t.armed != 0)
    }

    /// Is the servo (the controller) heard?
    pub fn alive(&self, now: Instant) -> (bool, bool) {
        (self.telemetry(now).is_some(), self.controller(now).is_some())
    }
}
