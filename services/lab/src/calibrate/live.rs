//! A session on a living servo: this process takes the controller's place.
//!
//! The servo runs as in any deployment, with its limits, trips and the drive's own time-out. Whatever ends this
//! process ends its commands, and the servo goes to zero by itself; Ctrl-C reaches both. As a job of a running service
//! the servo is the service's, and its controller is asked to stand aside for as long as this process speaks.

use std::path::Path;
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

use super::servo::Servo;
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
    /// What was asked of this process by signals.
    pub signals: Signals,
}

/// Signals that end the process: while it drives, and while it writes down what it measured, in order.
#[derive(Clone, Debug, Default)]
pub struct Signals {
    stop: Arc<AtomicBool>,
    over: Arc<AtomicBool>,
}

impl Signals {
    fn heard() -> Result<Self, Failure> {
        let heard = Self::default();
        for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT, signal_hook::consts::SIGHUP]
        {
            signal_hook::flag::register_conditional_default(signal, Arc::clone(&heard.over))
                .and_then(|_| signal_hook::flag::register(signal, Arc::clone(&heard.stop)))
                .map_err(Failure::failed)?;
        }
        Ok(heard)
    }

    /// What was to be kept is: from now on they end the process as they end any other.
    ///
    /// # Errors
    /// One came meanwhile.
    pub fn let_through(&self) -> Result<(), Failure> {
        self.over.store(true, Ordering::Relaxed);
        match self.stop.load(Ordering::Relaxed) {
            true => Err(Failure::failed("aborted; the drive is at zero")),
            false => Ok(()),
        }
    }
}

/// Runs a session to its end.
///
/// # Errors
/// The configuration, the servo, or shared memory; nothing was driven then.
pub fn run(bench: &Bench) -> Result<Ended, Failure> {
    let thruster = bench.config.thruster(bench.thruster).map_err(Failure::input)?;
    let settings =
        Settings::new(bench.config, bench.thruster, thruster, bench.rig).map_err(Failure::input)?;
    let signals = Signals::heard()?;
    let stop = Arc::clone(&signals.stop);
    let plan = Plan::new(
        bench.rig,
        settings.limits.drive_max,
        settings.limits.speed_rad_s,
        settings.period_ns as f64 * 1e-9,
        bench.share,
    );
    let mut servo = if bench.job { Servo::of_service() } else { Servo::start(bench)? };
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
    let (session, stopped) = go(session, &mut wire, &stop, bench);
    wire.rest();
    if bench.job {
        // The thruster is anybody's again, and no lease ends what follows.
        eprintln!("step: writing the recording");
    }
    // What follows is arithmetic, and must not keep the servos of others waiting.
    ordinary();
    Ok(Ended { session, stopped, signals })
}

/// The session, tick by tick, until it ends, and why before its end.
fn go(mut session: Session, wire: &mut Wire, stop: &AtomicBool, bench: &Bench) -> (Session, Option<String>) {
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
                return (session, Some(switched_off(told.faults)));
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
                            return (session, Some(words));
                        }
                    }
                    0.0
                }
                Next::Finished => return (session, None),
                Next::Stopped(why) => return (session, Some(why.to_string())),
            };
        }
        if stop.load(Ordering::Relaxed) || wire.is_to_rest() {
            return (session, Some("aborted; the drive is at zero".into()));
        }
        if heard.elapsed() > SILENCE {
            let words = "the servo fell silent\nhint: its words stand above";
            return (session, Some(words.into()));
        }
        wire.command(drive, 0);
    }
}

/// Why the drive is off that was armed: a fault, or somebody asked for it.
fn switched_off(faults: u64) -> String {
    if faults == 0 {
        return "somebody switched the drive off: no fault stands, so it was STOP, a disarm, or whoever took command\nhint: the service's events say who; begin anew when they agree".into();
    }
    format!(
        "the servo switched off: {}\nhint: docs/faults has a page for each; remove the cause and begin anew",
        Names(faults)
    )
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

#[cfg(test)]
mod tests {
    use super::*;
    use kort_proto::faults::Fault;

    #[test]
    fn a_stop_is_not_told_as_a_fault_without_a_name() {
        let stopped = switched_off(0);
        assert!(stopped.contains("STOP") && !stopped.contains("docs/faults"), "{stopped}");
        let tripped = switched_off(Fault::OverCurrent.bit());
        assert!(tripped.contains(Fault::OverCurrent.name()) && tripped.contains("docs/faults"), "{tripped}");
    }
}
