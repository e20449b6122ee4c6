//! What the bus tells the event log: what the desk noted, and what comes of servo and controller unasked.

use std::time::{Duration, Instant};

use kort_proto::events::{Before, Event, EventKind};
use kort_proto::faults::Fault;
use kort_proto::messages::{ControllerState, Telemetry, Trip};
use kort_proto::transport::{Stood, monotonic_ns};

use super::Bridge;
use crate::view::MismatchView;

/// Gateway, supervisor and servo each note a stop at their own time; no two stops of one thruster are so close, for
/// between them somebody starts processes anew, arms and asks for thrust.
const ONE_STOP: Duration = Duration::from_secs(1);

/// A ramp that was heard of so lately came to its end with the disarming.
const RAMP_OVER: Duration = Duration::from_millis(200);

/// Is it this stop that the log tells of? A fault that nobody cleared stands there though processes and shared memory were
/// started anew since and know nothing of it; then the same fault comes again. The supervisor says since when it is latched.
/// Where there is none the servo says when it was stopped last: that no thruster is armed while a fault is latched dates
/// whatever stands behind its last stop.
fn tells_of(told: &Event, since: Option<&str>, tripped: &Trip, now_ns: u64) -> bool {
    if let Some(since) = since {
        let time = |text: &str| humantime::parse_rfc3339(text).ok();
        let (since, told) = (time(since), time(told.since.as_deref().unwrap_or(&told.time)));
        return since.zip(told).is_none_or(|(since, told)| since <= told + ONE_STOP);
    }
    let one_stop_ns = ONE_STOP.as_nanos() as u64;
    // Of a later time than now is what an earlier start of the machine counted.
    tripped.at_ns == 0 || (told.monotonic_ns <= now_ns && tripped.at_ns <= told.monotonic_ns + one_stop_ns)
}

impl Bridge {
    /// Faults that were not latched before go to the event log, with what the thruster did before. Those that this
    /// gateway finds latched at its start may stand there already.
    pub(super) fn tell_tripped(&mut self, who: usize, faults: u64) {
        let known = self.latched[who].replace(faults);
        let id = &self.link.thruster.id;
        for fault in Fault::in_set(faults & !known.unwrap_or(0)) {
            // What came while no gateway looked, the supervisor saw come, and what a ramp began with: a gateway that is
            // lost misses both.
            let ramped = fault.is_ramped();
            let stood = if known.is_none() || ramped { self.seen_by_supervisor() } else { Stood::default() };
            let seen = stood.latched.into_iter().find(|latched| latched.code == fault.code());
            if known.is_none()
                && self.link.events.latched(id, fault).is_some_and(|told| {
                    let since = seen.as_ref().map(|seen| seen.since.as_str());
                    tells_of(&told, since, &self.tripped, monotonic_ns())
                })
            {
                continue;
            }
            let process = ["servo", "controller"][who];
            let detail = format!("{} (code {}): {}", fault.name(), fault.code(), fault.help());
            let event = Event::now(EventKind::Tripped, Some(id), process, detail).fault(fault);
            let trip = Some(&self.tripped).filter(|trip| who == 0 && trip.at_ns != 0);
            let before = self.before.or(trip.map(|trip| Before::of(trip.thrust_n, trip.shaft_speed_rad_s)));
            let driven = stood.driven.or(self.before_ramp).filter(|_| ramped);
            let since = seen.as_ref().filter(|_| known.is_none()).map(|seen| seen.since.clone());
            let before = seen.and_then(|seen| seen.before).or(driven).or(before);
            self.link.events.note(Event { since, before, ..event });
        }
        if faults == 0 && known.is_some_and(|known| known != 0) {
            self.before = None;
            self.before_ramp = None;
        }
    }

    /// How the thruster stood, by what the supervisor wrote down.
    fn seen_by_supervisor(&self) -> Stood {
        self.deployment.watched().thrusters.remove(&self.link.thruster.id).unwrap_or_default()
    }

    /// A drive that was armed is not any more. Who asks for that is told of by whoever serves them, and so is a fault; where
    /// nobody commands any more nobody asks.
    pub(super) fn tell_disarmed(&mut self, telemetry: &Telemetry) {
        let armed = telemetry.armed != 0;
        let was = std::mem::replace(&mut self.armed, armed);
        if armed && !was {
            self.disarm_asked = false;
            // A calibration arms by a way of its own, and only while it drives; when it disarms it may be at its estimation.
            let calibration = self.link.thruster.calibration(Instant::now()).filter(|step| step.drives);
            self.calibrates = calibration.map(|step| step.id);
        }
        let faultless = telemetry.faults == 0 && self.latched.iter().all(|faults| faults.unwrap_or(0) == 0);
        if was && !armed && !self.disarm_asked && faultless {
            let id = &self.link.thruster.id;
            let now = Instant::now();
            let led = self.link.thruster.desk().lease.current(now).is_some();
            let words = match self.calibrates.take() {
                Some(calibration) => format!("disarmed: calibration {calibration} drives it no more"),
                // Its controller may not have heard of the lease in force.
                None if led && self.ramped.is_some_and(|at| now.duration_since(at) < RAMP_OVER) => {
                    "disarmed at the end of a ramp to zero: the lease before was over, or the service stops".into()
                }
                None if led => "disarmed, by none of this gateway's clients: the service stops, its servo is another, or another \
                                process asked for it"
                    .into(),
                None => "disarmed: nobody commands it any more".into(),
            };
            self.link.events.tell(EventKind::Disarmed, Some(id), "servo", words);
        }
    }

    /// A path that is off, and that all is well again.
    pub(super) fn tell_mismatch(&mut self, state: &ControllerState) {
        if std::mem::replace(&mut self.mismatch_path, state.mismatch_path) != state.mismatch_path {
            let id = &self.link.thruster.id;
            self.link.events.tell(
                EventKind::Mismatch,
                Some(id),
                "controller",
                MismatchView::of(state).words(),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_that_comes_again_is_another_one_than_the_log_tells_of() {
        const S: u64 = 1_000_000_000;
        let at = |time: &str, s: u64| {
            let event =
                Event::now(EventKind::Tripped, Some("t1"), "controller", "").fault(Fault::GatewayLost);
            Event { time: time.into(), monotonic_ns: s * S, ..event }
        };
        let told = at("2026-07-01T12:00:00Z", 1000);
        let (never, stop) = (Trip::default(), |s: u64| Trip { at_ns: s * S, ..Trip::default() });
        // By the supervisor.
        let by = |since| tells_of(&told, Some(since), &stop(9000), 9001 * S);
        assert!(by("2026-07-01T12:00:00.700Z"), "each noted it at its own time");
        assert!(by("2026-07-01T11:59:58Z"), "told late");
        assert!(!by("2026-07-01T12:30:00Z"));
        // What is told as old as it is, is held against that.
        let late = Event { since: Some("2026-07-01T09:00:00Z".into()), ..told.clone() };
        assert!(tells_of(&late, Some("2026-07-01T09:00:00Z"), &never, 2000 * S));
        assert!(!tells_of(&late, Some("2026-07-01T11:59:59Z"), &never, 2000 * S));
        // By the servo alone.
        assert!(tells_of(&told, None, &stop(1000), 1500 * S));
        assert!(tells_of(&told, None, &never, 1500 * S), "nothing speaks against it");
        assert!(!tells_of(&told, None, &stop(1400), 1500 * S));
        assert!(!tells_of(&told, None, &stop(400), 500 * S), "the machine was started since");
    }
}
