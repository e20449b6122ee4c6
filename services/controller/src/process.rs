//! The controller's process: wakes with the servo's telemetry, ticks, sends.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use kort_control::{ControllerConfig, LawKind, ModelError, advise};
use kort_proto::config::{Config, ConfigError, DEFAULT_LAW, Thruster};
use kort_proto::messages::{Answered, Reply, RequestKind, Timing};
use kort_proto::revision;
use kort_proto::transport::{ControllerPorts, Deployment, TransportError, keep_on, monotonic_ns, realtime};
use kort_thruster::rig::Rig;
use thiserror::Error;
use tracing::{info, warn};

use crate::pace::too_slow;
use crate::tick::Tick;
use crate::workshop::Workshop;

/// Telemetry samples read at one wake-up at most.
const SAMPLES: usize = 64;
/// Signals that end the process in good order; a terminal that goes away sends SIGHUP.
const END_SIGNALS: [i32; 3] =
    [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT, signal_hook::consts::SIGHUP];
/// Requests read in one tick at most.
const REQUESTS: usize = 4;

/// Why the controller cannot run.
#[derive(Debug, Error)]
pub enum ControllerError {
    /// The deployment.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The rig description.
    #[error("{file}: {error}")]
    Rig {
        /// The rig's file.
        file: String,
        /// What is wrong with it.
        error: kort_thruster::rig::RigError,
    },
    /// The file of law, observer and estimator.
    #[error("{file}: {error}")]
    Law {
        /// The controller's file.
        file: String,
        /// What is wrong with it.
        error: kort_control::ConfigError,
    },
    /// No controller for this rig.
    #[error("{file}: {error}")]
    Model {
        /// The rig's file.
        file: String,
        /// Why not.
        error: ModelError,
    },
    /// Shared memory.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Signals cannot be watched.
    #[error("signals cannot be watched: {0}")]
    Signals(#[from] std::io::Error),
    /// The workshop's thread cannot be started.
    #[error("a thread cannot be started: {0}")]
    Thread(std::io::Error),
}

/// Could the controller of this thruster start? Reads everything it reads.
///
/// # Errors
/// [`ControllerError`] names file, key, value and what is allowed.
pub fn check(config: &Config, id: &str) -> Result<(), ControllerError> {
    problems(config, id).into_iter().next().map_or(Ok(()), Err)
}

/// Everything that keeps the controller of this thruster from starting; each names file, key, value and what is allowed.
pub fn problems(config: &Config, id: &str) -> Vec<ControllerError> {
    let thruster = match config.thruster(id) {
        Ok(thruster) => thruster,
        Err(error) => return vec![error.into()],
    };
    let mut wrong = Vec::new();
    let rig = match config.rig_text(id, thruster) {
        Ok((file, text)) => match Rig::from_toml_with_all(&text) {
            Ok(rig) => Some((file, rig)),
            Err(errors) => {
                let of_rig = |error| ControllerError::Rig { file: file.clone(), error };
                wrong.extend(errors.into_iter().map(of_rig));
                None
            }
        },
        Err(error) => {
            wrong.push(error.into());
            None
        }
    };
    let of_rig = rig.as_ref().map(|(file, rig)| (file.as_str(), rig));
    let law = law(config, id, thruster, of_rig).map_err(|errors| wrong.extend(errors)).ok();
    if let (Some((file, rig)), Some(law)) = (rig, law) {
        let tick = Tick::new(&rig, &law, thruster.controller_period_ns(), 0);
        wrong.extend(tick.err().map(|error| ControllerError::Model { file, error }));
    }
    wrong
}

/// What is no mistake of this thruster's controller, and hardly as it is meant: it starts, and says so.
pub fn doubtful(config: &Config, id: &str) -> Option<ConfigError> {
    let thruster = config.thruster(id).ok()?;
    let (file, text) = config.rig_text(id, thruster).ok()?;
    let rig = Rig::from_toml(&text).ok()?;
    let law = law(config, id, thruster, Some((&file, &rig))).ok()?;
    too_slow(id, thruster, &rig, &law).map(|words| config.error(words))
}

/// Runs the controller of one thruster until SIGTERM, SIGINT or SIGHUP. `latched` are faults that its predecessor had latched: they outlive it until somebody clears them.
///
/// # Errors
/// [`ControllerError`] if the configuration or shared memory cannot be used.
pub fn run(config: &Config, deployment: &Deployment, id: &str, latched: u64) -> Result<(), ControllerError> {
    let thruster = config.thruster(id)?;
    let (file, text) = config.rig_text(id, thruster)?;
    let rig = Rig::from_toml(&text).map_err(|error| ControllerError::Rig { file: file.clone(), error })?;
    let law = match law(config, id, thruster, Some((&file, &rig))) {
        Ok(law) => law,
        // There is at least one.
        Err(wrong) => return wrong.into_iter().next().map_or(Ok(()), Err),
    };
    if let Some(words) = too_slow(id, thruster, &rig, &law) {
        warn!(thruster = id, "{words}");
    }
    let period_ns = thruster.controller_period_ns();
    let stop = Arc::new(AtomicBool::new(false));
    for signal in END_SIGNALS {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    let _part = deployment.take_part("controller", Some(id))?;
    // Before this thread becomes a real-time one: designing a controller must not keep a tick waiting.
    let workshop = Workshop::start(deployment, id, period_ns).map_err(ControllerError::Thread)?;
    // Behind it too: the workshop runs wherever there is room.
    if let Some(missing) = keep_on(&thruster.controller.cores) {
        warn!(thruster = id, "controller: {missing}");
    }
    if thruster.controller.priority > 0 {
        for missing in realtime(thruster.controller.priority, false) {
            warn!("{missing}");
        }
    }
    let (mut told, mut latched) = (false, latched);
    // Outer loop: a new owner of the shared memory begins a new generation; start afresh in it.
    while !stop.load(Ordering::Relaxed) {
        let generation = match deployment.wait_for_generation(Duration::from_secs(1)) {
            Ok(generation) => generation,
            Err(nothing) => {
                if !std::mem::replace(&mut told, true) {
                    warn!(thruster = id, "waiting: {nothing}");
                }
                continue;
            }
        };
        let Some(mut ports) = join(deployment, id, generation)? else { continue };
        told = false;
        let mut tick = Tick::new(&rig, &law, period_ns, monotonic_ns())
            .map_err(|error| ControllerError::Model { file: file.clone(), error })?
            .with_rise(thruster.controller.setpoint_rise_s)
            .with_latched(latched)
            .with_revision(revision::of(&text));
        info!(
            thruster = id,
            law = law.law.name(),
            rate_hz = 1e9 / period_ns as f64,
            "controller runs, at zero"
        );
        while serve(&mut tick, &mut ports, &workshop, thruster, deployment, &stop) == Left::Aside {
            // Whoever took its place was a younger sender; the servo hears no older one any more.
            drop(ports);
            let Some(again) = join(deployment, id, generation)? else { break };
            ports = again;
            info!(thruster = id, "controller takes its place again, at zero");
        }
        latched = tick.leaves_behind();
    }
    info!(thruster = id, "controller ends, servo stopped");
    Ok(())
}

/// The ports of this generation; none where it is over by now: its owner is gone, or clears it away for the next one.
fn join(
    deployment: &Deployment,
    id: &str,
    generation: u64,
) -> Result<Option<ControllerPorts>, TransportError> {
    match ControllerPorts::open(deployment, id) {
        Ok(ports) => Ok(Some(ports)),
        Err(_) if !deployment.stands(generation) => Ok(None),
        Err(error) => Err(error),
    }
}

/// Law, observer, estimator and options as the deployment says, or everything that is wrong with them; where it takes the
/// default, the one of `kort explain --for` for this rig.
fn law(
    config: &Config,
    id: &str,
    thruster: &Thruster,
    rig: Option<(&str, &Rig)>,
) -> Result<ControllerConfig, Vec<ControllerError>> {
    let keys = &thruster.controller;
    let period_s = thruster.controller_period_ns() as f64 * 1e-9;
    let advised = rig.filter(|_| keys.takes_default()).map(|(file, rig)| {
        let of_rig = |error| vec![ControllerError::Model { file: file.to_owned(), error }];
        advise(rig, period_s).map(|advice| advice.config).map_err(of_rig)
    });
    let advised = advised.transpose()?;
    let mut law = advised.unwrap_or_default();
    if keys.file != Path::new("") {
        let key = format!("thrusters.{id}.controller.file");
        let (file, text) = config.text_of(&key, &keys.file, &[]).map_err(|error| vec![error.into()])?;
        let of_file = |error| ControllerError::Law { file: file.clone(), error };
        law = ControllerConfig::from_toml_with_all(&text)
            .map_err(|wrong| wrong.into_iter().map(of_file).collect::<Vec<_>>())?;
        law.law = advised.map_or(law.law, |advised| advised.law);
    }
    if let Some(name) = keys.law.as_ref().filter(|name| *name != DEFAULT_LAW) {
        law.law = LawKind::from_name(name).ok_or_else(|| {
            let error = config.error(format!(
                "`thrusters.{id}.controller.law` = \"{name}\" is no control law\nhint: known are {}, {DEFAULT_LAW} (what `kort explain --for RIG` names)",
                LawKind::ALL.map(LawKind::name).join(", ")
            ));
            vec![error.into()]
        })?;
    }
    Ok(law)
}

/// Why the loop was left.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Left {
    /// It is told to stop, or the shared memory has a new generation.
    Over,
    /// It stood aside for another commander, who is gone.
    Aside,
}

/// Ticks until told to stop, the shared memory has a new generation, or it has stood aside.
fn serve(
    tick: &mut Tick,
    ports: &mut ControllerPorts,
    workshop: &Workshop,
    thruster: &Thruster,
    deployment: &Deployment,
    stop: &AtomicBool,
) -> Left {
    let period_ns = thruster.controller_period_ns();
    let slack_ns = thruster.servo_period_ns() / 2;
    let mut timing = Timing { period_ns, ..Timing::default() };
    let mut last_ns = monotonic_ns();
    let mut looked_ns = last_ns;
    let mut answered = Answered::default();
    let mut aside = false;
    loop {
        let woken = ports.ticks.wait(Duration::from_nanos(period_ns + slack_ns));
        let woke_ns = monotonic_ns();
        let mut sent_ns = woke_ns;
        for _ in 0..SAMPLES {
            let Some(telemetry) = ports.telemetry.next() else { break };
            tick.take_telemetry(&telemetry, woke_ns);
            sent_ns = telemetry.header.stamp_ns;
        }
        let stopping = stop.load(Ordering::Relaxed);
        let due = woke_ns.saturating_sub(last_ns) + slack_ns >= period_ns;
        if !due && !stopping {
            continue;
        }
        let elapsed = woke_ns.saturating_sub(last_ns);
        timing.overruns += (elapsed + slack_ns).checked_div(period_ns).unwrap_or(1).saturating_sub(1);
        last_ns = woke_ns;
        timing.count(woke_ns.saturating_sub(sent_ns));
        if let Some(setpoint) = ports.setpoint.latest() {
            tick.take_setpoint(&setpoint, woke_ns);
        }
        let mut replies: [Option<Reply>; REQUESTS] = [const { None }; REQUESTS];
        for reply in &mut replies {
            let Some(request) = ports.request.next() else { break };
            *reply = answered.to(&request).or_else(|| match RequestKind::from_u32(request.kind) {
                Some(RequestKind::SetRig) if tick.is_for_now(&request, woke_ns) => workshop.order(request),
                _ => tick.request(&request, woke_ns),
            });
        }
        let fitted = workshop.fit(tick);
        let command = tick.tick(woke_ns);
        let command = if stopping { tick.last_command(command) } else { command };
        let before = std::mem::replace(&mut aside, tick.aside(woke_ns));
        if !aside {
            // What cannot be sent is missed by its reader, who watches for that.
            let _ = ports.command.send(command);
        }
        // Answers come behind the command that follows from what was asked: whoever has one may build on it.
        for reply in replies.into_iter().flatten().chain(fitted) {
            answered.keep(&reply);
            // One that is lost is asked for again.
            let _ = ports.reply.send(reply);
        }
        let mut state = tick.state();
        state.timing = timing;
        let _ = ports.state.send(state);
        timing.busy_ns = monotonic_ns().saturating_sub(woke_ns);
        if stopping {
            return Left::Over;
        }
        if before && !aside {
            return Left::Aside;
        }
        // The servo is silent: perhaps its shared memory has been replaced.
        if !woken && woke_ns.saturating_sub(looked_ns) > 200_000_000 {
            looked_ns = woke_ns;
            if deployment.generation() != Some(ports.generation) {
                return Left::Over;
            }
        }
    }
}
