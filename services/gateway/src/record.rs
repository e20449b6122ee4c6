//! Recordings of the live signals: each runs in a thread of its own and writes CSV and MCAP at once.
//!
//! Beside `NAME.csv` and `NAME.mcap` stands `NAME.json` with what is known of the recording. A gateway that
//! is killed leaves files that read up to the last flush; they are listed as `torn`.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::thread::JoinHandle;
use std::time::{Duration, Instant, SystemTime};

use kort_proto::messages::Telemetry;
use kort_proto::signals::{SIGNALS, Signals};
use kort_recording::{Format, Writer};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::problem::{Kind, Problem};
use crate::thruster::lock;

/// Rows that may wait for the disk: two seconds at the fastest servo.
const QUEUE_ROWS: usize = 10_000;
/// What a kill may cost.
const FLUSH_EVERY: Duration = Duration::from_millis(250);
/// Formats a recording is written in: the endings of its files.
pub const FORMATS: [&str; 2] = ["csv", "mcap"];

/// A recording, running or done.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RecordingInfo {
    /// Name; the files are `NAME.csv` and `NAME.mcap`.
    #[schema(example = "t1-20260101T120000Z")]
    pub name: String,
    /// The thruster.
    #[schema(example = "t1")]
    pub thruster: String,
    /// Is it running, complete, or torn?
    pub state: RecordingState,
    /// Wall time of the first row, RFC 3339.
    pub started: String,
    /// Largest rate of rows, Hz.
    pub rate_hz: f64,
    /// Rows written.
    pub rows: u64,
    /// From the first row to the last, s.
    pub duration_s: f64,
    /// Samples of the servo that are missing because the gateway or the disk came too late.
    pub lost_samples: u64,
    /// Size of each file, bytes.
    #[serde(default)]
    pub bytes: BTreeMap<String, u64>,
}

/// State of a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub enum RecordingState {
    /// Rows are being written.
    Recording,
    /// Stopped, whole.
    Complete,
    /// The gateway was killed while it ran, or the disk refused: readable up to the last flush.
    Torn,
}

/// Starts, stops and lists recordings; at most one runs.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
    active: Mutex<Option<Active>>,
    rows_before: AtomicU64,
    lost_before: AtomicU64,
}

#[derive(Debug)]
struct Active {
    samples: SyncSender<Sample>,
    info: Arc<Mutex<RecordingInfo>>,
    thread: JoinHandle<io::Result<()>>,
}

/// One telemetry sample on its way to the disk.
struct Sample {
    time_ns: u64,
    signals: Signals,
}

impl Recorder {
    /// Recordings in this folder; those a killed gateway left become `torn`.
    pub fn open(folder: &Path) -> io::Result<Recorder> {
        fs::create_dir_all(folder)?;
        let recorder = Recorder {
            folder: folder.to_owned(),
            active: Mutex::new(None),
            rows_before: AtomicU64::new(0),
            lost_before: AtomicU64::new(0),
        };
        for mut info in recorder.list() {
            if info.state == RecordingState::Recording {
                info.state = RecordingState::Torn;
                write_info(folder, &info)?;
            }
        }
        Ok(recorder)
    }

    /// Starts a recording.
    pub fn start(
        &self,
        thruster: &str,
        name: Option<String>,
        rate_hz: f64,
    ) -> Result<RecordingInfo, Problem> {
        let now = SystemTime::now();
        let mut active = lock(&self.active);
        if let Some(running) = active.as_ref().map(|active| lock(&active.info).name.clone()) {
            return Err(Problem::new(Kind::RecordingActive, format!("recording {running:?} is running"))
                .hint("DELETE /v1/recordings stops it"));
        }
        let name = name.unwrap_or_else(|| {
            let stamp = humantime::format_rfc3339_seconds(now).to_string().replace(['-', ':'], "");
            format!("{thruster}-{stamp}")
        });
        if self.file(&name, "json").exists() {
            return Err(Problem::new(
                Kind::RecordingActive,
                format!("there is a recording {name:?} already"),
            )
            .hint("choose another name, or leave it out"));
        }
        let info = RecordingInfo {
            name,
            thruster: thruster.to_owned(),
            state: RecordingState::Recording,
            started: humantime::format_rfc3339_millis(now).to_string(),
            rate_hz,
            rows: 0,
            duration_s: 0.0,
            lost_samples: 0,
            bytes: BTreeMap::new(),
        };
        let writer = Files::create(&self.folder, &info).map_err(|error| self.failed(&info.name, &error))?;
        let (samples, inbox) = sync_channel(QUEUE_ROWS);
        let shared = Arc::new(Mutex::new(info.clone()));
        let (folder, theirs) = (self.folder.clone(), Arc::clone(&shared));
        let thread = std::thread::Builder::new()
            .name("record".into())
            .spawn(move || {
                let ended = write_rows(&folder, writer, &theirs, &inbox);
                let mut info = lock(&theirs);
                info.state = if ended.is_ok() { RecordingState::Complete } else { RecordingState::Torn };
                let noted = write_info(&folder, &info);
                ended.and(noted)
            })
            .map_err(|error| self.failed(&info.name, &error))?;
        *active = Some(Active { samples, info: shared, thread });
        Ok(info)
    }

    /// Stops the running recording.
    pub fn stop(&self) -> Result<RecordingInfo, Problem> {
        let Some(Active { samples, info, thread }) = lock(&self.active).take() else {
            return Err(Problem::new(Kind::NoRecording, "no recording is running")
                .hint("POST /v1/recordings starts one"));
        };
        drop(samples); // the thread writes what still waits, and ends
        let ended = thread.join().unwrap_or_else(|_| Err(io::Error::other("its thread panicked")));
        let info = lock(&info).clone();
        self.rows_before.fetch_add(info.rows, Ordering::Relaxed);
        self.lost_before.fetch_add(info.lost_samples, Ordering::Relaxed);
        ended.map_err(|error| self.failed(&info.name, &error))?;
        Ok(self.sized(info))
    }

    /// Takes a sample of the bus; never waits for the disk.
    pub fn offer(&self, thruster: &str, telemetry: &Telemetry, lost: u64) {
        let active = lock(&self.active);
        let Some(active) = active.as_ref() else { return };
        let mut info = lock(&active.info);
        if info.thruster == thruster {
            let sample = Sample { time_ns: telemetry.time_ns, signals: telemetry.signals };
            let dropped = u64::from(active.samples.try_send(sample).is_err());
            info.lost_samples += lost + dropped;
        }
    }

    /// Every recording, oldest first.
    pub fn list(&self) -> Vec<RecordingInfo> {
        let running = self.running();
        let mut infos: Vec<RecordingInfo> = fs::read_dir(&self.folder)
            .into_iter()
            .flatten()
            .flatten()
            .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "json"))
            .filter_map(|entry| serde_json::from_slice(&fs::read(entry.path()).ok()?).ok())
            .map(|info: RecordingInfo| {
                running.clone().filter(|running| running.name == info.name).unwrap_or(info)
            })
            .map(|info| self.sized(info))
            .collect();
        infos.sort_by(|a, b| (&a.started, &a.name).cmp(&(&b.started, &b.name)));
        infos
    }

    /// Where a recording's file is, if there is one.
    pub fn find(&self, name: &str, format: &str) -> Option<PathBuf> {
        (is_name(name) && self.file(name, "json").is_file())
            .then(|| self.file(name, format))
            .filter(|file| file.is_file())
    }

    /// Is one running; rows written and samples lost since the gateway started.
    pub fn progress(&self) -> (bool, u64, u64) {
        let running = self.running();
        let (rows, lost) = running.as_ref().map_or((0, 0), |info| (info.rows, info.lost_samples));
        (
            running.is_some(),
            self.rows_before.load(Ordering::Relaxed) + rows,
            self.lost_before.load(Ordering::Relaxed) + lost,
        )
    }

    fn running(&self) -> Option<RecordingInfo> {
        lock(&self.active).as_ref().map(|active| lock(&active.info).clone())
    }

    fn sized(&self, mut info: RecordingInfo) -> RecordingInfo {
        info.bytes = FORMATS
            .iter()
            .filter_map(|format| {
                Some(((*format).to_owned(), fs::metadata(self.file(&info.name, format)).ok()?.len()))
            })
            .collect();
        info
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

/// Is this a name of a recording: 1 to 64 letters, digits, `.`, `_` or `-`, the first a letter or digit?
pub fn is_name(name: &str) -> bool {
    (1..=64).contains(&name.len())
        && name.starts_with(|c: char| c.is_ascii_alphanumeric())
        && name.bytes().all(|b| b.is_ascii_alphanumeric() || b"._-".contains(&b))
}

/// Writes rows until the recorder lets go of the other end.
fn write_rows(
    folder: &Path,
    mut files: Files,
    info: &Mutex<RecordingInfo>,
    inbox: &Receiver<Sample>,
) -> io::Result<()> {
    let period_ns = (1e9 / lock(info).rate_hz) as u64;
    let (mut first_ns, mut due_ns) = (None, 0);
    let mut row = Signals::UNKNOWN;
    let mut flushed = Instant::now();
    loop {
        match inbox.recv_timeout(FLUSH_EVERY) {
            Ok(sample) => {
                // A sensor slower than the servo shows a value now and then: none is lost between two rows.
                for signal in SIGNALS {
                    let value = (signal.get)(&sample.signals);
                    if !value.is_nan() {
                        (signal.set)(&mut row, value);
                    }
                }
                let first_ns = *first_ns.get_or_insert(sample.time_ns);
                // The servo's period need not divide ours: a row may come a little early, and none is made up
                // for ticks that were skipped.
                if sample.time_ns + period_ns / 20 >= due_ns {
                    due_ns = (due_ns + period_ns).max(sample.time_ns + period_ns / 2);
                    let time_s = sample.time_ns.saturating_sub(first_ns) as f64 * 1e-9;
                    files.write(time_s, &row)?;
                    row = Signals::UNKNOWN;
                    let mut info = lock(info);
                    info.rows += 1;
                    info.duration_s = time_s;
                }
            }
            Err(RecvTimeoutError::Timeout) => (),
            Err(RecvTimeoutError::Disconnected) => break,
        }
        if flushed.elapsed() >= FLUSH_EVERY {
            flushed = Instant::now();
            files.flush()?;
            let now = lock(info).clone();
            write_info(folder, &now)?;
        }
    }
    files.finish()
}

/// The files of one recording.
struct Files(Vec<Writer<BufWriter<File>>>);

impl Files {
    fn create(folder: &Path, info: &RecordingInfo) -> io::Result<Files> {
        let columns: Vec<&str> = SIGNALS.iter().map(|signal| signal.name).collect();
        let create = |ending: &&str| {
            let path = folder.join(format!("{}.{ending}", info.name));
            let format = Format::of(&path).map_err(io::Error::other)?;
            Writer::create(format, &info.thruster, &columns, BufWriter::new(File::create_new(path)?))
        };
        let files = FORMATS.iter().map(create).collect::<io::Result<_>>()?;
        write_info(folder, info)?;
        Ok(Files(files))
    }

    fn write(&mut self, time_s: f64, row: &Signals) -> io::Result<()> {
        let values: Vec<f64> = SIGNALS.iter().map(|signal| (signal.get)(row)).collect();
        self.0.iter_mut().try_for_each(|file| file.row(time_s, &values))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.0.iter_mut().try_for_each(Writer::flush)
    }

    fn finish(self) -> io::Result<()> {
        self.0.into_iter().try_for_each(Writer::finish)
    }
}

/// Writes `NAME.json` at once or not at all.
fn write_info(folder: &Path, info: &RecordingInfo) -> io::Result<()> {
    let (draft, file) =
        (folder.join(format!(".{}.draft", info.name)), folder.join(format!("{}.json", info.name)));
    fs::write(&draft, serde_json::to_vec_pretty(info)?)?;
    fs::rename(draft, file)
}
