//! Writes what the supervisor has to say to disk, on a thread of its own: a slow disk must not keep it from
//! watching.

use std::path::PathBuf;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use kort_proto::events::{Event, EventLog};
use kort_proto::transport::Watched;
use tracing::warn;

enum Entry {
    Event(Box<Event>),
    Watched(Box<Watched>),
}

/// The supervisor's pen.
pub struct Scribe {
    outbox: Sender<Entry>,
    thread: JoinHandle<()>,
}

impl Scribe {
    /// Starts writing to the event log and to the file beside the shared memory.
    pub fn start(log: EventLog, watched: PathBuf) -> std::io::Result<Self> {
        let (outbox, inbox) = channel();
        let thread =
            std::thread::Builder::new().name("scribe".into()).spawn(move || write(&log, &watched, &inbox))?;
        Ok(Self { outbox, thread })
    }

    /// Notes an event.
    pub fn event(&self, event: Event) {
        let _ = self.outbox.send(Entry::Event(Box::new(event)));
    }

    /// Notes how things stand.
    pub fn watched(&self, watched: Watched) {
        let _ = self.outbox.send(Entry::Watched(Box::new(watched)));
    }

    /// Waits a moment for what was noted to be on disk.
    pub fn finish(self) {
        drop(self.outbox);
        let end = Instant::now() + Duration::from_secs(1);
        while !self.thread.is_finished() && Instant::now() < end {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

fn write(log: &EventLog, watched: &std::path::Path, inbox: &Receiver<Entry>) {
    let mut complained = false;
    while let Ok(first) = inbox.recv() {
        // On a disk that is slower than what is noted only the newest of how things stand counts.
        let (states, events): (Vec<_>, Vec<_>) = std::iter::once(first)
            .chain(inbox.try_iter())
            .partition(|entry| matches!(entry, Entry::Watched(_)));
        for entry in events.into_iter().chain(states.into_iter().next_back()) {
            write_one(log, watched, entry, &mut complained);
        }
    }
}

fn write_one(log: &EventLog, watched: &std::path::Path, entry: Entry, complained: &mut bool) {
    let written = match entry {
        Entry::Event(event) => {
            let hint = "gateway.events must be a folder that can be written, with space";
            log.append(&event).map_err(|error| format!("{}: {error}\nhint: {hint}", log.folder().display()))
        }
        Entry::Watched(state) => state.write(watched).map_err(|error| error.to_string()),
    };
    match written {
        Ok(()) => *complained = false,
        Err(error) if !std::mem::replace(complained, true) => {
            warn!("what happened cannot be written down: {error}");
        }
        Err(_) => (),
    }
}
