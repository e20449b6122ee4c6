//! Analyses of a thruster: `kort diagnose` or `kort fit` as a process of its own behind everything else on the machine,
//! one at a time of both together, on a recording or on the last minutes, against the rig description in force.
//!
//! What differs from kind to kind stands in [`kind`], and what each shows of its report in a file of its own. Where they
//! are kept: [`kept`].

mod diagnosis;
mod fit;
mod job;
mod kept;
mod kind;
mod sequel;
mod view;

use std::io;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::sync::{Arc, Mutex};
use std::time::{Instant, SystemTime};

use crate::events::Events;
use crate::problem::{Kind, Problem};
use crate::rig::RigDesk;
use crate::ring::Row;
use crate::settings::DiagnosisLimits;
use crate::thruster::{Thruster, lock};
use crate::token::{Identity, Role};

pub use diagnosis::DiagnosisInfo;
pub use fit::FitInfo;
pub use kind::{Analysis, AnalysisKind};
pub use view::{JobInfo, JobState, JobStep, Underway};

/// What is analysed.
#[derive(Debug)]
pub enum Subject {
    /// A recording: its name and file.
    Recording(String, PathBuf),
    /// Rows of the last so many seconds.
    Last(f64, Vec<Row>),
}

/// How it is analysed.
#[derive(Clone, Debug)]
pub struct Options {
    /// Baseline model.
    pub model: String,
    /// Effects taken as present.
    pub with: Vec<String>,
    /// Seed; the command's own if left out.
    pub seed: Option<u64>,
}

/// Starts, lists, cancels and deletes analyses.
#[derive(Debug)]
pub struct Analyses {
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
    kind: AnalysisKind,
    info: JobInfo,
    thruster: Arc<Thruster>,
    child: Option<Arc<Mutex<Child>>>,
    cancelled: bool,
    began: Instant,
}

impl Running {
    fn shown(&self) -> JobInfo {
        JobInfo { elapsed_s: self.began.elapsed().as_secs_f64(), ..self.info.clone() }
    }

    /// Has it this name? One of the other kind may have the same.
    fn is(&self, kind: AnalysisKind, id: &str) -> bool {
        self.kind == kind && self.info.id == id
    }

    fn tell(&self, step: &str) {
        let (kind, id, began) = (self.kind, self.info.id.clone(), self.began);
        self.thruster.set_analysis(Some(Underway { kind, id, step: step.to_owned(), began }));
    }

    fn end(&mut self) {
        self.cancelled = true;
        if let Some(child) = &self.child {
            let _ = lock(child).kill();
        }
    }
}

impl Analyses {
    /// Analyses in this folder; those whose gateway ended while they ran have failed.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn open(
        folder: &Path,
        recordings: &Path,
        limits: DiagnosisLimits,
        events: Arc<Events>,
    ) -> io::Result<Analyses> {
        let analyses = Analyses {
            folder: folder.to_owned(),
            recordings: recordings.to_owned(),
            limits,
            program: std::env::current_exe()?,
            events,
            running: Mutex::default(),
        };
        analyses.take_up::<DiagnosisInfo>()?;
        analyses.take_up::<FitInfo>()?;
        Ok(analyses)
    }

    /// Starts one.
    pub fn start<A: Analysis>(
        self: &Arc<Self>,
        thruster: &Arc<Thruster>,
        rig: &RigDesk,
        who: &Identity,
        subject: Subject,
        after: Option<&str>,
        options: Options,
    ) -> Result<A, Problem> {
        let entry = A::KIND.entry();
        let before = match after {
            Some(id) => self.recordings_of(&self.find::<A>(&thruster.id, id)?, sequel::FILES_MAX)?,
            None => Vec::new(),
        };
        let mut running = lock(&self.running);
        if let Some(other) = &*running {
            return Err(busy(other));
        }
        let (_, rig_text, revision) = rig.in_force();
        let now = SystemTime::now();
        let info = JobInfo {
            id: self.name_for(A::KIND, &thruster.id, now),
            thruster: thruster.id.clone(),
            owner: who.name.clone(),
            state: JobState::Running,
            of: match &subject {
                Subject::Recording(name, _) => format!("recording {name}"),
                Subject::Last(time_s, _) => format!("the last {time_s:.0} s"),
            },
            recording: match &subject {
                Subject::Recording(name, _) => Some(name.clone()),
                Subject::Last(..) => None,
            },
            after: after.map(str::to_owned),
            rig_number: revision.number,
            rig_revision: revision.revision,
            started: humantime::format_rfc3339_millis(now).to_string(),
            step: None,
            elapsed_s: 0.0,
            cause: None,
            lossy: false,
            usable: false,
        };
        self.make_room::<A>();
        let folder = self.begin(&A::from(info.clone())).map_err(|error| self.not_kept(&error))?;
        let begun = Running {
            kind: A::KIND,
            info: info.clone(),
            thruster: Arc::clone(thruster),
            child: None,
            cancelled: false,
            began: Instant::now(),
        };
        begun.tell("starting");
        *running = Some(begun);
        drop(running);
        let job = job::Job { kind: A::KIND, folder, before, subject, options, rig: rig_text };
        let theirs = Arc::clone(self);
        let work = move || theirs.end::<A>(job.run(&theirs));
        if let Err(error) = std::thread::Builder::new().name(entry.name.into()).spawn(work) {
            self.end::<A>(Err(error.to_string()));
            return Err(self.not_kept(&error));
        }
        let words = format!("{} began to {} {}: {}", who.name, entry.command, info.of, info.id);
        self.events.tell(entry.started, Some(&info.thruster), &who.name, words);
        Ok(A::from(info))
    }

    /// Those of a thruster, oldest first.
    pub fn list<A: Analysis>(&self, thruster: &str) -> Vec<A> {
        let running = lock(&self.running).as_ref().filter(|one| one.kind == A::KIND).map(Running::shown);
        let mut known = self.past::<A>();
        if let Some(running) = running {
            known.retain(|one| one.job().id != running.id);
            known.push(A::from(running));
        }
        known.retain(|one| one.job().thruster == thruster);
        known.sort_by(kept::older);
        known
    }

    /// One of them.
    pub fn find<A: Analysis>(&self, thruster: &str, id: &str) -> Result<A, Problem> {
        let running = lock(&self.running).as_ref().filter(|one| one.is(A::KIND, id)).map(Running::shown);
        let known = running.map(A::from).or_else(|| self.read(id));
        known.filter(|one| one.job().thruster == thruster).ok_or_else(|| {
            let entry = A::KIND.entry();
            Problem::new(entry.unknown, format!("there is no {} {id:?} of {thruster}", entry.name))
                .hint(format!("GET …/{} lists them", entry.route))
        })
    }

    /// Cancels one that runs; deletes one that is past. Its owner may, or an admin.
    pub fn remove<A: Analysis>(
        &self,
        thruster: &str,
        id: &str,
        who: &Identity,
    ) -> Result<Option<A>, Problem> {
        let (found, entry) = (self.find::<A>(thruster, id)?, A::KIND.entry());
        let owner = &found.job().owner;
        if who.role != Role::Admin && who.name != *owner {
            return Err(Problem::new(
                Kind::RoleTooLow,
                format!("{} {id:?} belongs to {owner:?}, not to {:?}", entry.name, who.name),
            )
            .hint("its owner may, and whoever has a token of role admin"));
        }
        if let Some(running) = lock(&self.running).as_mut().filter(|running| running.is(A::KIND, id)) {
            running.end();
            return Ok(Some(A::from(JobInfo { state: JobState::Cancelled, ..running.shown() })));
        }
        self.delete(A::KIND, id).map_err(|error| self.not_kept(&error))?;
        let words = format!("{} deleted {} {id}", who.name, entry.name);
        self.events.tell(entry.deleted, Some(thruster), &who.name, words);
        Ok(None)
    }

    /// Ends what runs: the gateway ends.
    pub fn stop(&self) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.end();
        }
    }

    /// The process of the one that runs, unless it was cancelled before.
    fn hold(&self, child: Child) -> Arc<Mutex<Child>> {
        let child = Arc::new(Mutex::new(child));
        if let Some(running) = lock(&self.running).as_mut() {
            running.child = Some(Arc::clone(&child));
            if running.cancelled {
                running.end();
            }
        }
        child
    }

    /// The one that runs has come so far.
    fn step(&self, words: &str) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.info.step = Some(words.to_owned());
            running.tell(words);
        }
    }

    /// The one that runs is over: what it made, or why there is nothing.
    fn end<A: Analysis>(&self, made: Result<job::Made, String>) {
        let Some(running) = lock(&self.running).take() else { return };
        let job = JobInfo { step: None, ..running.shown() };
        let info = match made {
            _ if running.cancelled => A::from(JobInfo { state: JobState::Cancelled, ..job }),
            Ok(made) => {
                let (lossy, usable) = (made.lossy, made.usable);
                A::done(JobInfo { state: JobState::Done, lossy, usable, ..job }, &made.report, &made.rig)
            }
            Err(cause) => A::from(JobInfo { state: JobState::Failed, cause: Some(cause), ..job }),
        };
        let (entry, job) = (A::KIND.entry(), info.job());
        if let Err(error) = self.write(&info) {
            tracing::error!("{} {}: {error}", entry.name, job.id);
        }
        running.thruster.set_analysis(None);
        let (kind, became) = match (job.state, &job.cause) {
            (JobState::Done, _) => (entry.done, format!(": {}", info.words())),
            (JobState::Cancelled, _) => (entry.cancelled, " was cancelled".into()),
            (_, cause) => {
                let cause = cause.as_deref().unwrap_or("for no known reason");
                (entry.failed, format!(" failed: {cause}"))
            }
        };
        let words = format!("{} {}{became}", entry.name, job.id);
        self.events.tell(kind, Some(&job.thruster), &job.owner, words);
    }
}

/// There is one at a time, whatever its kind.
fn busy(other: &Running) -> Problem {
    let (entry, info) = (other.kind.entry(), &other.info);
    Problem::new(entry.active, format!("{} is being {} ({})", info.thruster, entry.being, info.id)).hint(
        format!(
            "wait for it, or DELETE …/{}/{} cancels it: there is one at a time of diagnoses and fits together",
            entry.route, info.id
        ),
    )
}
