//! Recordings of the live signals: MCAP, each in a thread of its own, several at once.
//!
//! Beside `NAME.mcap` stands `NAME.json` with what is known of the recording. A gateway that is killed leaves a file
//! that reads up to its last second; it is listed as `torn`. One that the disk refuses ends by itself, `failed`,
//! with the cause; what was written stays readable.

mod counts;
mod info;
mod kept;
mod lost;
mod names;
mod set;
mod write;

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, OnceLock, Weak};
use std::thread::JoinHandle;
use std::time::SystemTime;

use axum::body::Bytes;
use kort_proto::events::{Event, EventKind};
use kort_proto::faults::Fault;
use kort_proto::messages::Telemetry;

use crate::events::Events;
use crate::problem::{Kind, Problem};
use crate::rig::RigDesk;
use crate::settings::RecordingLimits;
use crate::thruster::{Thruster, lock};
use crate::token::{Identity, Role};
pub use counts::Totals;
pub use info::{RecordingInfo, RecordingState};
pub use kept::{TAGS_MAX, check_tags};
use lost::known_of;
use names::is_word;
pub use names::{check_new_name, is_name};
pub use set::{RecordingSet, Together};
use write::{Item, Job};

/// Rows that may wait for the disk: two seconds at the fastest servo.
const QUEUE_ROWS: usize = 10_000;
/// Recordings that may run at once.
const AT_ONCE: usize = 40;
/// Ending of a recording's file.
pub const ENDING: &str = "mcap";

/// What a recording holds beside the samples: the thruster, and what is said of it to a stranger.
#[derive(Clone, Debug)]
pub struct Subject {
    /// The thruster: its state goes along.
    pub thruster: Arc<Thruster>,
    /// Its rig description: a file holds the one in force when it was begun.
    pub rig: Arc<RigDesk>,
}

/// Starts, stops, lists and deletes recordings.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    limits: RecordingLimits,
    running: Mutex<Vec<Running>>,
    /// Held by whoever starts, tags or deletes one, or goes on in another file: names do not change meanwhile.
    starting: Mutex<()>,
    /// What became of recordings, where the disk would not take it.
    unwritten: Mutex<BTreeMap<String, RecordingInfo>>,
    /// What ended with the gateway before and is not told yet.
    torn: Mutex<Vec<RecordingInfo>>,
    totals: Mutex<BTreeMap<String, Totals>>,
    events: OnceLock<Weak<Events>>,
}

#[derive(Debug)]
struct Running {
    /// The name it was started by; that of the file being written stands in `info`.
    name: String,
    thruster: String,
    items: SyncSender<Item>,
    info: Arc<Mutex<RecordingInfo>>,
    thread: JoinHandle<()>,
}

impl Running {
    /// Is it called so, as a whole or in the file being written?
    fn is(&self, name: &str) -> bool {
        self.name == name || lock(&self.info).name == name
    }
}

impl Recorder {
    /// Recordings in this folder; those a killed gateway left become `torn`.
    pub fn open(folder: &Path, limits: RecordingLimits) -> io::Result<Recorder> {
        fs::create_dir_all(folder)?;
        let recorder = Recorder {
            folder: folder.to_owned(),
            limits,
            running: Mutex::default(),
            starting: Mutex::default(),
            unwritten: Mutex::default(),
            torn: Mutex::default(),
            totals: Mutex::default(),
            events: OnceLock::new(),
        };
        for mut info in recorder.list() {
            if info.state == RecordingState::Recording {
                info.state = RecordingState::Torn;
                info.cause = Some("the gateway was killed while it ran".into());
                recorder.note_info(&info);
                lock(&recorder.torn).push(info);
            }
        }
        Ok(recorder)
    }

    /// Where it tells what became of recordings, of those first that ended with the gateway before.
    pub fn tell_to(&self, events: &Arc<Events>) {
        let _ = self.events.set(Arc::downgrade(events));
        for info in std::mem::take(&mut *lock(&self.torn)) {
            self.count(&info.thruster, |totals| totals.failed += 1);
            self.ended(&info);
        }
    }

    /// Starts a recording.
    pub fn start(
        self: &Arc<Self>,
        subject: Subject,
        who: &Identity,
        name: Option<String>,
        tags: Vec<String>,
        rate_hz: f64,
        together: Option<&Together>,
    ) -> Result<RecordingInfo, Problem> {
        let now = together.map_or_else(SystemTime::now, |set| set.began);
        self.reap();
        // The list itself is not held while the disk works: the bus hands out samples by it.
        let _one_at_a_time = lock(&self.starting);
        if lock(&self.running).len() >= AT_ONCE {
            return Err(Problem::new(Kind::RecordingActive, format!("{AT_ONCE} recordings are running"))
                .hint("DELETE /v1/recordings/{name} stops one"));
        }
        let thruster = subject.thruster.id.clone();
        let chosen = name.is_some();
        let name = name.unwrap_or_else(|| {
            let stamp = humantime::format_rfc3339_seconds(now).to_string().replace(['-', ':'], "");
            format!("{thruster}-{stamp}")
        });
        let another = || lock(&self.running).iter().any(|other| other.thruster == thruster);
        if self.is_taken(&name) || (!chosen && another()) {
            let hint = "choose another name; a second recording of a thruster needs a name of its own";
            return Err(Problem::new(
                Kind::RecordingActive,
                format!("there is a recording {name:?} already, or one of {thruster} is running"),
            )
            .hint(hint));
        }
        let info = RecordingInfo {
            name: name.clone(),
            thruster: thruster.clone(),
            set: together.map(|set| set.name.clone()),
            owner: who.name.clone(),
            tags,
            state: RecordingState::Recording,
            cause: None,
            started: humantime::format_rfc3339_millis(now).to_string(),
            rate_hz,
            rows: 0,
            duration_s: 0.0,
            lost_samples: 0,
            bytes: BTreeMap::new(),
        };
        let failed = |error: &io::Error| self.failed(&name, error);
        let shared = Arc::new(Mutex::new(info.clone()));
        // It may have been removed since the gateway started.
        let job = fs::create_dir_all(&self.folder)
            .and_then(|()| {
                let first_ns = together.map(|set| set.first_ns);
                Job::begin(&self.folder, subject, self.limits, Arc::clone(&shared), now, first_ns)
            })
            .map_err(|error| failed(&error))?;
        let (items, inbox) = sync_channel(QUEUE_ROWS);
        let theirs = Arc::clone(self);
        let thread = std::thread::Builder::new()
            .name("record".into())
            .spawn(move || job.run(&theirs, inbox))
            .map_err(|error| failed(&error))?;
        let running = Running { name: name.clone(), thruster, items, info: shared, thread };
        lock(&self.running).push(running);
        self.tell(
            EventKind::RecordingStarted,
            &info,
            &who.name,
            format!("{} started recording {name}", who.name),
        );
        Ok(info)
    }

    /// Stops a running recording: its owner's, or anybody's for an admin.
    pub fn stop(&self, name: &str, who: &Identity) -> Result<RecordingInfo, Problem> {
        self.reap();
        let running = {
            let mut all = lock(&self.running);
            let at = all.iter().position(|running| running.is(name)).ok_or_else(|| {
                Problem::new(Kind::NoRecording, format!("no recording {name:?} is running"))
                    .hint("POST /v1/recordings starts one")
            })?;
            let owner = lock(&all[at].info).owner.clone();
            may(who, &owner, name)?;
            all.swap_remove(at)
        };
        let info = self.settle(running);
        self.tell(
            EventKind::RecordingStopped,
            &info,
            &who.name,
            format!("{} stopped recording {}, {} rows", who.name, info.name, info.rows),
        );
        match &info.cause {
            Some(cause) if info.state == RecordingState::Failed => {
                Err(self.failed(&info.name, &io::Error::other(cause.clone())))
            }
            _ => Ok(self.sized(info)),
        }
    }

    /// Names of what runs of a set.
    fn names_running_of(&self, set: &str) -> Vec<String> {
        self.reap();
        let of = |running: &&Running| lock(&running.info).set.as_deref() == Some(set);
        lock(&self.running).iter().filter(of).map(|running| running.name.clone()).collect()
    }

    /// Names of what runs, each as it was started.
    pub fn names_running(&self) -> Vec<String> {
        self.reap();
        lock(&self.running).iter().map(|running| running.name.clone()).collect()
    }

    /// Does a recording of this name run?
    pub fn runs(&self, name: &str) -> bool {
        self.reap();
        lock(&self.running).iter().any(|running| running.is(name))
    }

    /// Is a recording of this name there, or a file of one?
    fn is_taken(&self, name: &str) -> bool {
        self.runs(name) || [ENDING, "json"].iter().any(|ending| self.file(name, ending).exists())
    }

    /// Stops everything: the gateway ends.
    pub fn stop_all(&self) {
        let running = std::mem::take(&mut *lock(&self.running));
        running.into_iter().for_each(|running| drop(self.settle(running)));
    }

    /// Takes a sample of the bus; never waits for the disk.
    pub fn offer(&self, thruster: &str, telemetry: &Telemetry, lost: u64) {
        for running in lock(&self.running).iter().filter(|running| running.thruster == thruster) {
            let lost = match running.items.try_send(Item::sample(telemetry)) {
                Ok(()) => lost,
                Err(TrySendError::Full(_)) => lost + 1,
                // It has ended, and loses nothing any more.
                Err(TrySendError::Disconnected(_)) => 0,
            };
            if lost > 0 {
                self.count_lost(&mut lock(&running.info), lost);
            }
        }
    }

    /// An event goes into every recording that it concerns.
    pub fn note(&self, event: &Event) {
        for running in lock(&self.running).iter() {
            if event.thruster.as_deref().is_none_or(|id| id == running.thruster) {
                let json = serde_json::to_vec(event).unwrap_or_default();
                let _ = running
                    .items
                    .try_send(Item::Event { at_ns: event.monotonic_ns, json: Bytes::from(json) });
            }
        }
    }

    /// Every recording, oldest first.
    pub fn list(&self) -> Vec<RecordingInfo> {
        self.reap();
        let mut known: BTreeMap<String, RecordingInfo> = fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .flatten()
            .filter_map(|entry| known_of(&entry.path()))
            .map(|info| (info.name.clone(), info))
            .collect();
        known.extend(lock(&self.unwritten).clone());
        for running in lock(&self.running).iter() {
            let info = lock(&running.info).clone();
            known.insert(info.name.clone(), info);
        }
        let mut infos: Vec<RecordingInfo> = known.into_values().map(|info| self.sized(info)).collect();
        infos.sort_by(|a, b| (&a.started, &a.name).cmp(&(&b.started, &b.name)));
        infos
    }

    /// Where a recording's file is, if there is one.
    pub fn find(&self, name: &str) -> Option<PathBuf> {
        (is_word(name) && self.file(name, "json").is_file())
            .then(|| self.file(name, ENDING))
            .filter(|file| file.is_file())
    }

    /// Takes those off the list that ended by themselves.
    fn reap(&self) {
        loop {
            let mut running = lock(&self.running);
            let Some(at) = running.iter().position(|running| running.thread.is_finished()) else { return };
            let ended = running.swap_remove(at);
            drop(running);
            self.settle(ended);
        }
    }

    /// Waits for a recording's end and counts it.
    fn settle(&self, running: Running) -> RecordingInfo {
        let Running { thruster, items, info, thread, .. } = running;
        drop(items); // the thread writes what still waits, and ends
        let panicked = thread.join().is_err();
        let mut info = lock(&info).clone();
        if panicked {
            info.state = RecordingState::Failed;
            info.cause = Some("its thread ended in a panic".into());
            self.note_info(&info);
        }
        if info.state == RecordingState::Failed {
            self.count(&thruster, |totals| totals.failed += 1);
        }
        info
    }

    /// Writes `NAME.json`; where the disk refuses, the list tells the truth from memory.
    fn note_info(&self, info: &RecordingInfo) {
        match kept::write_info(&self.folder, info) {
            Ok(()) => drop(lock(&self.unwritten).remove(&info.name)),
            Err(_) => drop(lock(&self.unwritten).insert(info.name.clone(), info.clone())),
        }
    }

    /// A recording ended by itself.
    fn ended(&self, info: &RecordingInfo) {
        let cause = info.cause.clone().unwrap_or_default();
        let words = format!("recording {} ended by itself: {cause}", info.name);
        tracing::error!("{words}");
        let event = Event::now(EventKind::RecordingEnded, Some(&info.thruster), "gateway", words);
        let failed = info.state == RecordingState::Failed;
        if let Some(events) = self.events.get().and_then(Weak::upgrade) {
            events.note(if failed { event.fault(Fault::RecordingFailed) } else { event });
        }
    }

    fn tell(&self, kind: EventKind, info: &RecordingInfo, who: &str, words: String) {
        if let Some(events) = self.events.get().and_then(Weak::upgrade) {
            events.tell(kind, Some(&info.thruster), who, words);
        }
    }

    fn file(&self, name: &str, extension: &str) -> PathBuf {
        self.folder.join(format!("{name}.{extension}"))
    }

    fn failed(&self, name: &str, error: &io::Error) -> Problem {
        Problem::new(
            Kind::RecordingFailed,
            format!("recording {name:?} in {}: {error}", self.folder.display()),
        )
        .hint("see that the folder of gateway.recordings can be written and has space")
    }
}

/// What one started is one's own; an admin may touch all.
fn may(who: &Identity, owner: &str, name: &str) -> Result<(), Problem> {
    if who.role == Role::Admin || who.name == owner {
        return Ok(());
    }
    Err(Problem::new(
        Kind::RoleTooLow,
        format!("recording {name:?} belongs to {owner:?}, not to {:?}", who.name),
    )
    .hint("its owner may, and whoever has a token of role admin"))
}
