//! Faults that a service before this one left latched: they stand from the first tick on, and are told as what they
//! are, old. The event log need not know of them: it lies in the folder the service is started in, shared memory is
//! the user's.

use kort_proto::events::{Event, EventKind, EventLog, Standing};
use kort_proto::faults::Fault;
use kort_proto::transport::Stood;
use tracing::warn;

/// Says what each thruster is still latched with and since when; what the log has not told is added to it.
pub fn tell<'a>(stood: impl Iterator<Item = (&'a str, &'a Stood)>, log: &EventLog) {
    let mut known = None;
    for (id, stood) in stood {
        for latched in &stood.latched {
            let Some(fault) = Fault::ALL.into_iter().find(|fault| fault.code() == latched.code) else {
                continue;
            };
            let since = &latched.since;
            let words = format!("{} (code {}) is latched since {since}", fault.name(), fault.code());
            warn!(
                thruster = id,
                "{words}, before this start\nhint: once its cause is gone, POST /v1/thrusters/{id}/clear-faults, or \"Clear faults\" in the console"
            );
            let known: &Standing = known.get_or_insert_with(|| log.read().iter().collect());
            if known.of(id, fault).is_some() {
                continue;
            }
            let words = format!("{words}, before this start: {}", fault.help());
            let event = Event::now(EventKind::FaultInherited, Some(id), "supervisor", words)
                .fault(fault)
                .since(since.clone());
            // A disk that refuses is told of by whoever writes next.
            let _ = log.append(&match latched.before {
                Some(before) => event.before(before),
                None => event,
            });
        }
    }
}
