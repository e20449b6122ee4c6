//! The event log: who armed, took over, commanded and switched, what tripped and what restarted. One JSON
//! object a line, appended by the gateway and the supervisor alike, and rotated.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, SystemTime};

use rustix::fs::{FlockOperation, flock};
use serde::{Deserialize, Serialize};

use crate::faults::Fault;
use crate::ours;

mod kind;
mod standing;
mod unwritten;

pub use kind::EventKind;
pub use standing::Standing;
use unwritten::Unwritten;

/// A file that grew beyond this is put aside, bytes.
const FILE_BYTES_MAX: u64 = 1 << 20;
/// Files that are kept, the present one among them.
const FILES: usize = 5;

/// A link that somebody laid where the log goes on would have us write elsewhere.
const NO_LINK: i32 = rustix::fs::OFlags::NOFOLLOW.bits().cast_signed();

/// Tries for the lock, 2 ms apart.
const LOCK_TRIES: u32 = 10;

/// One line of the log.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Event {
    /// Grows from event to event: wall time in microseconds, made unique.
    pub id: u64,
    /// Wall time, RFC 3339.
    pub time: String,
    /// CLOCK_MONOTONIC, ns: the time of recordings.
    pub monotonic_ns: u64,
    /// What happened.
    pub kind: EventKind,
    /// The thruster; none where it concerns all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thruster: Option<String>,
    /// Who did it: the token's name and the holder's, or the process.
    pub who: String,
    /// What exactly, in words.
    pub detail: String,
    /// Code of the fault, where it is about one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub fault: Option<u32>,
    /// When it came about, RFC 3339, where that was long before it was told.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub since: Option<String>,
    /// How often it happened since then, where it was repeated and is told once.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub times: Option<u64>,
    /// What the thruster did just before a stop that nobody asked for.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before: Option<Before>,
}

/// What a thruster did just before a stop.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Before {
    /// Thrust, N; null if not measured.
    pub thrust_n: Option<f64>,
    /// Shaft speed, rad/s; null if not measured.
    pub shaft_speed_rad_s: Option<f64>,
}

impl Before {
    /// From measured values, where NaN means "not measured".
    pub fn of(thrust_n: f64, shaft_speed_rad_s: f64) -> Self {
        let there = |value: f64| Some(value).filter(|v| v.is_finite());
        Self { thrust_n: there(thrust_n), shaft_speed_rad_s: there(shaft_speed_rad_s) }
    }
}

impl Event {
    /// An event of now.
    pub fn now(kind: EventKind, thruster: Option<&str>, who: &str, detail: impl Into<String>) -> Self {
        static LAST_ID: AtomicU64 = AtomicU64::new(0);
        let now = SystemTime::now();
        let micros = now.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_micros() as u64);
        let next = |last: u64| Some(micros.max(last + 1));
        let id = LAST_ID.fetch_update(Ordering::Relaxed, Ordering::Relaxed, next).unwrap_or_default();
        Self {
            id: micros.max(id + 1),
            time: humantime::format_rfc3339_micros(now).to_string(),
            monotonic_ns: monotonic_ns(),
            kind,
            thruster: thruster.map(str::to_owned),
            who: who.to_owned(),
            detail: detail.into(),
            fault: None,
            since: None,
            times: None,
            before: None,
        }
    }

    /// About this fault.
    pub fn fault(self, fault: Fault) -> Self {
        Self { fault: Some(fault.code()), ..self }
    }

    /// It came about at this time, RFC 3339, and is told only now.
    pub fn since(self, time: String) -> Self {
        Self { since: Some(time), ..self }
    }

    /// With what the thruster did before.
    pub fn before(self, before: Before) -> Self {
        Self { before: Some(before), ..self }
    }
}

fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    Duration::new(now.tv_sec as u64, now.tv_nsec as u32).as_nanos() as u64
}

/// The log on disk: `events.jsonl` in a folder, and `events.1.jsonl` … before it.
#[derive(Clone, Debug)]
pub struct EventLog {
    folder: PathBuf,
    unwritten: Arc<Mutex<Unwritten>>,
}

impl EventLog {
    /// The log in this folder, which is made if it is not there.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn open(folder: &Path) -> io::Result<Self> {
        ours::make_folder(folder)?;
        Ok(Self { folder: folder.to_owned(), unwritten: Arc::default() })
    }

    /// Where it lies.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Appends an event; whoever else appends does not get in between.
    ///
    /// # Errors
    /// The disk refuses; the event is kept then, and written at the next try that goes well.
    pub fn append(&self, event: &Event) -> io::Result<()> {
        let mut unwritten = self.unwritten.lock().unwrap_or_else(PoisonError::into_inner);
        unwritten.keep(line(event)?);
        self.write(&mut unwritten)
    }

    /// Tries again what the disk did not take.
    ///
    /// # Errors
    /// It does not take it now either.
    pub fn retry(&self) -> io::Result<()> {
        let mut unwritten = self.unwritten.lock().unwrap_or_else(PoisonError::into_inner);
        if unwritten.is_empty() { Ok(()) } else { self.write(&mut unwritten) }
    }

    fn write(&self, unwritten: &mut Unwritten) -> io::Result<()> {
        // Somebody may have removed it under way.
        ours::make_folder(&self.folder)?;
        let lock = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .mode(0o640)
            .custom_flags(NO_LINK)
            .open(self.folder.join(".lock"))?;
        // The lock keeps two from rotating at once. One who holds it may be stopped: nobody waits for ever, and a
        // line in one piece is appended whole in any case.
        for _ in 0..LOCK_TRIES {
            if flock(&lock, FlockOperation::NonBlockingLockExclusive).is_ok() {
                break;
            }
            std::thread::sleep(Duration::from_millis(2));
        }
        if fs::metadata(self.file(0)).is_ok_and(|about| about.len() > FILE_BYTES_MAX) {
            for n in (1..FILES).rev() {
                let _ = fs::rename(self.file(n - 1), self.file(n));
            }
        }
        let mut options = OpenOptions::new();
        options.create(true).append(true).read(true).mode(0o640).custom_flags(NO_LINK);
        let mut file: File = options.open(self.file(0))?;
        let torn = is_torn(&file)?;
        unwritten.write_to(&mut file, torn)?;
        if unwritten.lost > 0 {
            let words = format!("{} events could not be written down and are lost", unwritten.lost);
            unwritten.lost = 0;
            unwritten.keep(line(&Event::now(EventKind::EventsLost, None, "event log", words))?);
            unwritten.write_to(&mut file, false)?;
        }
        Ok(())
    }

    /// Every event that is kept, oldest first; lines that cannot be read are left out.
    pub fn read(&self) -> Vec<Event> {
        // The newest file first: one that is put aside meanwhile is met twice then, and never missed.
        let mut events: Vec<Event> = (0..FILES)
            .filter_map(|n| fs::read(self.file(n)).ok())
            .flat_map(|text| parse(&text).collect::<Vec<_>>())
            .collect();
        events.sort_by_key(|event| event.id);
        events.dedup();
        events
    }

    /// Where the log ends now.
    pub fn end(&self) -> Mark {
        use std::os::unix::fs::MetadataExt;
        fs::metadata(self.file(0))
            .map_or(Mark::default(), |about| Mark { inode: about.ino(), bytes: about.len() })
    }

    /// What was appended after a mark; everything that is kept if the files were rotated meanwhile.
    pub fn read_after(&self, mark: Mark) -> Vec<Event> {
        use std::io::{Read, Seek, SeekFrom};
        let end = self.end();
        if end.inode != mark.inode || end.bytes < mark.bytes {
            return self.read();
        }
        let mut text = Vec::new();
        let read = File::open(self.file(0)).and_then(|mut file| {
            file.seek(SeekFrom::Start(mark.bytes))?;
            file.read_to_end(&mut text)
        });
        match read {
            Ok(_) => parse(&text).collect(),
            Err(_) => Vec::new(),
        }
    }

    fn file(&self, age: usize) -> PathBuf {
        match age {
            0 => self.folder.join("events.jsonl"),
            n => self.folder.join(format!("events.{n}.jsonl")),
        }
    }
}

/// A place in the log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Mark {
    inode: u64,
    bytes: u64,
}

/// Does the file end within a line? A disk that was full took a part of one, whoever wrote it.
fn is_torn(file: &File) -> io::Result<bool> {
    use std::os::unix::fs::FileExt;
    let Some(last) = file.metadata()?.len().checked_sub(1) else { return Ok(false) };
    let mut byte = [0];
    Ok(file.read_at(&mut byte, last)? == 1 && byte != *b"\n")
}

fn line(event: &Event) -> io::Result<Vec<u8>> {
    let mut line = serde_json::to_vec(event)?;
    line.push(b'\n');
    Ok(line)
}

fn parse(text: &[u8]) -> impl Iterator<Item = Event> {
    text.split(|b| *b == b'\n').filter_map(|line| serde_json::from_slice(line).ok())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write;

    fn event(detail: &str) -> Event {
        Event::now(EventKind::Armed, Some("t1"), "bench", detail)
    }

    #[test]
    fn ids_grow_and_a_torn_line_costs_only_itself() {
        let folder = tempfile::tempdir().unwrap();
        let log = EventLog::open(folder.path()).unwrap();
        log.append(&event("first")).unwrap();
        fs::OpenOptions::new()
            .append(true)
            .open(log.file(0))
            .unwrap()
            .write_all(b"{\"id\": 1, \"ti\n")
            .unwrap();
        log.append(&event("second").before(Before::of(80.0, f64::NAN))).unwrap();
        let read = log.read();
        assert_eq!(read.iter().map(|e| e.detail.as_str()).collect::<Vec<_>>(), ["first", "second"]);
        assert!(read[0].id < read[1].id);
        let mark = log.end();
        log.append(&event("third")).unwrap();
        assert_eq!(log.read_after(mark).len(), 1);
        assert_eq!(log.read_after(Mark::default()).len(), 3);
        assert_eq!(read[1].before, Some(Before { thrust_n: Some(80.0), shaft_speed_rad_s: None }));
    }

    #[test]
    fn what_another_process_left_of_a_line_costs_none_of_ours() {
        let folder = tempfile::tempdir().unwrap();
        let log = EventLog::open(folder.path()).unwrap();
        log.append(&event("first")).unwrap();
        log.append(&event("second")).unwrap();
        let file = fs::OpenOptions::new().write(true).open(log.file(0)).unwrap();
        file.set_len(file.metadata().unwrap().len() - 7).unwrap();
        // Neither of these two wrote what is torn.
        log.append(&event("third")).unwrap();
        EventLog::open(folder.path()).unwrap().append(&event("fourth")).unwrap();
        let read = log.read();
        assert_eq!(read.iter().map(|e| e.detail.as_str()).collect::<Vec<_>>(), ["first", "third", "fourth"]);
    }

    #[test]
    fn a_link_in_the_place_of_the_log_is_not_written_through() {
        let folder = tempfile::tempdir().unwrap();
        let log = EventLog::open(&folder.path().join("events")).unwrap();
        let theirs = folder.path().join("theirs");
        fs::write(&theirs, "whole").unwrap();
        std::os::unix::fs::symlink(&theirs, log.file(0)).unwrap();
        assert!(log.append(&event("first")).is_err());
        assert_eq!(fs::read_to_string(&theirs).unwrap(), "whole");
        fs::remove_file(log.file(0)).unwrap();
        log.append(&event("second")).unwrap();
        let read = log.read();
        assert_eq!(read.iter().map(|e| e.detail.as_str()).collect::<Vec<_>>(), ["first", "second"]);
        log.retry().unwrap();
        assert_eq!(log.read().len(), 2, "nothing is written twice");
        // Somebody who tidies up under way takes what was written, and no more.
        fs::remove_dir_all(log.folder()).unwrap();
        log.append(&event("third")).unwrap();
        assert_eq!(log.read().len(), 1);
    }

    #[test]
    fn old_files_are_put_aside_and_at_last_dropped() {
        let folder = tempfile::tempdir().unwrap();
        let log = EventLog::open(folder.path()).unwrap();
        let long = "x".repeat(200_000);
        for _ in 0..60 {
            log.append(&event(&long)).unwrap();
        }
        let files =
            fs::read_dir(folder.path()).unwrap().flatten().filter(|e| e.file_name() != ".lock").count();
        assert_eq!(files, FILES);
        let kept = log.read().len();
        assert!((20..40).contains(&kept), "{kept}");
    }
}
