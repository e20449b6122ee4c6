//! The event log as the gateway keeps it: a thread of its own writes, and reads what the supervisor wrote too.

mod pace;

use std::collections::{BTreeMap, VecDeque};
use std::path::Path;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use kort_proto::events::{Event, EventKind, EventLog, Mark, Standing};
use kort_proto::faults::Fault;

use crate::record::Recorder;
use crate::thruster::lock;
use pace::Pace;

/// Events kept at hand; the files hold more.
const AT_HAND: usize = 5000;
/// How often it is looked for what the supervisor wrote.
const LOOK_EVERY: Duration = Duration::from_millis(200);
/// Events that may wait for the disk.
const QUEUE: usize = 4096;
/// Whoever waits for the disk to have taken an event waits so long at most: it may be full, or away. The supervisor gives the
/// gateway two seconds to end.
const WRITTEN_WITHIN: Duration = Duration::from_millis(500);

/// The log.
#[derive(Debug)]
pub struct Events {
    outbox: SyncSender<Event>,
    /// Events that were noted and are not on the disk.
    waiting: AtomicU64,
    known: Mutex<Known>,
    pace: Mutex<Pace>,
    /// The files, read by one at a time.
    files: Mutex<EventLog>,
    recorder: Arc<Recorder>,
}

/// What is known of the log without reading it.
#[derive(Debug, Default)]
struct Known {
    /// The newest, in the order of ids.
    newest: VecDeque<Event>,
    /// The id of the newest that had to go: what came later is all at hand.
    gone: u64,
    /// However long ago they came.
    standing: Standing,
}

impl Events {
    /// Starts the log's thread; events go to running recordings too.
    pub fn start(folder: &Path, recorder: Arc<Recorder>) -> std::io::Result<Arc<Events>> {
        let log = EventLog::open(folder)?;
        let (outbox, inbox) = sync_channel(QUEUE);
        let waiting = AtomicU64::new(0);
        let events = Arc::new(Events {
            outbox,
            waiting,
            known: Mutex::default(),
            pace: Mutex::default(),
            files: Mutex::new(log.clone()),
            recorder,
        });
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

    /// How many events were noted and are not on the disk.
    pub fn unwritten(&self) -> u64 {
        self.waiting.load(Ordering::Relaxed)
    }

    /// Waits until what was noted is on the disk, as far as the disk takes it: whoever is told that something was done finds it
    /// in the log, however the service ends.
    pub async fn written(&self) {
        let begun = Instant::now();
        while self.unwritten() > 0 && begun.elapsed() < WRITTEN_WITHIN {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    }

    /// Tells what is held back too and waits until all of it is on the disk: the process is about to end.
    pub async fn settle(&self) {
        self.tell_held(true);
        self.written().await;
    }

    /// An event of now. Repeats of what anybody may do are told together, with their count; what takes the lease is one man's
    /// doing, each time.
    pub fn tell(&self, kind: EventKind, thruster: Option<&str>, who: &str, detail: impl Into<String>) {
        use EventKind::{
            Armed, CalibrationEnded, CalibrationStarted, Commanded, ControllerChanged, ExcitationEnded,
            ExcitationStarted, FaultsCleared, RigChanged, RigRolledBack, RigWorse,
        };
        let event = Event::now(kind, thruster, who, detail);
        let now = match kind {
            Armed | CalibrationEnded | CalibrationStarted | Commanded | ControllerChanged
            | ExcitationEnded | ExcitationStarted | FaultsCleared | RigChanged | RigRolledBack | RigWorse => {
                Some(event)
            }
            _ => lock(&self.pace).take(event, Instant::now()),
        };
        if let Some(event) = now {
            self.note(event);
        }
    }

    /// Tells the repeats that were held back, those that are due or all.
    fn tell_held(&self, all: bool) {
        let due = lock(&self.pace).due(Instant::now(), all);
        due.into_iter().for_each(|event| self.note(event));
    }

    /// The newest events, at most so many, oldest first.
    pub fn newest(&self, most: usize) -> Vec<Event> {
        let newest = &lock(&self.known).newest;
        newest.iter().skip(newest.len().saturating_sub(most)).cloned().collect()
    }

    /// The first events after this one, at most so many, oldest first: who asks again from the last of them misses none that
    /// the log still holds. Reads the files where what is at hand does not go back so far.
    pub fn after(&self, id: u64, most: usize) -> Vec<Event> {
        let at_hand = || {
            let known = lock(&self.known);
            let newer = known.newest.iter().skip(known.newest.partition_point(|event| event.id <= id));
            (known.gone <= id, newer.take(most).cloned().collect::<Vec<_>>())
        };
        let (all, newer) = at_hand();
        if all {
            return newer;
        }
        let kept = lock(&self.files).read();
        let kept = kept.into_iter().filter(|event| event.id > id);
        // What was noted this moment may not be on the disk yet.
        let both: BTreeMap<u64, Event> =
            newer.into_iter().chain(kept).map(|event| (event.id, event)).collect();
        both.into_values().take(most).collect()
    }

    /// How a fault of a thruster came that stands now; none if it was cleared since.
    pub fn latched(&self, thruster: &str, fault: Fault) -> Option<Event> {
        lock(&self.known).standing.of(thruster, fault).cloned()
    }

    /// Takes over what is new, in the order of ids.
    fn learn(&self, events: Vec<Event>) {
        let Known { newest, gone, standing } = &mut *lock(&self.known);
        for event in events {
            standing.take(&event);
            let place = newest.partition_point(|known| known.id < event.id);
            // Older than all at hand: the files were rotated, and read anew.
            let old = place == 0 && newest.len() >= AT_HAND;
            if old || newest.get(place).is_some_and(|known| known.id == event.id) {
                continue;
            }
            self.recorder.note(&event);
            newest.insert(place, event);
            if newest.len() > AT_HAND {
                *gone = newest.pop_front().map_or(*gone, |event| event.id.max(*gone));
            }
        }
    }
}

/// Writes what comes and reads what others wrote, until the gateway ends.
fn keep(log: &EventLog, mut mark: Mark, inbox: &Receiver<Event>, events: &Events) {
    let (mut complained, mut unwritten) = (false, 0);
    loop {
        let written = match inbox.recv_timeout(LOOK_EVERY) {
            Ok(event) => {
                unwritten += 1;
                log.append(&event)
            }
            Err(RecvTimeoutError::Timeout) => log.retry(),
            Err(RecvTimeoutError::Disconnected) => return,
        };
        match written {
            Ok(()) => {
                complained = false;
                events.waiting.fetch_sub(std::mem::take(&mut unwritten), Ordering::Relaxed);
            }
            Err(error) if !std::mem::replace(&mut complained, true) => {
                tracing::error!(
                    "the event log in {} cannot be written: {error}\nhint: gateway.events must be a folder that can be written, with space",
                    log.folder().display()
                );
            }
            Err(_) => (),
        }
        events.tell_held(false);
        let end = log.end();
        if end != mark {
            events.learn(log.read_after(mark));
            mark = end;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::settings::RecordingLimits;

    #[test]
    fn a_fault_keeps_its_time_however_much_is_told_after_it() {
        let folder = tempfile::tempdir().unwrap();
        let recorder = Recorder::open(&folder.path().join("recordings"), RecordingLimits::default()).unwrap();
        let events = Events::start(&folder.path().join("events"), Arc::new(recorder)).unwrap();
        let tripped = Event::now(EventKind::Tripped, Some("t1"), "servo", "").fault(Fault::ServoLost);
        events.note(tripped.clone());
        for _ in 0..=AT_HAND {
            events.learn(vec![Event::now(EventKind::Commanded, Some("t1"), "bench", "")]);
        }
        assert!(events.newest(usize::MAX).iter().all(|event| event.id > tripped.id), "long past");
        assert_eq!(events.latched("t1", Fault::ServoLost), Some(tripped.clone()));
        events.learn(vec![tripped.clone()]);
        assert_eq!(events.newest(usize::MAX).len(), AT_HAND, "what is read anew is not told anew");
        events.tell(EventKind::FaultsCleared, Some("t1"), "bench", "");
        assert_eq!(events.latched("t1", Fault::ServoLost), None);
    }

    #[test]
    fn who_asks_on_from_the_last_it_knows_misses_none_that_is_on_the_disk() {
        let folder = tempfile::tempdir().unwrap();
        let recorder = Recorder::open(&folder.path().join("recordings"), RecordingLimits::default()).unwrap();
        let log = EventLog::open(&folder.path().join("events")).unwrap();
        let written: Vec<Event> = (0..AT_HAND + 200)
            .map(|n| Event::now(EventKind::LeaseTaken, Some("t1"), "bench", n.to_string()))
            .collect();
        let lines: Vec<String> = written.iter().map(|event| serde_json::to_string(event).unwrap()).collect();
        std::fs::write(folder.path().join("events/events.jsonl"), lines.join("\n") + "\n").unwrap();
        let events = Events::start(&folder.path().join("events"), Arc::new(recorder)).unwrap();
        assert_eq!(log.read().len(), written.len());
        assert_eq!(events.newest(2), written[written.len() - 2..]);
        let (mut last, mut told) = (0, Vec::new());
        loop {
            let next = events.after(last, 1000);
            let Some(newest) = next.last() else { break };
            last = newest.id;
            told.extend(next);
        }
        assert_eq!(told, written);
        assert_eq!(
            events.after(written[AT_HAND].id, 3),
            written[AT_HAND + 1..AT_HAND + 4],
            "from what is at hand"
        );
    }
}
