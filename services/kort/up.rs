//! `kort up`: owns the shared memory, runs servo, controller and gateway as child processes,
//! replaces one that dies, and stops with thrust at zero first.

use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use kort_proto::config::{Config, ConfigError};
use kort_proto::messages::{Request, RequestKind};
use kort_proto::transport::{Deployment, GatewayPorts, Owner, TransportError};
use rustix::process::{Pid, Signal, kill_process, set_parent_process_death_signal};
use thiserror::Error;
use tracing::{info, warn};

/// How often children are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// A child that lived shorter than this did not start properly.
const START: Duration = Duration::from_secs(3);
/// Failed starts in a row after which the shared memory is created afresh.
const STARTS_PER_GENERATION: u32 = 3;
/// Fresh generations without a proper start after which `up` gives up.
const GENERATIONS: u32 = 3;
/// How long the servo may take to be at zero, and a child to end.
const STOP_WITHIN: Duration = Duration::from_secs(2);

/// Why `up` cannot run.
#[derive(Debug, Error)]
pub enum UpError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Shared memory.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The gateway could not start.
    #[error(transparent)]
    Gateway(#[from] kort_gateway::GatewayError),
    /// The system refuses.
    #[error("{what}: {error}")]
    System {
        /// What was tried.
        what: String,
        /// The system's words.
        error: std::io::Error,
    },
    /// A child cannot use the configuration.
    #[error("{name} cannot use this deployment; its reason stands above")]
    Refused {
        /// The child.
        name: String,
    },
    /// A child does not start.
    #[error("{name} does not start\nhint: its reason stands above; `kort {name}` alone shows it again")]
    DoesNotStart {
        /// The child.
        name: String,
    },
}

/// Runs the deployment until SIGINT or SIGTERM.
///
/// # Errors
/// [`UpError`] if it cannot start, or a child does not stay up.
pub fn run(config: &Config, deployment: &Deployment) -> Result<(), UpError> {
    let system = |what: &str| {
        let what = what.to_owned();
        move |error| UpError::System { what, error }
    };
    let gateway = kort_gateway::Settings::new(config)?;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT] {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(system("signals cannot be watched"))?;
    }
    let thrusters: Vec<&str> = config.thrusters.keys().map(String::as_str).collect();
    let mut owner = deployment.own()?;
    kort_gateway::check(&gateway)?;
    owner.create(&thrusters)?;
    let program = std::env::current_exe().map_err(system("this program's own path"))?;
    let mut roles: Vec<Role> = thrusters
        .iter()
        .flat_map(|id| [Role::new("servo", Some(id)), Role::new("controller", Some(id))])
        .chain([Role::new("gateway", None)])
        .collect();
    let start = |role: &mut Role| role.start(&program, config.file.as_deref(), deployment.root());
    for role in &mut roles {
        start(role)?;
    }
    match &config.file {
        Some(file) => println!("config   {}", file.display()),
        None => {
            println!("config   as built in; --config FILE takes another, config/kort.toml is found by itself")
        }
    }
    println!("console  http://{}/", gateway.bind);
    println!("API      http://{}/v1/thrusters   (described at /docs)", gateway.bind);
    println!("Ctrl-C stops all, thrust at zero first");

    let mut generations = 0;
    let result = loop {
        if stop.load(Ordering::Relaxed) {
            break Ok(());
        }
        std::thread::sleep(LOOK_EVERY);
        let mut dead = Vec::new();
        for (i, role) in roles.iter_mut().enumerate() {
            if role.has_died() {
                dead.push(i);
            }
        }
        if dead.is_empty() {
            if roles.iter().all(Role::is_up) {
                generations = 0;
            }
            continue;
        }
        if let Some(role) = roles.iter().find(|role| role.refused) {
            break Err(UpError::Refused { name: role.name.to_owned() });
        }
        // What the dead held in shared memory is freed before anyone takes their place.
        owner.clear_up_after_the_dead();
        let spent = roles.iter().find(|role| role.failed_starts >= STARTS_PER_GENERATION);
        let restarted = if let Some(role) = spent {
            generations += 1;
            if generations > GENERATIONS {
                break Err(UpError::DoesNotStart { name: role.name.to_owned() });
            }
            warn!(
                "{} failed to start {STARTS_PER_GENERATION} times: creating the shared memory afresh",
                role.name
            );
            roles.iter_mut().for_each(Role::end);
            owner.create(&thrusters).map_err(UpError::from).and_then(|_| roles.iter_mut().try_for_each(start))
        } else {
            dead.into_iter().try_for_each(|i| roles.get_mut(i).map_or(Ok(()), start))
        };
        if let Err(e) = restarted {
            break Err(e);
        }
    };
    // A servo that never came up has nothing to set to zero.
    if roles.iter().any(|role| role.name == "servo" && role.child.is_some()) {
        go_to_zero(&owner, &thrusters);
    }
    // The gateway first: nobody commands any more; the servo last.
    roles.iter_mut().rev().for_each(Role::end);
    info!("stopped");
    result
}

/// Disarms every thruster and waits until the servos say so.
fn go_to_zero(owner: &Owner, thrusters: &[&str]) {
    let end = Instant::now() + STOP_WITHIN;
    for id in thrusters {
        let Ok(mut ports) = GatewayPorts::open(owner.deployment(), id) else { continue };
        let disarm = Request { kind: RequestKind::Disarm as u32, ..Request::default() };
        let mut asked = Instant::now() - LOOK_EVERY;
        loop {
            if asked.elapsed() >= LOOK_EVERY {
                asked = Instant::now();
                let _ = ports.request.send(disarm);
            }
            std::thread::sleep(Duration::from_millis(2));
            match ports.telemetry.latest() {
                Some(telemetry) if telemetry.armed == 0 => {
                    info!(thruster = id, "thrust at zero, disarmed");
                    break;
                }
                _ if Instant::now() >= end => {
                    warn!(thruster = id, "the servo does not answer; its end switches the drive off");
                    break;
                }
                _ => {}
            }
        }
    }
}

/// One child process and how it fares.
struct Role {
    name: &'static str,
    thruster: Option<String>,
    child: Option<Child>,
    started: Instant,
    failed_starts: u32,
    refused: bool,
}

impl Role {
    fn new(name: &'static str, thruster: Option<&str>) -> Self {
        Self {
            name,
            thruster: thruster.map(Into::into),
            child: None,
            started: Instant::now(),
            failed_starts: 0,
            refused: false,
        }
    }

    fn start(&mut self, program: &Path, config: Option<&Path>, root: &Path) -> Result<(), UpError> {
        let mut command = Command::new(program);
        command.arg(self.name).arg("--root").arg(root);
        if let Some(config) = config {
            command.arg("--config").arg(config);
        }
        if let Some(thruster) = &self.thruster {
            command.arg("--thruster").arg(thruster);
        }
        if self.name == "servo" {
            command.arg("--join");
        }
        // A group of its own: Ctrl-C on the terminal reaches only the supervisor.
        command.process_group(0);
        // The servo must set its drive to zero when the supervisor dies; the others just end.
        let last = if self.name == "servo" { Signal::TERM } else { Signal::KILL };
        let supervisor = rustix::process::getpid();
        // SAFETY: prctl and getppid are async-signal-safe and allocate nothing.
        unsafe {
            command.pre_exec(move || {
                set_parent_process_death_signal(Some(last))?;
                // The supervisor may have died before the line above.
                if rustix::process::getppid() != Some(supervisor) {
                    return Err(std::io::ErrorKind::Interrupted.into());
                }
                Ok(())
            });
        }
        let child = command
            .spawn()
            .map_err(|error| UpError::System { what: format!("starting {}", self.name), error })?;
        info!(thruster = self.thruster, process = child.id(), "{} started", self.name);
        self.child = Some(child);
        self.started = Instant::now();
        Ok(())
    }

    /// Up for long enough to believe in it; forgets failed starts.
    fn is_up(&self) -> bool {
        self.child.is_some() && self.started.elapsed() >= START
    }

    /// Did it end? Counts a start that failed.
    fn has_died(&mut self) -> bool {
        let Some(child) = &mut self.child else { return true };
        let Ok(Some(status)) = child.try_wait() else {
            if self.is_up() {
                self.failed_starts = 0;
            }
            return false;
        };
        // Killed from outside is no failed start: whoever killed it may do so at any instant.
        let killed = status.signal() == Some(Signal::KILL.as_raw());
        self.failed_starts = if killed || self.is_up() { 0 } else { self.failed_starts + 1 };
        // Exit code 2: wrong input, and no restart makes it right.
        self.refused = status.code() == Some(2) && !self.is_up();
        let full = status.signal() == Some(Signal::BUS.as_raw());
        let hint = if full { "\nhint: /dev/shm is full (df /dev/shm)" } else { "" };
        warn!(thruster = self.thruster, "{} ended ({status}){hint}", self.name);
        self.child = None;
        true
    }

    /// Ends it: asks, and kills what does not answer.
    fn end(&mut self) {
        let Some(mut child) = self.child.take() else { return };
        if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, Signal::TERM);
        }
        let end = Instant::now() + STOP_WITHIN;
        while Instant::now() < end {
            if !matches!(child.try_wait(), Ok(None)) {
                return;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        warn!(thruster = self.thruster, "{} does not end, killed", self.name);
        let _ = child.kill();
        let _ = child.wait();
    }
}
