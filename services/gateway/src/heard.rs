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
    /// How often it is listened for: what a turn takes longer is a hold-up of this process, and no silence of the servo.
    pub turn: Duration,
    /// Silence up to the last turn, and when that was.
    silent: (Duration, Option<Instant>),
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
    /// Nothing yet.
    pub fn new(servo_silence: Duration, turn: Duration) -> Heard {
        Heard { servo_silence, turn, ..Heard::default() }
    }

    /// It was listened for the servo; something came, or nothing.
    pub fn looked(&mut self, now: Instant, came: bool) {
        self.silent = (if came { Duration::ZERO } else { self.silence(now) }, Some(now));
    }

    /// How long the servo is silent, of the time that somebody listened.
    pub fn silence(&self, now: Instant) -> Duration {
        let (before, looked) = self.silent;
        before + looked.map_or(Duration::ZERO, |at| now.saturating_duration_since(at).min(self.turn))
    }

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
        self.servo.is_none() || self.silence(now) > self.servo_silence
    }

    /// Faults as shown: the gateway's own too, which stop nothing, and a servo that is gone and takes an armed drive or latched
    /// faults along, its own end among them, before its successor can say so.
    pub fn shown_faults(&self, now: Instant) -> u64 {
        let lost = self.servo.as_ref().is_some_and(|(_, last)| {
            let latched = last.faults != 0 && self.telemetry(now).is_none();
            (last.armed != 0 || latched) && self.servo_silent(now)
        });
        self.faults(now) | self.own_faults | if lost { Fault::ServoLost.bit() } else { 0 }
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

#[cfg(test)]
mod tests {
    use super::*;

    const TURN: Duration = Duration::from_millis(4);
    const SILENCE: Duration = Duration::from_millis(8);

    fn heard_armed(at: Instant) -> Heard {
        let telemetry = Telemetry { armed: 1, ..Telemetry::default() };
        let mut heard = Heard { servo: Some((at, telemetry)), ..Heard::new(SILENCE, TURN) };
        heard.looked(at, true);
        heard
    }

    #[test]
    fn a_gateway_that_is_held_up_takes_no_servo_for_lost() {
        let t0 = Instant::now();
        let ms = |n| t0 + Duration::from_millis(n);
        let mut heard = heard_armed(t0);
        assert!(heard.shown_armed(ms(50)), "nobody listened meanwhile");
        assert_eq!(heard.shown_faults(ms(50)), 0);
        heard.looked(ms(50), false);
        assert!(heard.shown_armed(ms(51)), "a servo that was held up with it comes a moment later");
        heard.looked(ms(52), true);
        assert!(heard.shown_armed(ms(59)));
        for turn in 0..3 {
            heard.looked(ms(60 + 4 * turn), false);
        }
        assert!(!heard.shown_armed(ms(69)), "three turns in time and nothing came");
        assert_eq!(heard.shown_faults(ms(69)), Fault::ServoLost.bit());
    }

    /// Its last word is that it is disarmed, and of what; who looks later still sees that it did not end as asked.
    #[test]
    fn a_servo_that_was_told_to_end_while_armed_is_lost_too() {
        let t0 = Instant::now();
        let ms = |n| t0 + Duration::from_millis(n);
        let gone = |faults, now| {
            let last = Telemetry { armed: 0, faults, ..Telemetry::default() };
            let mut heard = Heard { servo: Some((t0, last)), ..Heard::new(SILENCE, TURN) };
            heard.looked(t0, true);
            (1..=120).for_each(|turn| heard.looked(ms(4 * turn), false));
            heard.shown_faults(now)
        };
        let restarted = Fault::ServoRestarted.bit();
        assert_eq!(gone(restarted, ms(100)), restarted, "it has just said so itself");
        assert_eq!(gone(restarted, ms(400)), Fault::ServoLost.bit());
        assert_eq!(gone(0, ms(400)), 0, "at rest and without a fault nothing is lost");
    }
}
