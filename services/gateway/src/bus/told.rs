//! What the bus tells the event log: what the desk noted, and what comes of servo and controller unasked.

use std::time::Instant;

use kort_proto::events::{Before, Event, EventKind};
use kort_proto::faults::Fault;
use kort_proto::messages::{ControllerState, Telemetry, Trip};
use kort_proto::transport::{Stood, Watched};

use super::Bridge;
use crate::view::MismatchView;

impl Bridge {
    /// What the desk noted goes to the event log.
    pub(super) fn tell_notes(&self, now: Instant) {
        let notes = {
            let mut desk = self.link.thruster.desk();
            desk.expire(now);
            desk.notes()
        };
        for note in notes {
            self.link.events.tell(note.kind, Some(&self.link.thruster.id), &note.who, note.detail);
        }
    }

    /// Faults that were not latched before go to the event log, with what the thruster did before. Those that this
    /// gateway finds latched at its start may stand there already.
    pub(super) fn tell_tripped(&mut self, who: usize, faults: u64, tripped: Option<&Trip>) {
        let known = self.latched[who].replace(faults);
        let id = &self.link.thruster.id;
        for fault in Fault::in_set(faults & !known.unwrap_or(0)) {
            if known.is_none() && self.link.events.latched(id, fault).is_some() {
                continue;
            }
            let process = ["servo", "controller"][who];
            let detail = format!("{} (code {}): {}", fault.name(), fault.code(), fault.help());
            let event = Event::now(EventKind::Tripped, Some(id), process, detail).fault(fault);
            let trip = tripped.filter(|trip| trip.at_ns != 0);
            let before = self.before.or(trip.map(|trip| Before::of(trip.thrust_n, trip.shaft_speed_rad_s)));
            // What came while no gateway looked, the supervisor saw come, and what a ramp began with: a gateway that is
            // lost misses both.
            let ramped = fault.is_ramped();
            let stood = if known.is_none() || ramped { self.seen_by_supervisor() } else { Stood::default() };
            let driven = stood.driven.or(self.before_ramp).filter(|_| ramped);
            let seen = stood.latched.into_iter().find(|latched| latched.code == fault.code());
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
        Watched::read(&self.watched).thrusters.remove(&self.link.thruster.id).unwrap_or_default()
    }

    /// A drive that was armed is not any more. Who asks for that is told of by whoever serves them, and so is a fault; where
    /// nobody commands any more nobody asks.
    pub(super) fn tell_disarmed(&mut self, telemetry: &Telemetry) {
        let armed = telemetry.armed != 0;
        let was = std::mem::replace(&mut self.armed, armed);
        if armed && !was {
            self.disarm_asked = false;
        }
        let faultless = telemetry.faults == 0 && self.latched.iter().all(|faults| faults.unwrap_or(0) == 0);
        if was && !armed && !self.disarm_asked && faultless {
            let id = &self.link.thruster.id;
            let led = self.link.thruster.desk().lease.current(Instant::now()).is_some();
            let words = if led {
                "disarmed, by none of this gateway's clients: the service stops, its servo is another, or another process asked for it"
            } else {
                "disarmed: nobody commands it any more"
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
