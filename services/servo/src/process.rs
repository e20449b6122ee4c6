//! The servo's process: clock, real-time scheduling, shared memory around the pure tick.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::{Answered, Request, Trip};
use kort_proto::transport::{
    Deployment, ServoPorts, Ticker, TransportError, keep_on, monotonic_ns, ordinary, realtime,
};
use kort_thruster::rig::Rig;
use thiserror::Error;
use tracing::{info, warn};

use crate::claims::{Claim, Taken, doubles};
use crate::devices::{At, Devices};
use crate::drives;
use crate::sensors;
use crate::settings::Settings;
use crate::tick::{Inputs, Servo};

/// Most requests read in one tick; the rest waits.
const REQUESTS_PER_TICK: usize = 4;

/// Signals that end the process in good order; a terminal that goes away sends SIGHUP.
const END_SIGNALS: [i32; 3] =
    [signal_hook::consts::SIGTERM, signal_hook::consts::SIGINT, signal_hook::consts::SIGHUP];

/// What a servo takes over from the one before it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Inherited {
    /// Faults it had latched, and the one that its end is; bits of `Fault`.
    pub latched: u64,
    /// The stop that ended it.
    pub tripped: Trip,
}

/// Why the servo cannot run.
#[derive(Debug, Error)]
pub enum ServoError {
    /// The configuration.
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
    /// Shared memory.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// No thread or descriptor for a device.
    #[error("a device cannot be served: {0}")]
    Device(std::io::Error),
    /// Signals cannot be watched.
    #[error("signals cannot be watched: {0}")]
    Signals(#[from] std::io::Error),
}

/// Could the servos of this deployment start? Reads everything they read.
///
/// # Errors
/// [`ServoError`] names file, key, value and what is allowed.
pub fn check(config: &Config) -> Result<(), ServoError> {
    problems(config).into_iter().next().map_or(Ok(()), Err)
}

/// Everything that keeps a servo of this deployment from starting; each names file, key, value and what is allowed.
pub fn problems(config: &Config) -> Vec<ServoError> {
    let (mut wrong, mut taken) = (Vec::new(), Vec::new());
    for id in config.thrusters.keys() {
        wrong.extend(of_one(config, id, &mut taken));
    }
    wrong.extend(doubles(config, &taken).into_iter().map(|double| double.error.into()));
    wrong
}

/// Everything that keeps the servo of this thruster from starting; what it takes is left in `taken`.
fn of_one(config: &Config, id: &str, taken: &mut Vec<Taken>) -> Vec<ServoError> {
    let (thruster, file, text) = match rig_of(config, id) {
        Ok(there) => there,
        Err(error) => return vec![error.into()],
    };
    let of_rig = |error| ServoError::Rig { file: file.clone(), error };
    let rig = match Rig::from_toml_with_all(&text) {
        Ok(rig) => rig,
        Err(errors) => return errors.into_iter().map(of_rig).collect(),
    };
    let mut wrong = Vec::new();
    let settings = Settings::read(config, id, thruster, &rig, &mut wrong);
    // A value that is told already is not told again as missing.
    if let Some(error) = settings.err().filter(|error| !wrong.contains(error)) {
        wrong.push(error);
    }
    let drive = drives::choose(config, id, thruster, &rig);
    let sensors = sensors::choose(config, id, thruster, &rig);
    takes(id, drive.as_ref().ok(), sensors.as_deref().unwrap_or_default(), taken);
    wrong.extend(drive.err());
    wrong.extend(sensors.err());
    wrong.into_iter().map(Into::into).collect()
}

/// The thruster, and file and text of its rig description.
fn rig_of<'a>(config: &'a Config, id: &str) -> Result<(&'a Thruster, String, String), ConfigError> {
    let thruster = config.thruster(id)?;
    let (file, text) = config.rig_text(id, thruster)?;
    Ok((thruster, file, text))
}

/// Adds what the devices of a thruster take.
fn takes(id: &str, drive: Option<&drives::Chosen>, sensors: &[sensors::Chosen], taken: &mut Vec<Taken>) {
    let mut add = |section: String, claims: Vec<Claim>| {
        let section = format!("thrusters.{id}.{section}");
        let one = |claim| Taken { id: id.to_owned(), section: section.clone(), claim };
        taken.extend(claims.into_iter().map(one));
    };
    if let Some(drive) = drive {
        add("drive".into(), drive.claims());
    }
    for sensor in sensors {
        add(format!("sensors.{}", sensor.name), sensor.claims());
    }
}

/// All that the configuration says of the thruster's servo; nothing is opened yet.
fn read(config: &Config, id: &str) -> Result<(Settings, drives::Chosen, Vec<sensors::Chosen>), ServoError> {
    let (thruster, file, text) = rig_of(config, id)?;
    let rig = Rig::from_toml(&text).map_err(|error| ServoError::Rig { file, error })?;
    let settings = Settings::new(config, id, thruster, &rig)?;
    let (drive, sensors) =
        (drives::choose(config, id, thruster, &rig)?, sensors::choose(config, id, thruster, &rig)?);
    takes_its_own(config, id, &drive, &sensors)?;
    Ok((settings, drive, sensors))
}

/// Refuses a thruster that takes what another one of the deployment takes, or takes something twice. Another one that cannot be read
/// is no hindrance to this one.
fn takes_its_own(
    config: &Config,
    id: &str,
    drive: &drives::Chosen,
    sensors: &[sensors::Chosen],
) -> Result<(), ConfigError> {
    let mut taken = Vec::new();
    takes(id, Some(drive), sensors, &mut taken);
    if taken.is_empty() {
        return Ok(());
    }
    taken.clear();
    for id in config.thrusters.keys() {
        of_one(config, id, &mut taken);
    }
    let double = doubles(config, &taken).into_iter().find(|double| double.ids.iter().any(|of| of == id));
    double.map_or(Ok(()), |double| Err(double.error))
}

/// Runs the servo of one thruster until SIGTERM, SIGINT or SIGHUP. With `join` another process owns the
/// shared memory, the supervisor that started this one; without, this one creates it.
///
/// # Errors
/// [`ServoError`] before the loop starts; the loop itself only ends by a signal.
pub fn run(
    config: &Config,
    deployment: &Deployment,
    id: &str,
    join: bool,
    inherited: Inherited,
) -> Result<(), ServoError> {
    let (settings, drive, sensors) = read(config, id)?;
    let thruster = config.thruster(id)?;
    let priority = thruster.servo.priority;
    let stop = Arc::new(AtomicBool::new(false));
    for signal in END_SIGNALS {
        signal_hook::flag::register(signal, Arc::clone(&stop))?;
    }
    // Held by the kernel for as long as this process lives: nothing of the loop knows of it.
    let _part = deployment.take_part("servo", Some(id))?;
    let owner = if join { None } else { Some(own(config, deployment, &stop)?) };
    deployment.wait_for_generation(Duration::from_secs(10))?;
    let mut ports = ServoPorts::open(deployment, id)?;
    if let Some(missing) = keep_on(&thruster.servo.cores) {
        warn!(thruster = id, "servo: {missing}");
    }
    if priority > 0 {
        for missing in realtime(priority, true) {
            warn!("{missing}");
        }
    }
    info!(
        thruster = id,
        rate_hz = thruster.servo.rate_hz,
        amplifier = thruster.amplifier,
        "servo runs, disarmed"
    );
    let mut devices = Devices::start(drive, sensors, id, priority).map_err(ServoError::Device)?;
    let life_ns = devices.reading_life_ns();
    let settings = settings.with_reading_life(life_ns);
    let servo = Servo::new(settings, monotonic_ns()).with_latched(inherited.latched, inherited.tripped);
    tick_until_stopped(servo, &mut devices, &mut ports, settings.period_ns, &stop);
    info!(thruster = id, "servo ends, drive off");
    drop(ports);
    if let Some(owner) = owner {
        let _ = owner.join();
    }
    Ok(())
}

/// The loop. From here on nothing of ours allocates, waits for another process or panics.
fn tick_until_stopped(
    mut servo: Servo,
    devices: &mut Devices,
    ports: &mut ServoPorts,
    period_ns: u64,
    stop: &AtomicBool,
) {
    let mut ticker = Ticker::new(period_ns);
    let life_ns = devices.reading_life_ns();
    let mut answered = Answered::default();
    loop {
        let (deadline_ns, missed) = ticker.wait();
        let woke_ns = monotonic_ns();
        let ending = stop.load(Ordering::Relaxed);
        if ending {
            servo.end();
        }
        let shown = devices.show(At { now_ns: woke_ns, ticks: 1 + missed });
        // Requests are fetched first and acted upon last: by then every command is here that was sent before them.
        let requests: [Option<Request>; REQUESTS_PER_TICK] = std::array::from_fn(|_| ports.request.next());
        if let Some(command) = ports.command.latest() {
            servo.take_command(&command, woke_ns);
        }
        let inputs =
            Inputs { now_ns: woke_ns, ticks: 1 + missed, measured: &shown.signals, devices: shown.faults };
        for request in requests.iter().flatten() {
            if let Some(reply) = answered.to(request).or_else(|| servo.request(request, woke_ns)) {
                answered.keep(&reply);
                // One that is lost is asked for again.
                let _ = ports.reply.send(reply);
            }
        }
        devices.drive(woke_ns, servo.tick(&inputs));
        let mut telemetry = servo.telemetry(deadline_ns, &shown.signals);
        telemetry.shaft_age_ns = shown.shaft_age_ns;
        telemetry.shaft_life_ns = life_ns;
        telemetry.timing = ticker.timing;
        // A sample that cannot be sent is missed by its readers, who watch for that.
        let _ = ports.telemetry.send(telemetry);
        ports.waker.wake();
        ticker.worked(woke_ns);
        if ending {
            devices.drive(woke_ns, None);
            return;
        }
    }
}

/// Owns the shared memory on a thread of its own: clearing up after dead peers takes tens of
/// milliseconds.
fn own(
    config: &Config,
    deployment: &Deployment,
    stop: &Arc<AtomicBool>,
) -> Result<std::thread::JoinHandle<()>, ServoError> {
    let ids: Vec<String> = config.thrusters.keys().cloned().collect();
    let (deployment, stop) = (deployment.clone(), Arc::clone(stop));
    let (tell, told) = std::sync::mpsc::channel();
    let thread = std::thread::Builder::new().name("owner".into()).spawn(move || {
        ordinary();
        let created = deployment.own().and_then(|mut owner| {
            owner.create(&ids.iter().map(String::as_str).collect::<Vec<_>>())?;
            Ok(owner)
        });
        let owner = match created {
            Ok(owner) => {
                let _ = tell.send(Ok(()));
                owner
            }
            Err(e) => {
                let _ = tell.send(Err(e));
                return;
            }
        };
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(Duration::from_millis(200));
            owner.clear_up_after_the_dead();
        }
    })?;
    match told.recv() {
        Ok(created) => created?,
        Err(_) => return Err(ServoError::Signals(std::io::Error::other("the owner's thread ended"))),
    }
    Ok(thread)
}

#[cfg(test)]
mod tests;
