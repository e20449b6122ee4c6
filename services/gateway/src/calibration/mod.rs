//! Calibrations by the interface: `kort calibrate` as a process of its own on the service's own servo, one at a time,
//! under the lease of who asked for it. Each stage waits until that holder agrees to it.
//!
//! Each has a folder: `info.json`, the rig it began from, and, when it is done, the calibrated rig, the recording and the
//! report.

mod job;
mod view;

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::process::ChildStdin;
use std::sync::{Arc, Mutex};
use std::time::{Instant, SystemTime};

use kort_proto::config::Config;
use kort_proto::events::EventKind;
use kort_proto::transport::Deployment;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

use crate::events::Events;
use crate::problem::{Kind, Problem};
use crate::record::is_name;
use crate::rig::{RigDesk, write_whole};
use crate::thruster::{Thruster, lock};
use crate::token::Identity;

pub use view::{CalibrationInfo, CalibrationState, CalibrationStep};

/// Calibrations that are kept; the oldest goes for the next.
const KEPT_MAX: usize = 50;

/// Starts, lists, goes on with and aborts calibrations.
#[derive(Debug)]
pub struct Calibrations {
    folder: PathBuf,
    program: PathBuf,
    config: Option<PathBuf>,
    root: PathBuf,
    events: Arc<Events>,
    running: Mutex<Option<Running>>,
}

/// The one that runs.
#[derive(Debug)]
struct Running {
    info: CalibrationInfo,
    thruster: Arc<Thruster>,
    began: Instant,
    /// Its process, and where it hears that the holder agrees.
    process: Option<(u32, Option<ChildStdin>)>,
    /// Why it is to end; none while it is not.
    ends: Option<String>,
}

impl Running {
    fn shown(&self) -> CalibrationInfo {
        CalibrationInfo { elapsed_s: self.began.elapsed().as_secs_f64(), ..self.info.clone() }
    }

    /// Tells the thruster how far it is.
    fn tell(&self) {
        self.thruster.set_calibration(Some((self.info.clone(), self.began)));
    }

    /// Has it end: its process brings the drive to zero.
    fn end(&mut self, why: String) {
        if self.ends.is_some() {
            return;
        }
        self.ends = Some(why);
        let pid = self.process.as_ref().and_then(|(pid, _)| i32::try_from(*pid).ok());
        if let Some(pid) = pid.and_then(Pid::from_raw) {
            // Not reaped before the running one is taken away: no other process has this number.
            let _ = kill_process(pid, Signal::TERM);
        }
    }
}

impl Calibrations {
    /// Calibrations in this folder; those whose gateway ended while they ran have failed.
    ///
    /// # Errors
    /// The folder cannot be made.
    pub fn open(
        folder: &Path,
        config: &Config,
        deployment: &Deployment,
        events: Arc<Events>,
    ) -> io::Result<Calibrations> {
        fs::create_dir_all(folder)?;
        let calibrations = Calibrations {
            folder: folder.to_owned(),
            program: std::env::current_exe()?,
            config: config.file.clone(),
            root: deployment.root().to_owned(),
            events,
            running: Mutex::default(),
        };
        for info in calibrations.past() {
            if info.state == CalibrationState::Running {
                let cause = Some("the gateway ended while it ran".into());
                let _ = calibrations.write(&over(info, CalibrationState::Failed, cause));
            }
        }
        Ok(calibrations)
    }

    /// Starts one for the holder of a lease; the thruster must be at rest, disarmed, without a fault.
    pub fn start(
        self: &Arc<Self>,
        thruster: &Arc<Thruster>,
        rig: &RigDesk,
        who: &Identity,
        lease: Option<&str>,
        share: f64,
    ) -> Result<CalibrationInfo, Problem> {
        let lease = thruster.may_calibrate(lease)?;
        let mut running = lock(&self.running);
        if let Some(other) = &*running {
            return Err(Problem::new(
                Kind::CalibrationActive,
                format!("{} is being calibrated ({})", other.info.thruster, other.info.id),
            )
            .hint("wait for it, or DELETE …/calibrations/{calibration} aborts it: there is one at a time"));
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
        let info = CalibrationInfo {
            id,
            thruster: thruster.id.clone(),
            owner: who.name.clone(),
            state: CalibrationState::Running,
            share,
            rig_number: entry.number,
            rig_revision: entry.revision,
            started: humantime::format_rfc3339_millis(now).to_string(),
            stage: None,
            asks: None,
            drives: true,
            elapsed_s: 0.0,
            cause: None,
        };
        self.make_room();
        let folder = self.folder.join(&info.id);
        fs::create_dir_all(&folder)
            .and_then(|()| self.write(&info))
            .map_err(|error| self.not_kept(&error))?;
        let now_running = Running {
            info: info.clone(),
            thruster: Arc::clone(thruster),
            began: Instant::now(),
            process: None,
            ends: None,
        };
        now_running.tell();
        *running = Some(now_running);
        drop(running);
        let job = job::Job { folder, thruster: thruster.id.clone(), rig: rig_text, share, lease };
        let theirs = Arc::clone(self);
        let spawned = std::thread::Builder::new().name("calibration".into()).spawn(move || job.run(&theirs));
        if let Err(error) = spawned {
            self.end(CalibrationState::Failed, Some(error.to_string()));
            return Err(self.not_kept(&error));
        }
        let words = format!("{} began to calibrate {}: {}", who.name, info.thruster, info.id);
        self.events.tell(EventKind::CalibrationStarted, Some(&info.thruster), &who.name, words);
        Ok(info)
    }

    /// Calibrations of a thruster, oldest first.
    pub fn list(&self, thruster: &str) -> Vec<CalibrationInfo> {
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

    /// One calibration.
    pub fn find(&self, thruster: &str, id: &str) -> Result<CalibrationInfo, Problem> {
        let running = lock(&self.running).as_ref().map(Running::shown).filter(|info| info.id == id);
        let known = running.or_else(|| if is_name(id) { self.read(id) } else { None });
        known.filter(|info| info.thruster == thruster).ok_or_else(|| {
            Problem::new(Kind::UnknownCalibration, format!("there is no calibration {id:?} of {thruster}"))
                .hint("GET …/calibrations lists them")
        })
    }

    /// Its report, the document of `kort calibrate --json`; null where there is none.
    pub fn report(&self, info: &CalibrationInfo) -> Value {
        let path = self.folder.join(&info.id).join("report.json");
        let text = if info.state == CalibrationState::Running { None } else { fs::read(path).ok() };
        text.and_then(|text| serde_json::from_slice(&text).ok()).unwrap_or(Value::Null)
    }

    /// A file of one that is done; what was measured of one that is over, however it ended.
    pub fn file(&self, info: &CalibrationInfo, name: &str) -> Result<Vec<u8>, Problem> {
        let there = match info.state {
            CalibrationState::Done => true,
            CalibrationState::Running => false,
            _ => name == job::RECORDING,
        };
        there.then(|| fs::read(self.folder.join(&info.id).join(name)).ok()).flatten().ok_or_else(|| {
            let words = format!("calibration {} is {}: it has no {name}", info.id, info.state.name());
            Problem::new(Kind::Refused, words)
                .hint("GET …/calibrations/{calibration} says how far it is, and why it ended")
        })
    }

    /// The lease's holder agrees to the stage that is asked for.
    pub fn go_on(
        &self,
        thruster: &Thruster,
        id: &str,
        lease: Option<&str>,
        stage: &str,
    ) -> Result<CalibrationInfo, Problem> {
        let info = self.find(&thruster.id, id)?;
        thruster.holds(lease)?;
        let mut running = lock(&self.running);
        let asked = running.as_mut().filter(|running| {
            running.info.id == id
                && running.info.asks.is_some()
                && running.info.stage.as_deref() == Some(stage)
        });
        let Some(running) = asked else {
            let at = info.stage.as_deref().unwrap_or(info.state.name());
            let words = format!("calibration {id} does not ask for {stage:?}; it is at {at:?}");
            return Err(Problem::new(Kind::Refused, words).hint("agree to the stage that `asks` speaks of"));
        };
        let agree = running.process.as_mut().and_then(|(_, agree)| agree.as_mut());
        // A process that has ended says so itself.
        let _ = agree.map(|agree| agree.write_all(b"\n").and_then(|()| agree.flush()));
        running.info.asks = None;
        running.tell();
        Ok(running.shown())
    }

    /// Ends one that runs; deletes one that is past.
    pub fn remove(
        &self,
        thruster: &str,
        id: &str,
        who: &Identity,
    ) -> Result<Option<CalibrationInfo>, Problem> {
        self.find(thruster, id)?;
        if let Some(running) = lock(&self.running).as_mut().filter(|running| running.info.id == id) {
            running.end(format!("{} aborted it", who.name));
            return Ok(Some(running.shown()));
        }
        fs::remove_dir_all(self.folder.join(id)).map_err(|error| self.not_kept(&error))?;
        Ok(None)
    }

    /// Ends what runs: the gateway ends.
    pub fn stop(&self) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.end("the gateway ended".into());
        }
    }

    /// The process of the one that runs.
    fn hold(&self, pid: u32, agree: Option<ChildStdin>) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.process = Some((pid, agree));
            if let Some(why) = running.ends.take() {
                running.end(why);
            }
        }
    }

    /// Was it told to end? If so, whether it still drives.
    fn is_to_end(&self) -> Option<bool> {
        let running = lock(&self.running);
        running.as_ref().filter(|running| running.ends.is_some()).map(|running| running.info.drives)
    }

    /// It drives only while the lease is in force under which it was begun.
    fn keep_to_lease(&self, lease: &str) {
        let mut running = lock(&self.running);
        let Some(running) = running.as_mut().filter(|running| running.info.drives) else { return };
        if running.thruster.holds(Some(lease)).is_err() {
            let by = running.thruster.desk().lease.taken_over(lease).map(str::to_owned);
            running.end(by.map_or("its lease ended".into(), |by| format!("{by} took command")));
        }
    }

    /// It is about to begin a stage, once the holder agrees.
    fn asks(&self, stage: &str, words: &str) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.info.stage = Some(stage.to_owned());
            running.info.asks = Some(words.to_owned());
            running.tell();
        }
    }

    /// The session is over, and it estimates: the thruster is anybody's again.
    fn estimates(&self, step: &str) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.info.stage = Some(step.to_owned());
            running.info.asks = None;
            running.info.drives = false;
            running.tell();
        }
    }

    /// Its process is gone.
    fn lets_go(&self) {
        if let Some(running) = lock(&self.running).as_mut() {
            running.process = None;
        }
    }

    /// The one that runs is over.
    fn end(&self, state: CalibrationState, cause: Option<String>) {
        let Some(running) = lock(&self.running).take() else { return };
        let (state, cause) = match &running.ends {
            Some(why) if state != CalibrationState::Done => (CalibrationState::Aborted, Some(why.clone())),
            _ => (state, cause),
        };
        let info = over(running.shown(), state, cause);
        if let Err(error) = self.write(&info) {
            tracing::error!("calibration {}: {error}", info.id);
        }
        running.thruster.set_calibration(None);
        let why = info.cause.as_deref().map(|why| format!(": {why}")).unwrap_or_default();
        let words = format!("calibration {} is {}{why}", info.id, state.name());
        self.events.tell(EventKind::CalibrationEnded, Some(&info.thruster), &info.owner, words);
    }

    /// Deletes the oldest where there are too many.
    fn make_room(&self) {
        let mut past = self.past();
        past.sort_by(|a, b| (&a.started, &a.id).cmp(&(&b.started, &b.id)));
        let over = (past.len() + 1).saturating_sub(KEPT_MAX);
        for info in past.into_iter().take(over) {
            let _ = fs::remove_dir_all(self.folder.join(info.id));
        }
    }

    fn past(&self) -> Vec<CalibrationInfo> {
        let folders = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        folders.filter_map(|entry| self.read(entry.file_name().to_str()?)).collect()
    }

    fn read(&self, id: &str) -> Option<CalibrationInfo> {
        serde_json::from_slice(&fs::read(self.folder.join(id).join("info.json")).ok()?).ok()
    }

    fn write(&self, info: &CalibrationInfo) -> io::Result<()> {
        write_whole(&self.folder.join(&info.id), "info.json", &serde_json::to_vec_pretty(info)?)
    }

    fn not_kept(&self, error: &io::Error) -> Problem {
        Problem::new(Kind::StorageFailed, format!("{}: {error}", self.folder.display()))
            .hint("see that the folder of gateway.calibrations can be written and has space")
    }
}

/// One that is over, with what became of it.
fn over(info: CalibrationInfo, state: CalibrationState, cause: Option<String>) -> CalibrationInfo {
    CalibrationInfo { state, cause, stage: None, asks: None, drives: false, ..info }
}
