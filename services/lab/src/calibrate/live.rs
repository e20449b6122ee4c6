//! A session on a living servo: this process takes the controller's place.
//!
//! The servo runs as in any deployment, with its limits, trips and the drive's own time-out. Whatever ends this
//! process ends its commands, and the servo goes to zero by itself; Ctrl-C reaches both. As a job of a running service
//! the servo is the service's, and its controller is asked to stand aside for as long as this process speaks.

use std::path::{Path, PathBuf};
use std::process::{Child, Command as Program};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, TryRecvError, channel};
use std::time::{Duration, Instant};

use kort_calibrate::{Next, Plan, Session};
use kort_proto::config::Config;
use kort_proto::faults::Names;
use kort_proto::messages::{ASIDE_NS, Command, DriveKind, Outcome, Process, Request, RequestKind, Telemetry};
use kort_proto::transport::{ControllerPorts, Deployment, GatewayPorts, keep_on, ordinary, realtime};
use kort_servo::settings::Settings;
use kort_thruster::rig::Rig;
use rustix::process::{Pid, Signal, kill_process};

use crate::failure::Failure;

/// The servo is up, and armed, within this.
const PATIENCE: Duration = Duration::from_secs(10);
/// Longest wait for a tick.
const TICK: Duration = Duration::from_millis(20);
/// A servo that tells nothing for this long is gone.
const SILENCE: Duration = Duration::from_secs(2);
/// The controller of a running service is asked to stand aside this often: several may be lost.
const ASIDE_EVERY: Duration = Duration::from_nanos(ASIDE_NS / 5);

/// What to run on.
pub struct Bench<'a> {
    /// The deployment's file.
    pub file: Option<&'a Path>,
    /// The deployment.
    pub config: &'a Config,
    /// Its shared memory.
    pub deployment: &'a Deployment,
    /// The thruster.
    pub thruster: &'a str,
    /// The rig as stated.
    pub rig: &'a Rig,
    /// Share of the largest drive.
    pub share: f64,
    /// Nobody is asked.
    pub yes: bool,
    /// The service that runs on the deployment asked for it.
    pub job: bool,
}

/// How it ended: the session with its record, and why it stopped, if it did.
pub struct Ended {
    /// The session.
    pub session: Session,
    /// Why it stopped before its end.
    pub stopped: Option<String>,
}

/// Runs a session to its end.
///
/// # Errors
/// The configuration, the servo, or shared memory; nothing was driven then.
pub fn run(bench: &Bench) -> Result<Ended, Failure> {
    let thruster = bench.config.thruster(bench.thruster).map_err(Failure::input)?;
    let settings =
        Settings::new(bench.config, bench.thruster, thruster, bench.rig).map_err(Failure::input)?;
    let stop = Arc::new(AtomicBool::new(false));
    let over = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT, signal_hook::consts::SIGHUP] {
        // Once nothing is driven any more they end the process as they end any other.
        signal_hook::flag::register_conditional_default(signal, Arc::clone(&over))
            .map_err(Failure::failed)?;
        signal_hook::flag::register(signal, Arc::clone(&stop)).map_err(Failure::failed)?;
    }
    let plan = Plan::new(
        bench.rig,
        settings.limits.drive_max,
        settings.limits.speed_rad_s,
        settings.period_ns as f64 * 1e-9,
        bench.share,
    );
    let mut servo = if bench.job { Servo(None) } else { Servo::start(bench)? };
    let mut wire = Wire::open(bench, settings.limits.kind, &mut servo, &stop)?;
    if let Some(missing) = keep_on(&thruster.controller.cores) {
        eprintln!("warning: {missing}");
    }
    if thruster.controller.priority > 0 {
        for missing in realtime(thruster.controller.priority, false) {
            eprintln!("warning: {missing}");
        }
    }
    wire.arm(&mut servo, &stop)?;
    let session = Session::new(plan, settings.limits.kind.name());
    let ended = go(session, &mut wire, &stop, bench);
    wire.rest();
    over.store(true, Ordering::Relaxed);
    // What follows is arithmetic, and must not keep the servos of others waiting.
    ordinary();
    Ok(ended)
}

/// The session, tick by tick, until it ends.
fn go(mut session: Session, wire: &mut Wire, stop: &AtomicBool, bench: &Bench) -> Ended {
    let mut asked: Option<&'static str> = None;
    let mut answer: Option<Receiver<bool>> = None;
    let mut first_ns = None;
    let mut heard = Instant::now();
    let mut drive = 0.0;
    loop {
        wire.controller.ticks.wait(TICK);
        while let Some(told) = wire.controller.telemetry.next() {
            heard = Instant::now();
            if told.armed == 0 {
                let words = format!(
                    "the servo switched off: {}\nhint: docs/faults has a page for each; remove the cause and begin anew",
                    Names(told.faults)
                );
                return Ended { session, stopped: Some(words) };
            }
            let from_ns = *first_ns.get_or_insert(told.time_ns);
            let time_s = told.time_ns.saturating_sub(from_ns) as f64 * 1e-9;
            drive = match session.tick(time_s, &told.signals) {
                Next::Drive(drive) => drive,
                Next::Ask { stage, words } => {
                    if asked != Some(stage) {
                        asked = Some(stage);
                        answer = ask(stage, &words, bench);
                    }
                    match answer.as_ref().map_or(Ok(true), Receiver::try_recv) {
                        Ok(true) => session.go_on(),
                        Err(TryRecvError::Empty) => (),
                        Ok(false) | Err(TryRecvError::Disconnected) => {
                            let words =
                                format!("nobody agreed to {stage}\nhint: Enter goes on; --yes asks nobody");
                            return Ended { session, stopped: Some(words) };
                        }
                    }
                    0.0
                }
                Next::Finished => return Ended { session, stopped: None },
                Next::Stopped(why) => return Ended { session, stopped: Some(why.to_string()) },
            };
        }
        if stop.load(Ordering::Relaxed) || wire.is_to_rest() {
            return Ended { session, stopped: Some("aborted; the drive is at zero".into()) };
        }
        if heard.elapsed() > SILENCE {
            let words = "the servo fell silent\nhint: its words stand above";
            return Ended { session, stopped: Some(words.into()) };
        }
        wire.command(drive, 0);
    }
}

/// Asks the operator on a thread of its own: the servo goes on being commanded zero meanwhile.
fn ask(stage: &str, words: &str, bench: &Bench) -> Option<Receiver<bool>> {
    if bench.job {
        eprintln!("ask: {stage}: {words}");
    } else {
        eprintln!("\n{stage}: {words}");
        if bench.yes {
            return None;
        }
        eprint!("[Enter] goes on, Ctrl-C stops: ");
    }
    let (tell, told) = channel();
    std::thread::spawn(move || {
        let mut line = String::new();
        let read = std::io::stdin().read_line(&mut line).is_ok_and(|bytes| bytes > 0);
        let _ = tell.send(read && line.trim().is_empty());
    });
    Some(told)
}

/// The servo's process; it ends with this one. None: it is the service's.
struct Servo(Option<Child>);

impl Servo {
    fn start(bench: &Bench) -> Result<Self, Failure> {
        let program: PathBuf = std::env::current_exe().map_err(Failure::failed)?;
        let mut command = Program::new(program);
        command.arg("servo").arg("--root").arg(bench.deployment.root());
        command.arg("--parent").arg(std::process::id().to_string());
        if let Some(file) = bench.file.or(bench.config.file.as_deref()) {
            command.arg("--config").arg(file);
        }
        command.arg("--thruster").arg(bench.thruster);
        command.spawn().map(|child| Self(Some(child))).map_err(Failure::failed)
    }

    /// Has it ended?
    fn ended(&mut self) -> Option<Failure> {
        let status = self.0.as_mut()?.try_wait().ok().flatten()?;
        let words = format!("the servo ended ({status}); its reason stands above");
        Some(match status.code() {
            Some(2) => Failure::Input(words),
            _ => {
                Failure::Failed(format!("{words}\nhint: if a service runs on this deployment, stop it first"))
            }
        })
    }
}

impl Drop for Servo {
    fn drop(&mut self) {
        let Some(child) = &mut self.0 else { return };
        if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, Signal::TERM);
        }
        let end = Instant::now() + SILENCE;
        while Instant::now() < end && matches!(child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(5));
        }
        let _ = child.kill();
        let _ = child.wait();
    }
}

/// The controller's and the operator's ports.
struct Wire {
    controller: ControllerPorts,
    gateway: GatewayPorts,
    kind: DriveKind,
    asked: u64,
    /// When the service's controller was asked to stand aside; none where none runs.
    aside: Option<Instant>,
}

impl Wire {
    fn open(bench: &Bench, kind: DriveKind, servo: &mut Servo, stop: &AtomicBool) -> Result<Self, Failure> {
        let end = Instant::now() + PATIENCE;
        loop {
            if let Some(ended) = servo.ended() {
                return Err(ended);
            }
            if stop.load(Ordering::Relaxed) {
                return Err(Failure::failed("aborted; nothing was driven"));
            }
            let opened = ControllerPorts::open(bench.deployment, bench.thruster).and_then(|controller| {
                Ok((controller, GatewayPorts::open(bench.deployment, bench.thruster)?))
            });
            match opened {
                Ok((controller, gateway)) => {
                    let aside = bench.job.then(Instant::now);
                    let mut wire = Self { controller, gateway, kind, asked: 0, aside };
                    // The servo of this generation speaks.
                    if wire.listen(Duration::from_millis(200)).is_some() {
                        return wire.alone();
                    }
                }
                Err(error) if Instant::now() > end => return Err(Failure::failed(error)),
                Err(_) => (),
            }
            if Instant::now() > end {
                return Err(Failure::failed("the servo does not speak\nhint: its words stand above"));
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    fn listen(&mut self, patience: Duration) -> Option<Telemetry> {
        let end = Instant::now() + patience;
        loop {
            if let Some(told) = self.controller.telemetry.next() {
                return Some(told);
            }
            if Instant::now() > end {
                return None;
            }
            self.controller.ticks.wait(TICK);
        }
    }

    /// The only one that commands: a controller that runs stands aside.
    fn alone(mut self) -> Result<Self, Failure> {
        if self.aside.is_none() {
            return Ok(self);
        }
        match self.answer(RequestKind::StandAside, Process::Controller, None) {
            Some((Outcome::Done, _)) => Ok(self),
            Some((_, words)) => Err(Failure::failed(format!("the controller does not stand aside: {words}"))),
            None => Err(Failure::failed("the controller does not answer\nhint: GET /readyz, and its log")),
        }
    }

    fn command(&mut self, drive: f64, stop: u32) {
        if self.aside.is_some_and(|at| at.elapsed() > ASIDE_EVERY) {
            self.aside = Some(Instant::now());
            let _ = self.send(RequestKind::StandAside);
        }
        let command = Command {
            drive,
            kind: self.kind as u32,
            stop,
            thrust_cmd_n: f64::NAN,
            speed_cmd_rad_s: f64::NAN,
            ..Command::default()
        };
        // What cannot be sent is missed by the servo, which watches for that.
        let _ = self.controller.command.send(command);
    }

    /// Arms, with a controller at zero meanwhile. A device that has just been opened needs a moment.
    fn arm(&mut self, servo: &mut Servo, stop: &AtomicBool) -> Result<(), Failure> {
        let end = Instant::now() + PATIENCE;
        let mut refused = String::new();
        while Instant::now() < end {
            if let Some(ended) = servo.ended() {
                return Err(ended);
            }
            if stop.load(Ordering::Relaxed) {
                return Err(Failure::failed("aborted; nothing was driven"));
            }
            for kind in [RequestKind::ClearFaults, RequestKind::Arm] {
                match self.request(kind) {
                    Some((Outcome::Done, _)) if kind == RequestKind::Arm => {
                        while self.controller.telemetry.next().is_some() {}
                        // Rows from before the arming would pass for a servo that went off.
                        while self.listen(TICK).is_some_and(|told| told.armed == 0) {
                            self.command(0.0, 0);
                        }
                        return Ok(());
                    }
                    Some((_, words)) if kind == RequestKind::Arm => refused = words,
                    _ => (),
                }
            }
        }
        Err(Failure::failed(format!("the servo cannot be armed: {refused}")))
    }

    /// Sends a request; its number.
    fn send(&mut self, kind: RequestKind) -> Option<u64> {
        self.asked += 1;
        let request = Request { id: self.asked, kind: kind as u32, ..Request::default() };
        self.gateway.request.send(request).ok().map(|()| self.asked)
    }

    /// Asks the servo, with commands of zero meanwhile.
    fn request(&mut self, kind: RequestKind) -> Option<(Outcome, String)> {
        self.answer(kind, Process::Servo, Some(0.0))
    }

    fn answer(&mut self, kind: RequestKind, of: Process, drive: Option<f64>) -> Option<(Outcome, String)> {
        let id = self.send(kind)?;
        let session = self.gateway.request.session();
        let end = Instant::now() + Duration::from_millis(500);
        while Instant::now() < end {
            self.controller.ticks.wait(TICK);
            if let Some(drive) = drive {
                self.command(drive, 0);
            }
            while let Some(reply) = self.gateway.reply.next() {
                if reply.id == id && reply.to_session == session && reply.from == of as u32 {
                    return Some((Outcome::from_u32(reply.outcome)?, reply.message.as_str().to_owned()));
                }
            }
        }
        None
    }

    /// Does the service bring its thrusters to rest? What it asks of its controller concerns whoever took its place.
    fn is_to_rest(&mut self) -> bool {
        let mut rest = false;
        while let Some(request) = self.controller.request.next() {
            rest |= request.kind == RequestKind::Rest as u32;
        }
        rest
    }

    /// Zero and off.
    fn rest(&mut self) {
        self.command(0.0, 1);
        self.request(RequestKind::Disarm);
    }
}
