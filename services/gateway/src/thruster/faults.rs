//! A fault as the state shows it, with how it came.

use std::time::{Instant, SystemTime};

use kort_proto::events::{Before, EventKind};
use kort_proto::faults::Fault;

use super::Thruster;
use crate::heard::Heard;
use crate::view::{BeforeView, FaultView};

impl Thruster {
    /// The gateway itself noticed one that stops nothing.
    pub fn show_fault(&self, fault: Fault) {
        self.hear(|heard| heard.own_faults |= fault.bit());
    }

    /// A fault with what the event log knows of how it came.
    pub fn fault_view(&self, fault: Fault, heard: &Heard, now: Instant) -> FaultView {
        let came = self.events.latched(&self.id, fault);
        let told = came.as_ref().map(|event| event.since.as_ref().unwrap_or(&event.time).clone());
        let before = came.as_ref().and_then(|event| event.before);
        // Nobody has told yet of a servo that just fell silent: what it said last does.
        let silent = heard.servo.filter(|_| came.is_none() && fault == Fault::ServoLost);
        let last_word = silent.map(|(at, last)| {
            let time = SystemTime::now() - now.saturating_duration_since(at);
            let signals = last.signals;
            (
                humantime::format_rfc3339_micros(time).to_string(),
                Before::of(signals.thrust_n, signals.shaft_speed_rad_s),
            )
        });
        FaultView {
            code: fault.code(),
            name: fault.name(),
            help: fault.help(),
            cause: came
                .as_ref()
                .filter(|event| event.kind == EventKind::RecordingEnded)
                .map(|event| event.detail.clone()),
            since: told.or(last_word.as_ref().map(|(time, _)| time.clone())),
            before: before.or(last_word.map(|(_, before)| before)).map(|before| BeforeView {
                thrust_n: before.thrust_n,
                shaft_speed_rad_s: before.shaft_speed_rad_s,
            }),
        }
    }
}
