//! `kort up`: owns the shared memory, runs servo, controller and gateway as child processes,
//! replaces one that dies or hangs, and stops with thrust at zero first.

mod ending;
mod error;
mod inherited;
mod role;
mod scribe;
mod system;
mod watch;

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use signal_hook::consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM};

use kort_proto::config::Config;
use kort_proto::events::{Event, EventKind, EventLog};
use kort_proto::transport::{Deployment, Owner, Restarts, Watched};
use tracing::warn;

pub use error::UpError;
use role::Role;
use scribe::Scribe;
use watch::Watch;

/// How often children are looked at.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Failed starts in a row after which the shared memory is created afresh.
const STARTS_PER_GENERATION: u32 = 3;
/// Fresh generations without a proper start after which `up` gives up.
const GENERATIONS: u32 = 3;
/// A look that comes later than this: the whole machine stood still, and nobody is to blame.
const STOOD_STILL: Duration = Duration::from_millis(500);
/// How things stand is written down this often while a drive is armed: a service that is killed as a whole tells its
/// successor by that when it was stopped, and at what thrust.
const NOTE_EVERY: Duration = Duration::from_millis(100);
/// Signals that end the service, thrust at zero first, whichever it is: one that just killed it would leave shared memory behind.
const END_SIGNALS: [i32; 4] = [SIGTERM, SIGINT, SIGHUP, SIGQUIT];
/// How long a child may take to end.
const STOP_WITHIN: Duration = Duration::from_secs(2);

/// Runs the deployment until SIGINT, SIGTERM, SIGHUP or SIGQUIT.
///
/// # Errors
/// [`UpError`] if it cannot start, or a child does not stay up.
pub fn run(config: &Config, deployment: &Deployment) -> Result<(), UpError> {
    let system = |what: &str| {
        let what = what.to_owned();
        move |error| UpError::System { what, error }
    };
    let gateway = kort_gateway::Settings::new(config)?;
    kort_servo::check(config)?;
    for id in config.thrusters.keys() {
        kort_controller::check(config, id)?;
    }
    let stop = Arc::new(AtomicBool::new(false));
    for signal in END_SIGNALS {
        signal_hook::flag::register(signal, Arc::clone(&stop))
            .map_err(system("signals cannot be watched"))?;
    }
    let owner = deployment.own()?;
    // Its children take their parts themselves; that a lone process plays one is said before any of them starts.
    deployment.take_part("gateway", None)?;
    for (id, role) in config.thrusters.keys().flat_map(|id| [(id, "servo"), (id, "controller")]) {
        deployment.take_part(role, Some(id))?;
    }
    kort_gateway::check(&gateway)?;
    let log = EventLog::open(&gateway.events).map_err(system("the event log"))?;
    let scribe = Scribe::start(log.clone(), deployment.watched_file()).map_err(system("a thread"))?;
    let program = std::env::current_exe().map_err(system("this program's own path"))?;
    let mut service = Service::new(config, owner, scribe, program);
    service.begin(&log)?;
    let file = config.file.as_ref().map_or_else(
        || "as built in; --config FILE takes another, config/kort.toml is found by itself".to_owned(),
        |file| file.display().to_string(),
    );
    let address = gateway.address();
    // Not println!: stdout on a full disk is no reason to end.
    let _ = write!(
        std::io::stdout(),
        "config   {file}\nconsole  {address}/\nAPI      {address}/v1/thrusters   (described at /docs)\n\
         Ctrl-C stops all, thrust at zero first\n"
    );
    let result = service.watch_until(&stop);
    system::stopping();
    result.and(service.end())
}

/// Everything under the supervisor.
struct Service {
    owner: Owner,
    scribe: Scribe,
    program: PathBuf,
    config: Option<PathBuf>,
    ids: Vec<String>,
    roles: Vec<Role>,
    watches: Vec<Watch>,
    written: Watched,
    written_at: Instant,
    generations: u32,
    /// The present one.
    generation: Option<u64>,
}

impl Service {
    fn new(config: &Config, owner: Owner, scribe: Scribe, program: PathBuf) -> Self {
        let before = Watched::read(&owner.deployment().watched_file());
        let ids: Vec<String> = config.thrusters.keys().cloned().collect();
        let watches =
            ids.iter().map(|id| Watch::new(id, before.thrusters.get(id).cloned().unwrap_or_default()));
        let roles = ids
            .iter()
            .flat_map(|id| [Role::new("servo", Some(id)), Role::new("controller", Some(id))])
            .chain([Role::new("gateway", None)]);
        Self {
            watches: watches.collect(),
            roles: roles.collect(),
            owner,
            scribe,
            program,
            config: config.file.clone(),
            ids,
            written: Watched::default(),
            written_at: Instant::now(),
            generations: 0,
            generation: None,
        }
    }

    /// Creates the shared memory and starts every process.
    fn begin(&mut self, log: &EventLog) -> Result<(), UpError> {
        let ids: Vec<&str> = self.ids.iter().map(String::as_str).collect();
        self.generation = Some(self.owner.create(&ids)?);
        inherited::tell(self.watches.iter().map(|watch| (watch.id(), &watch.stood)), log);
        for watch in &mut self.watches {
            if watch.stood.armed {
                let words = format!("the service ended while {} was armed, at {}", watch.id(), watch.words());
                warn!("{words}");
                let event = Event::now(EventKind::ProcessEnded, Some(watch.id()), "supervisor", words);
                let (since, before) = (watch.stood.heard.clone(), watch.driven_till_now());
                self.scribe.event(Event { since, before, ..event });
            }
            watch.servo_ended();
        }
        // Before the gateway looks there for what stands latched.
        self.write_down();
        (0..self.roles.len()).try_for_each(|at| self.start(at))
    }

    /// Starts one process, with what its predecessor left.
    fn start(&mut self, at: usize) -> Result<(), UpError> {
        let Some(role) = self.roles.get_mut(at) else { return Ok(()) };
        let of_role = self.watches.iter_mut().find(|watch| role.thruster.as_deref() == Some(watch.id()));
        let heritage = of_role.map(|watch| watch.heritage(role.name)).unwrap_or_default();
        role.start(&self.program, self.config.as_deref(), self.owner.deployment().root(), heritage)?;
        let (name, thruster) = (role.name, role.thruster.clone());
        let words = format!("{name} started");
        self.scribe.event(Event::now(EventKind::ProcessStarted, thruster.as_deref(), "supervisor", words));
        Ok(())
    }

    /// Watches and replaces until told to stop.
    fn watch_until(&mut self, stop: &AtomicBool) -> Result<(), UpError> {
        let mut looked = Instant::now();
        let mut system = system::System::new();
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(LOOK_EVERY);
            if looked.elapsed() > STOOD_STILL {
                self.roles.iter_mut().for_each(Role::excuse);
            }
            looked = Instant::now();
            self.hear();
            self.end_the_hung();
            let ended = self.find_the_ended();
            if let Some(role) = self.roles.iter().find(|role| role.refused) {
                return Err(UpError::Refused { name: role.name.to_owned() });
            }
            if ended {
                // What the dead held in shared memory is freed before anyone takes their place.
                self.owner.clear_up_after_the_dead();
            }
            self.replace()?;
            self.write_down();
            system.look(self.roles.iter().all(Role::is_up));
        }
        Ok(())
    }

    /// Reads what the processes sent.
    fn hear(&mut self) {
        for watch in &mut self.watches {
            let beats = watch.look(self.owner.deployment());
            for role in &mut self.roles {
                let mine = role.thruster.as_deref().is_none_or(|id| id == watch.id());
                let beat = match role.name {
                    "servo" => beats.servo,
                    "controller" => beats.controller,
                    _ => beats.gateway,
                };
                if mine && beat {
                    role.heard();
                }
            }
        }
    }

    /// A process that does not beat any more is ended; it is replaced like any other that ended.
    fn end_the_hung(&mut self) {
        for role in &mut self.roles {
            let Some(silent) = role.hangs() else { continue };
            let words = format!("{} did not beat for {} s, ended", role.name, silent.as_secs());
            warn!(thruster = role.thruster, "{words}");
            self.scribe.event(Event::now(
                EventKind::ProcessHung,
                role.thruster.as_deref(),
                "supervisor",
                words,
            ));
            role.kill();
            // Told once: it is gone at one of the next looks.
            role.excuse();
        }
    }

    /// Notes who ended, and what its thrusters did just before.
    fn find_the_ended(&mut self) -> bool {
        let mut any = false;
        for role in &mut self.roles {
            let Some(ended) = role.look() else { continue };
            any = true;
            let words = format!("{} ended: {}", role.name, ended.why);
            let mut told = false;
            for watch in &mut self.watches {
                if role.thruster.as_deref().is_some_and(|id| id != watch.id()) {
                    continue;
                }
                // The last samples still lie in shared memory.
                watch.look(self.owner.deployment());
                if let Some(before) = watch.driven_till_now() {
                    let words = format!("{words}, while armed");
                    let event = Event::now(EventKind::ProcessEnded, Some(watch.id()), "supervisor", words);
                    self.scribe.event(event.before(before));
                    told = true;
                }
            }
            if !told {
                let thruster = role.thruster.as_deref();
                self.scribe.event(Event::now(EventKind::ProcessEnded, thruster, "supervisor", words));
            }
        }
        any
    }

    /// Starts anew whoever is away and due.
    fn replace(&mut self) -> Result<(), UpError> {
        if self.roles.iter().all(Role::is_up) {
            self.generations = 0;
        }
        if let Some(spent) = self.roles.iter().find(|role| role.failed_starts >= STARTS_PER_GENERATION) {
            if let Err(full) = self.owner.has_room(self.ids.len()) {
                // Room comes back, and afresh there would be no more of it: those that run go on.
                warn!("{} failed to start {STARTS_PER_GENERATION} times: {full}", spent.name);
                self.roles.iter_mut().for_each(|role| role.failed_starts = 0);
                return Ok(());
            }
            self.generations += 1;
            if self.generations > GENERATIONS {
                return Err(UpError::DoesNotStart { name: spent.name.to_owned() });
            }
            warn!(
                "{} failed to start {STARTS_PER_GENERATION} times: creating the shared memory afresh",
                spent.name
            );
            for role in &mut self.roles {
                role.end();
                role.failed_starts = 0;
                role.restarts += 1;
            }
            let ids: Vec<&str> = self.ids.iter().map(String::as_str).collect();
            self.generation = Some(self.owner.create(&ids)?);
            return (0..self.roles.len()).try_for_each(|at| self.start(at));
        }
        for at in 0..self.roles.len() {
            if !self.roles[at].due() {
                continue;
            }
            self.roles[at].restarts += 1;
            self.start(at)?;
        }
        Ok(())
    }

    /// Notes how things stand where that changed, and again and again while a drive is armed.
    fn write_down(&mut self) {
        let restarts = self.roles.iter().map(|role| Restarts {
            process: role.name.to_owned(),
            thruster: role.thruster.clone(),
            count: role.restarts,
            pid: role.child.as_ref().map(std::process::Child::id),
        });
        let stood = self.watches.iter().map(|watch| (watch.id().to_owned(), watch.stood.clone()));
        let now =
            Watched { generation: self.generation, restarts: restarts.collect(), thrusters: stood.collect() };
        let key = |watched: &Watched| -> Vec<(bool, u64, u64)> {
            watched.thrusters.values().map(|s| (s.armed, s.servo_faults, s.controller_faults)).collect()
        };
        let armed = now.thrusters.values().any(|stood| stood.armed);
        let changed = now.restarts != self.written.restarts || key(&now) != key(&self.written);
        if changed || (armed && self.written_at.elapsed() >= NOTE_EVERY) {
            self.written_at = Instant::now();
            self.written = now.clone();
            self.scribe.watched(now);
        }
    }
}
