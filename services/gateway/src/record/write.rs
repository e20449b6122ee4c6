//! One recording's thread: rows, states and events to its file, and when it ends by itself.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use axum::body::Bytes;
use kort_proto::faults::Fault;
use kort_proto::messages::Telemetry;
use kort_proto::signals::{SIGNALS, Signals};
use kort_recording::LiveMcap;

use super::kept::write_info;
use super::{ENDING, Recorder, RecordingInfo, RecordingState, Subject};
use crate::settings::RecordingLimits;
use crate::thin::Thin;
use crate::thruster::lock;

/// What a kill may cost.
const FLUSH_EVERY: Duration = Duration::from_millis(500);
/// So much longer than its time a recording waits for the sample that ends it, s.
const SILENCE_S: f64 = 1.0;
/// States beside the rows: the signals are in the rows, here is what changes slowly.
const STATE_EVERY_S: f64 = 0.1;
/// The law's parameters beside the states.
const LAW_EVERY_S: f64 = 5.0;

/// What the tags are called in the file's metadata, between spaces; what comes later goes before.
const TAGS: &str = "tags";

/// Something on its way to the disk.
#[derive(Debug)]
pub enum Item {
    /// A sample of the servo.
    Sample(Box<(u64, Signals)>),
    /// An event.
    Event {
        /// CLOCK_MONOTONIC, ns.
        at_ns: u64,
        /// JSON.
        json: Bytes,
    },
}

impl Item {
    /// A sample of the servo.
    pub fn sample(telemetry: &Telemetry) -> Item {
        Item::Sample(Box::new((telemetry.time_ns, telemetry.signals)))
    }
}

type Mcap = LiveMcap<File>;

/// A recording under way.
pub struct Job {
    folder: PathBuf,
    subject: Subject,
    limits: RecordingLimits,
    info: Arc<Mutex<RecordingInfo>>,
    began: SystemTime,
    file: Mcap,
    /// The tags that the file has.
    tagged: Vec<String>,
    part: u32,
    /// The name it was started by, and the number that its file has behind it.
    base: String,
    number: u32,
    first_ns: Option<u64>,
    /// When the whole recording began, however many files it goes on in, and how long the files before this one are, s.
    since: Instant,
    past_s: f64,
    /// Rows and duration that were given to the file; the list tells what the disk has of them.
    given: (u64, f64),
    thin: Thin,
    state_s: f64,
    law_s: f64,
    /// The law and its parameters that were written last.
    law: Vec<u8>,
    /// The revision of the rig description that the file was told last, and how many it was told.
    revision: (String, u32),
}

/// Why a recording ends by itself.
enum End {
    /// A limit of its own: the file is whole.
    Limit(String),
    /// The disk refuses.
    Disk(io::Error),
}

impl From<io::Error> for End {
    fn from(error: io::Error) -> End {
        End::Disk(error)
    }
}

impl Job {
    /// Creates the file.
    pub fn begin(
        folder: &Path,
        subject: Subject,
        limits: RecordingLimits,
        info: Arc<Mutex<RecordingInfo>>,
        began: SystemTime,
        first_ns: Option<u64>,
    ) -> io::Result<Job> {
        let now = lock(&info).clone();
        guard_space(folder, &limits).map_err(|end| match end {
            End::Limit(words) => io::Error::other(words),
            End::Disk(error) => error,
        })?;
        let file = create(folder, &now, &subject, began)?;
        let revision = (subject.rig.in_force().2.revision, 1);
        Ok(Job {
            folder: folder.to_owned(),
            subject,
            limits,
            base: now.name.clone(),
            info,
            began,
            file,
            tagged: now.tags,
            part: 1,
            number: 1,
            first_ns,
            since: Instant::now(),
            past_s: 0.0,
            given: (0, 0.0),
            thin: Thin::new(now.rate_hz),
            state_s: f64::NEG_INFINITY,
            law_s: f64::NEG_INFINITY,
            law: Vec::new(),
            revision,
        })
    }

    /// Writes until the recorder lets go of the other end, a limit is reached or the disk refuses.
    pub fn run(mut self, recorder: &Recorder, inbox: Receiver<Item>) {
        let ended = self.write(recorder, &inbox);
        // What comes from here on is none of it.
        drop(inbox);
        let tags = lock(&self.info).tags.clone();
        let finished = finish(self.file, &self.tagged, tags);
        let info = {
            let mut info = lock(&self.info);
            if finished.is_ok() {
                recorder.count_rows(&mut info, self.given.0, self.given.1);
            }
            (info.state, info.cause) = match (ended, finished) {
                (Ok(()), Ok(())) => (RecordingState::Complete, None),
                (Err(End::Limit(why)), Ok(())) => (RecordingState::Complete, Some(why)),
                (Err(End::Disk(error)), _) | (_, Err(error)) => {
                    let lost = self.given.0.saturating_sub(info.rows);
                    recorder.count_lost(&mut info, lost);
                    let file = self.folder.join(format!("{}.{ENDING}", info.name));
                    (RecordingState::Failed, Some(format!("{}: {error}", file.display())))
                }
            };
            info.clone()
        };
        recorder.note_info(&info);
        if info.cause.is_some() {
            recorder.ended(&info);
        }
        if info.state == RecordingState::Failed {
            self.subject.thruster.show_fault(Fault::RecordingFailed);
        }
    }

    fn write(&mut self, recorder: &Recorder, inbox: &Receiver<Item>) -> Result<(), End> {
        let mut flushed = Instant::now();
        loop {
            match inbox.recv_timeout(FLUSH_EVERY) {
                Ok(Item::Sample(sample)) => self.sample(sample.0, &sample.1)?,
                Ok(Item::Event { at_ns, json }) => self.event(at_ns, &json)?,
                Err(RecvTimeoutError::Timeout) => (),
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
            }
            if flushed.elapsed() >= FLUSH_EVERY {
                flushed = Instant::now();
                self.note_revision()?;
                self.file.flush()?;
                // Not under the lock: a slow disk must not hold up the bus, which counts losses in it.
                let info = {
                    let mut info = lock(&self.info);
                    recorder.count_rows(&mut info, self.given.0, self.given.1);
                    info.clone()
                };
                recorder.note_info(&info);
                guard_space(&self.folder, &self.limits)?;
                // A servo that says nothing more gives no sample that would end it.
                if self.since.elapsed().as_secs_f64() > self.limits.time_max_s + SILENCE_S {
                    return Err(self.time_is_over());
                }
                self.rotate(recorder)?;
            }
        }
    }

    fn sample(&mut self, time_ns: u64, signals: &Signals) -> Result<(), End> {
        let first_ns = *self.first_ns.get_or_insert(time_ns);
        // Of a set that begins later than this sample.
        if time_ns < first_ns {
            return Ok(());
        }
        let Some(row) = self.thin.take(time_ns, signals) else { return Ok(()) };
        let time_s = time_ns.saturating_sub(first_ns) as f64 * 1e-9;
        let values: Vec<f64> = SIGNALS.iter().map(|signal| (signal.get)(&row)).collect();
        self.file.row(time_s, &values)?;
        self.beside(time_s)?;
        self.given = (self.given.0 + 1, time_s);
        if self.past_s + time_s > self.limits.time_max_s {
            return Err(self.time_is_over());
        }
        Ok(())
    }

    fn time_is_over(&self) -> End {
        End::Limit(format!("gateway.recording.time_max_s = {} is reached", self.limits.time_max_s))
    }

    /// Setpoint, estimates with their doubt, law, limits, faults: what the state shows.
    fn beside(&mut self, time_s: f64) -> io::Result<()> {
        if time_s - self.state_s >= STATE_EVERY_S {
            self.state_s = time_s;
            self.file.state(time_s, &self.subject.thruster.state_json())?;
            self.law(time_s)?;
        }
        Ok(())
    }

    /// The law and its parameters, now and again and whenever they change.
    fn law(&mut self, time_s: f64) -> io::Result<()> {
        let Ok(law) = self.subject.thruster.controller() else { return Ok(()) };
        let law = serde_json::to_vec(&law).unwrap_or_default();
        if time_s - self.law_s >= LAW_EVERY_S || law != self.law {
            self.law_s = time_s;
            self.file.state(time_s, &law)?;
            self.law = law;
        }
        Ok(())
    }

    /// A rig description that comes while the file grows is told to it, with the time from which it is in force.
    fn note_revision(&mut self) -> io::Result<()> {
        let (rig_file, rig, revision) = self.subject.rig.in_force();
        let (told, count) = &mut self.revision;
        if *told == revision.revision {
            return Ok(());
        }
        told.clone_from(&revision.revision);
        *count += 1;
        let told = [
            ("rig", rig.to_string()),
            ("rig_file", rig_file),
            ("rig_revision", revision.revision),
            ("rig_number", revision.number.to_string()),
            ("rig_since_s", format!("{:.3}", self.given.1)),
        ];
        self.file.about(told.map(|(name, value)| (format!("{name}.{count}"), value)).into_iter().collect())
    }

    fn event(&mut self, at_ns: u64, json: &[u8]) -> io::Result<()> {
        let time_s = self.first_ns.map_or(0.0, |first| at_ns.saturating_sub(first) as f64 * 1e-9);
        self.file.event(time_s, json)
    }

    /// A file that grew too large is followed by another.
    fn rotate(&mut self, recorder: &Recorder) -> Result<(), End> {
        let path = self.folder.join(format!("{}.{ENDING}", lock(&self.info).name));
        if std::fs::metadata(&path)?.len() < self.limits.file_bytes_max {
            return Ok(());
        }
        if self.part >= self.limits.files_max {
            let most = self.limits.files_max;
            return Err(End::Limit(format!("gateway.recording.files_max = {most} is reached")));
        }
        // Neither tags nor the start of another come in between.
        let _one_at_a_time = lock(&recorder.starting);
        let now = lock(&self.info).clone();
        self.part += 1;
        self.began = SystemTime::now();
        // Somebody may have called another recording so.
        let free = (self.number + 1..).find(|number| !recorder.is_taken(&format!("{}-{number}", self.base)));
        self.number = free.ok_or_else(|| io::Error::other("no number is free"))?;
        let next = RecordingInfo {
            name: format!("{}-{}", self.base, self.number),
            started: humantime::format_rfc3339_millis(self.began).to_string(),
            rows: 0,
            duration_s: 0.0,
            lost_samples: 0,
            ..now.clone()
        };
        let file = create(&self.folder, &next, &self.subject, self.began)?;
        let tagged = std::mem::replace(&mut self.tagged, next.tags.clone());
        finish(std::mem::replace(&mut self.file, file), &tagged, now.tags)?;
        // Samples that were lost meanwhile are those of the file that ends.
        let mut ended = std::mem::replace(&mut *lock(&self.info), next);
        ended.state = RecordingState::Complete;
        recorder.count_rows(&mut ended, self.given.0, self.given.1);
        recorder.note_info(&ended);
        self.past_s += self.given.1;
        (self.first_ns, self.given) = (None, (0, 0.0));
        (self.state_s, self.law_s) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        self.revision = (self.subject.rig.in_force().2.revision, 1);
        Ok(())
    }
}

/// Ends a file; with its tags where they came while it was written.
fn finish(mut file: Mcap, tagged: &[String], tags: Vec<String>) -> io::Result<()> {
    if tagged != tags {
        file.about(BTreeMap::from([(TAGS.to_owned(), tags.join(" "))]))?;
    }
    file.finish()
}

fn create(folder: &Path, info: &RecordingInfo, subject: &Subject, began: SystemTime) -> io::Result<Mcap> {
    let columns: Vec<&str> = SIGNALS.iter().map(|signal| signal.name).collect();
    let origin_ns = began.duration_since(SystemTime::UNIX_EPOCH).map_or(0, |d| d.as_nanos() as u64);
    let (rig_file, rig, revision) = subject.rig.in_force();
    let about = BTreeMap::from(
        [
            ("kort_version", env!("CARGO_PKG_VERSION")),
            ("messages_version", &kort_proto::names::MESSAGES_VERSION.to_string()),
            ("thruster", &info.thruster),
            ("recording", &info.name),
            ("owner", &info.owner),
            ("started", &info.started),
            (TAGS, &info.tags.join(" ")),
            ("rate_hz", &info.rate_hz.to_string()),
            ("rig", &rig),
            ("rig_file", &rig_file),
            ("rig_revision", &revision.revision),
            ("rig_number", &revision.number.to_string()),
        ]
        .map(|(name, value)| (name.to_owned(), value.to_owned())),
    );
    let path = folder.join(format!("{}.{ENDING}", info.name));
    let begin = |file| {
        let mut file = Mcap::live(&info.thruster, &columns, about, origin_ns, file)?;
        file.flush()?;
        write_info(folder, info)?;
        Ok(file)
    };
    // What does not begin leaves nothing: the list would not tell of it, and its name would be taken.
    begin(File::create_new(&path)?).inspect_err(|_: &io::Error| drop(std::fs::remove_file(&path)))
}

/// A recording leaves some space to others.
fn guard_space(folder: &Path, limits: &RecordingLimits) -> Result<(), End> {
    let Ok(disk) = rustix::fs::statvfs(folder) else { return Ok(()) };
    let free = disk.f_bavail.saturating_mul(disk.f_frsize);
    if free < limits.free_bytes_min {
        return Err(End::Disk(io::Error::new(
            io::ErrorKind::StorageFull,
            format!(
                "no space: {free} bytes are free, gateway.recording.free_bytes_min = {}",
                limits.free_bytes_min
            ),
        )));
    }
    Ok(())
}
