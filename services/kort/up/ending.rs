//! The end of the service: thrust to zero, then every process ends, and what did not end so is told.

use std::time::{Duration, Instant};

use kort_proto::events::{Event, EventKind};
use kort_proto::messages::RequestKind;
use tracing::{info, warn};

use super::{LOOK_EVERY, STOP_WITHIN, Service, UpError};

/// How long a thruster may take to come to rest before its drive is switched off, and after.
const REST_WITHIN: Duration = Duration::from_millis(2500);
const COAST_WITHIN: Duration = Duration::from_secs(3);

impl Service {
    /// Thrust to zero, then every process ends: the gateway first, so that nobody commands any more; the servo last.
    ///
    /// # Errors
    /// [`UpError::NotStopped`] if a servo ended armed without having switched its drive off.
    pub(super) fn end(mut self) -> Result<(), UpError> {
        // A servo that never came up has nothing to set to zero.
        if self.roles.iter().any(|role| role.name == "servo" && role.child.is_some()) {
            self.go_to_zero();
        }
        let mut armed = Vec::new();
        for role in self.roles.iter_mut().rev() {
            let by_itself = role.end();
            let mine = |id: &str| role.name == "servo" && role.thruster.as_deref() == Some(id);
            let Some(watch) = self.watches.iter_mut().find(|watch| mine(watch.id())) else { continue };
            if by_itself || !watch.stood.armed {
                // Its last deed is to switch the drive off.
                watch.stood.armed = false;
                continue;
            }
            let words = format!(
                "the servo ended while armed, without switching the drive off, last heard at {}",
                watch.words()
            );
            warn!(thruster = watch.id(), "{words}; only the drive's own time-out stops it");
            let event = Event::now(EventKind::ProcessEnded, Some(watch.id()), "supervisor", words);
            let (since, before) = (watch.stood.heard.clone(), watch.driven_till_now());
            self.scribe.event(Event { since, before, ..event });
            // The next service finds it latched.
            watch.servo_ended();
            armed.push(watch.id().to_owned());
        }
        self.write_down();
        let words = "the service was stopped";
        self.scribe.event(Event::now(EventKind::ServiceStopped, None, "supervisor", words));
        self.scribe.finish();
        info!("stopped");
        if armed.is_empty() { Ok(()) } else { Err(UpError::NotStopped { thrusters: armed.join(", ") }) }
    }

    /// Ramps every thruster down, disarms it at rest, and says what is left of thrust and speed.
    fn go_to_zero(&mut self) {
        self.hear();
        let begun = Instant::now();
        let mut asked = begun - LOOK_EVERY;
        // First the controllers brake; whoever is at rest, or does not get there in time, is disarmed.
        while self.watches.iter().any(|watch| watch.speaks() && watch.stood.armed) {
            let late = begun.elapsed() >= REST_WITHIN;
            if begun.elapsed() >= REST_WITHIN + STOP_WITHIN {
                break;
            }
            if asked.elapsed() >= LOOK_EVERY {
                asked = Instant::now();
                for watch in self.watches.iter_mut().filter(|watch| watch.stood.armed) {
                    let kind = if late || watch.at_rest() { RequestKind::Disarm } else { RequestKind::Rest };
                    watch.ask(kind);
                }
            }
            std::thread::sleep(Duration::from_millis(4));
            self.hear();
        }
        // A shaft that was not braked coasts down.
        let disarmed = Instant::now();
        while disarmed.elapsed() < COAST_WITHIN
            && self.watches.iter().any(|watch| watch.speaks() && !watch.at_rest())
        {
            std::thread::sleep(LOOK_EVERY);
            self.hear();
        }
        for watch in &self.watches {
            let (thruster, words) = (watch.id(), watch.words());
            match (watch.speaks(), watch.stood.armed, watch.at_rest()) {
                (false, ..) => warn!(thruster, "the servo does not answer; last heard at {words}"),
                (true, true, _) => {
                    warn!(thruster, "the servo does not disarm; its end switches the drive off")
                }
                (true, false, true) => info!(thruster, "thrust at zero ({words}), disarmed"),
                (true, false, false) => {
                    warn!(thruster, "disarmed, the drive is off, but the shaft still turns: {words}")
                }
            }
        }
    }
}
