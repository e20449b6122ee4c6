//! The event log as the gateway keeps it: a thread of its own writes, and reads what the supervisor wrote too.

use std::collections::VecDeque;
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use kort_proto::events::{Event, EventKind, EventLog, Mark};
use kort_proto::faults::Fault;

use crate::record::Recorder;
use crate::thruster::lock;

/// Events kept at hand; the files hold more.
const AT_HAND: usize = 5000;
/// How often it is looked for what the supervisor wrote.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Events that may wait for the disk.
const QUEUE: usize = 4096;

/// The log.
#[derive(Debug)]
pub struct Events {
    outbox: SyncSender<Event>,
    waiting: AtomicU64,
    at_hand: Mutex<VecDeque<Event>>,
    recorder: Arc<Recorder>,
}

impl Events {
    /// Starts the log's thread; events go to running recordings too.
    pub fn start(folder: &Path, recorder: Arc<Recorder>) -> std::io::Result<Arc<Events>> {
        let log = EventLog::open(folder)?;
        let (outbox, inbox) = sync_channel(QUEUE);
        let waiting = AtomicU64::new(0);
        let events = Arc::new(Events { outbox, waiting, at_hand: Mutex::default(), recorder });
        // What is known comes first: faults that stand there need not be told again.
        let mark = log.end();
        events.learn(log.read());
        let theirs = Arc::clone(&events);
        std::thread::Builder::new().name("events".into()).spawn(move || keep(&log, mark, &inbox, &theirs))?;
        Ok(events)
    }

    /// Notes an event; never waits. It is known at once, whatever time the disk takes: a fault that is shown in the
    /// next moment has its time and what was before it.
    pub fn note(&self, event: Event) {
        tracing::info!(thruster = event.thruster, who = event.who, "{}", event.detail);
        self.learn(vec![event.clone()]);
        self.waiting.fetch_add(1, Ordering::Relaxed);
        if self.outbox.try_send(event).is_err() {
            self.waiting.fetch_sub(1, Ordering::Relaxed);
            tracing::warn!("the event log cannot keep up; an event is missing");
        }
    }

    /// Waits a moment for what was noted to be written: the process is about to end.
    pub fn settle(&self) {
        for _ in 0..50 {
            if self.waiting.load(Ordering::Relaxed) == 0 {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    /// An event of now.
    pub fn tell(&self, kind: EventKind, thruster: Option<&str>, who: &str, detail: impl Into<String>) {
        self.note(Event::now(kind, thruster, who, detail));
    }

    /// Events after this one, oldest first, at most `most` of the newest.
    pub fn since(&self, id: u64, most: usize) -> Vec<Event> {
        let at_hand = lock(&self.at_hand);
        let newer = at_hand.iter().filter(|event| event.id > id);
        let skip = newer.clone().count().saturating_sub(most);
        newer.skip(skip).cloned().collect()
    }

    /// How a fault of a thruster came that stands now; none if it was cleared since.
    pub fn latched(&self, thruster: &str, fault: Fault) -> Option<Event> {
        kort_proto::events::latched(lock(&self.at_hand).iter(), thruster, fault).cloned()
    }

    /// Takes over what is new, in the order of ids.
    fn learn(&self, events: Vec<Event>) {
        let mut at_hand = lock(&self.at_hand);
        for event in events {
            let place = at_hand.partition_point(|known| known.id < event.id);
            if at_hand.get(place).is_some_and(|known| known.id == event.id) {
                continue;
            }
            self.recorder.note(&event);
            at_hand.insert(place, event);
        }
        while at_hand.len() > AT_HAND {
            at_hand.pop_front();
        }
    }
}

/// Writes what comes and reads what others wrote, until the gateway ends.
fn keep(log: &EventLog, mut mark: Mark, inbox: &Receiver<Event>, events: &Events) {
    let mut complained = false;
    loop {
        let event = match inbox.recv_timeout(LOOK_EVERY) {
            Ok(event) => Some(event),
            Err(RecvTimeoutError::Timeout) => None,
            Err(RecvTimeoutError::Disconnected) => return,
        };
        if let Some(event) = event {
            match log.append(&event) {
                Ok(()) => complained = false,
                Err(error) if !std::mem::replace(&mut complained, true) => {
                    tracing::error!(
                        "the event log cannot be written: {error}\nhint: gateway.events needs space"
                    );
                }
                Err(_) => (),
            }
            events.waiting.fetch_sub(1, Ordering::Relaxed);
        }
        let end = log.end();
        if end != mark {
            events.learn(log.read_after(mark));
            mark = end;
        }
    }
}
