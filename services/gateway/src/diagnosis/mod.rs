//! Diagnoses of a thruster: `kort diagnose` as a process of its own behind everything else on the machine, one at a
//! time, on a recording or on the last minutes, against the rig description in force.
//!
//! Each has a folder: `info.json`, the rig it was compared with, the report as JSON and as a page, the rig with what was
//! found, and the rows of the last minutes where there was no recording.

mod job;
mod sequel;
mod view;

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::{Arc, Mutex};
use std::time::SystemTime;

use kort_proto::events::EventKind;
use serde_json::Value;

use crate::events::Events;
use crate::problem::{Kind, Problem};
use crate::record::is_name;
use crate::rig::{RigDesk, write_whole};
use crate::ring::Row;
use crate::settings::DiagnosisLimits;
use crate::thruster::{Thruster, lock};
use crate::token::{Identity, Role};

pub use view::{DiagnosisInfo, DiagnosisState, FindingView};

/// The rows of the last minutes, in a diagnosis's folder.
const LAST_MINUTES: &str = "recording.mcap";

/// What is diagnosed.
#[derive(Debug)]
pub enum Subject {
    /// A recording: its name and file.
    Recording(String, PathBuf),
    /// Rows of the last so many seconds.
    Last(f64, Vec<Row>),
}

/// How it is diagnosed.
#[derive(Clone, Debug)]
pub struct Options {
    /// Baseline model.
    pub model: String,
    /// Effects taken as present.
    pub with: Vec<String>,
    /// Seed; `kort diagnose`'s own if left out.
    pub seed: Option<u64>,
}

/// Starts, lists, cancels and deletes diagnoses.
#[derive(Debug)]
pub struct Diagnoses {
    folder: PathBuf,
    recordings: PathBuf,
    limits: DiagnosisLimits,
    program: PathBuf,
    events: Arc<Events>,
    running: Mutex<Option<Running>>,
}

/// The one that runs.
#[derive(Debug)]
struct Running {
    info: DiagnosisInfo,
    thruster: Arc<Thruster>,
    child: Option<Arc<Mutex<Child>>>,
    cancelled: bool,
    began: std::time::Instant,
}

impl Running {
    fn shown(&self) -> DiagnosisInfo {
        DiagnosisInfo { elapsed_s: self.began.elapsed().as_secs_f64(), ..self.info.clone() }
    }
}

impl Diagnoses {
    /// Diagnoses in this folder; those whose gateway ended while they ran have failed.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn open(
        folder: &Path,
        recordings: &Path,
        limits: DiagnosisLimits,
        events: Arc<Events>,
    ) -> io::Result<Diagnoses> {
        fs::create_dir_all(folder)?;
        let diagnoses = Diagnoses {
            folder: folder.to_owned(),
            recordings: recordings.to_owned(),
            limits,
            program: std::env::current_exe()?,
            events,
            running: Mutex::default(),
        };
        for info in diagnoses.past() {
            if info.state == DiagnosisState::Running {
                let cause = Some("the gateway ended while it ran".into());
                let _ = diagnoses.write(&DiagnosisInfo {
                    state: DiagnosisState::Failed,
                    step: None,
                    cause,
                    ..info
                });
            }
        }
        Ok(diagnoses)
    }

    /// Starts one.
    pub fn start(
        self: &Arc<Self>,
        thruster: &Arc<Thruster>,
        rig: &RigDesk,
        who: &Identity,
        subject: Subject,
        after: Option<&str>,
        options: Options,
    ) -> Result<DiagnosisInfo, Problem> {
        let before = match after {
            Some(id) => self.recordings_of(&self.find(&thruster.id, id)?, sequel::FILES_MAX)?,
            None => Vec::new(),
        };
        let mut running = lock(&self.running);
        if let Some(other) = &*running {
            return Err(Problem::new(
                Kind::DiagnosisActive,
                format!("{} is being diagnosed ({})", other.info.thruster, other.info.id),
            )
            .hint("wait for it, or DELETE …/diagnoses/{diagnosis} cancels it: there is one at a time"));
        }
        let (_, rig_text, entry) = rig.in_force();
        let now = SystemTime::now();
        let stamp = humantime::format_rfc3339_seconds(now).to_string().replace(['-', ':'], "");
        let mut id = format!("{}-{stamp}", thruster.id);
        for again in 2.. {
            if !self.folder.join(&id).exists() {
                break;
            }
            id = format!("{}-{stamp}-{again}", thruster.id);
        }
        let info = DiagnosisInfo {
            id,
            thruster: thruster.id.clone(),
            owner: who.name.clone(),
            state: DiagnosisState::Running,
            of: match &subject {
                Subject::Recording(name, _) => format!("recording {name}"),
                Subject::Last(time_s, _) => format!("the last {time_s:.0} s"),
            },
            recording: match &subject {
                Subject::Recording(name, _) => Some(name.clone()),
                Subject::Last(..) => None,
            },
            after: after.map(str::to_owned),
            rig_number: entry.number,
            rig_revision: entry.revision,
            started: humantime::format_rfc3339_millis(now).to_string(),
            step: None,
            elapsed_s: 0.0,
            cause: None,
            lossy: false,
            verdict: None,
            summary: None,
            findings: Vec::new(),
            usable: false,
        };
        self.make_room();
        let not_kept = |error: io::Error| self.not_kept(&error);
        fs::create_dir_all(self.folder.join(&info.id)).map_err(not_kept)?;
        self.write(&info).map_err(not_kept)?;
        let began = std::time::Instant::now();
        *running = Some(Running {
            info: info.clone(),
            thruster: Arc::clone(thruster),
            child: None,
            cancelled: false,
            began,
        });
        drop(running);
        thruster.set_diagnosis(Some((info.id.clone(), "starting".into(), began)));
        let job = job::Job { folder: self.folder.join(&info.id), before, subject, options, rig: rig_text };
        let theirs = Arc::clone(self);
        let spawned = std::thread::Builder::new().name("diagnosis".into()).spawn(move || job.run(&theirs));
        if let Err(error) = spawned {
            self.end(DiagnosisState::Failed, Some(error.to_string()), |_| ());
            return Err(self.not_kept(&error));
        }
        let words = format!("{} began to diagnose {}: {}", who.name, info.of, info.id);
        self.events.tell(EventKind::DiagnosisStarted, Some(&info.thruster), &who.name, words);
        Ok(info)
    }

    /// Diagnoses of a thruster, oldest first.
    pub fn list(&self, thruster: &str) -> Vec<DiagnosisInfo> {
        let running = lock(&self.running).as_ref().map(Running::shown);
        let mut known = self.past();
        if let Some(running) = running {
            known.retain(|info| info.id != running.id);
            known.push(running);
        }
        known.retain(|info| info.thruster == thruster);
        known.sort_by(|a, b| (&a.started, &a.id).cmp(&(&b.started, &b.id)));
        known
    }

    /// One diagnosis.
    pub fn find(&self, thruster: &str, id: &str) -> Result<DiagnosisInfo, Problem> {
        let running = lock(&self.running).as_ref().map(Running::shown).filter(|info| info.id == id);
        let known = running.or_else(|| if is_name(id) { self.read(id) } else { None });
        known.filter(|info| info.thruster == thruster).ok_or_else(|| {
            Problem::new(Kind::UnknownDiagnosis, format!("there is no diagnosis {id:?} of {thruster}"))
                .hint("GET …/diagnoses lists them")
        })
    }

    /// Its report, the document of `kort diagnose --json`; null until it is done.
    pub fn report(&self, info: &DiagnosisInfo) -> Value {
        let text = self.text(info, "report.json");
        text.and_then(|text| serde_json::from_str(&text).ok()).unwrap_or(Value::Null)
    }

    /// Its report as a page.
    pub fn page(&self, info: &DiagnosisInfo) -> Result<String, Problem> {
        self.text(info, "report.html").ok_or_else(|| self.not_done(info))
    }

    /// The rig description with what was found, for whoever has the revision in force that it was compared with.
    pub fn found(&self, info: &DiagnosisInfo, in_force: &str) -> Result<String, Problem> {
        let text = self.text(info, "found.toml").ok_or_else(|| self.not_done(info))?;
        if !info.usable {
            return Err(Problem::new(
                Kind::Refused,
                format!(
                    "diagnosis {} found nothing that is probable enough for the rig to take over",
                    info.id
                ),
            )
            .hint(
                "names of probability 0.7 and more without a rival count; its report says what is missing",
            ));
        }
        if info.rig_revision != in_force {
            return Err(Problem::new(
                Kind::Refused,
                format!(
                    "diagnosis {} was compared with revision {} of the rig, and another is in force now",
                    info.id, info.rig_number
                ),
            )
            .hint(
                "diagnose again: what it found may stand in the rig by now, or not belong to it any more",
            ));
        }
        Ok(text)
    }

    /// Cancels one that runs; deletes one that is past. Its owner may, or an admin.
    pub fn remove(&self, thruster: &str, id: &str, who: &Identity) -> Result<Option<DiagnosisInfo>, Problem> {
        let info = self.find(thruster, id)?;
        if who.role != Role::Admin && who.name != info.owner {
            return Err(Problem::new(
                Kind::RoleTooLow,
                format!("diagnosis {id:?} belongs to {:?}, not to {:?}", info.owner, who.name),
            )
            .hint("its owner may, and whoever has a token of role admin"));
        }
        if let Some(running) = lock(&self.running).as_mut().filter(|running| running.info.id == id) {
            running.cancelled = true;
            if let Some(child) = &running.child {
                let _ = lock(child).kill();
            }
            return Ok(Some(DiagnosisInfo { state: DiagnosisState::Cancelled, ..running.shown() }));
        }
        fs::remove_dir_all(self.folder.join(id)).map_err(|error| self.not_kept(&error))?;
        let words = format!("{} deleted diagnosis {id}", who.name);
        self.events.tell(EventKind::DiagnosisDeleted, Some(thruster), &who.name, words);
        Ok(None)
    }

    /// Ends what runs: the gateway ends.
    pub fn stop(&self) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.cancelled = true;
            if let Some(child) = &running.child {
                let _ = lock(child).kill();
            }
        }
    }

    /// The process of the one that runs, unless it was cancelled before.
    fn hold(&self, child: Child) -> Arc<Mutex<Child>> {
        let child = Arc::new(Mutex::new(child));
        if let Some(running) = lock(&self.running).as_mut() {
            if running.cancelled {
                let _ = lock(&child).kill();
            }
            running.child = Some(Arc::clone(&child));
        }
        child
    }

    /// The one that runs has come so far.
    fn step(&self, words: &str) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.info.step = Some(words.to_owned());
            let (id, began) = (running.info.id.clone(), running.began);
            running.thruster.set_diagnosis(Some((id, words.to_owned(), began)));
        }
    }

    /// The one that runs is over.
    fn end(&self, state: DiagnosisState, cause: Option<String>, result: impl FnOnce(&mut DiagnosisInfo)) {
        let Some(running) = lock(&self.running).take() else { return };
        let state = if running.cancelled { DiagnosisState::Cancelled } else { state };
        let cause = cause.filter(|_| state == DiagnosisState::Failed);
        let mut info = DiagnosisInfo { state, step: None, cause, ..running.shown() };
        result(&mut info);
        if let Err(error) = self.write(&info) {
            tracing::error!("diagnosis {}: {error}", info.id);
        }
        running.thruster.set_diagnosis(None);
        let (kind, words) = match state {
            DiagnosisState::Done => (EventKind::DiagnosisDone, info.done_words()),
            DiagnosisState::Cancelled => {
                (EventKind::DiagnosisCancelled, format!("diagnosis {} was cancelled", info.id))
            }
            _ => {
                let cause = info.cause.as_deref().unwrap_or("for no known reason");
                (EventKind::DiagnosisFailed, format!("diagnosis {} failed: {cause}", info.id))
            }
        };
        self.events.tell(kind, Some(&info.thruster), &info.owner, words);
    }

    /// Deletes the oldest where there are too many.
    fn make_room(&self) {
        let mut past = self.past();
        past.sort_by(|a, b| (&a.started, &a.id).cmp(&(&b.started, &b.id)));
        let over = (past.len() + 1).saturating_sub(self.limits.kept_max);
        for info in past.into_iter().take(over) {
            let _ = fs::remove_dir_all(self.folder.join(info.id));
        }
    }

    fn past(&self) -> Vec<DiagnosisInfo> {
        let folders = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        folders.filter_map(|entry| self.read(entry.file_name().to_str()?)).collect()
    }

    fn read(&self, id: &str) -> Option<DiagnosisInfo> {
        serde_json::from_slice(&fs::read(self.folder.join(id).join("info.json")).ok()?).ok()
    }

    fn write(&self, info: &DiagnosisInfo) -> io::Result<()> {
        write_whole(&self.folder.join(&info.id), "info.json", &serde_json::to_vec_pretty(info)?)
    }

    /// A file of a diagnosis that is done.
    fn text(&self, info: &DiagnosisInfo, name: &str) -> Option<String> {
        let done = info.state == DiagnosisState::Done;
        done.then(|| fs::read_to_string(self.folder.join(&info.id).join(name)).ok()).flatten()
    }

    fn not_done(&self, info: &DiagnosisInfo) -> Problem {
        let words = match info.state {
            DiagnosisState::Running => "still runs",
            DiagnosisState::Cancelled => "was cancelled",
            DiagnosisState::Failed => "failed",
            DiagnosisState::Done => "has lost its files",
        };
        Problem::new(Kind::Refused, format!("diagnosis {} {words}: it has no report", info.id))
            .hint("GET …/diagnoses/{diagnosis} says how far it is, and why it failed")
    }

    fn not_kept(&self, error: &io::Error) -> Problem {
        Problem::new(Kind::StorageFailed, format!("{}: {error}", self.folder.display()))
            .hint("see that the folder of gateway.diagnoses can be written and has space")
    }
}
