//! The gateway: REST, WebSocket, recordings, metrics and the operator's console, on one port.
//!
//! One thread ([`bus`]) talks to shared memory; a recording has a thread of its own; everything else
//! is async. Nothing here is trusted by the controller: it goes to zero when the gateway falls silent.

#![expect(
    clippy::result_large_err,
    reason = "a problem is made at most once a request; a box would only add a step"
)]

mod analysis;
mod app;
pub mod bodies;
mod bus;
mod calibration;
mod check;
mod connections;
mod desk;
mod durations;
mod energy;
mod error;
mod estimates;
mod events;
mod excitation;
mod extract;
#[cfg(feature = "foxglove")]
mod foxglove;
mod gate;
mod heard;
mod hosts;
mod lease;
mod openapi;
mod problem;
mod process;
mod record;
mod rig;
mod ring;
mod routes;
mod serve;
mod settings;
mod tally;
mod thin;
mod thruster;
mod tls;
pub mod token;
mod view;
mod windows;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::{Duration, Instant};

use kort_proto::config::Config;
use kort_proto::transport::Deployment;
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;

use analysis::Analyses;
pub(crate) use app::{App, Streams};
use bus::{Bell, Pulse};
use calibration::Calibrations;
use check::{certificate, tokens};
pub use check::{check, check_config, doubtful, unused_effects};
use connections::Connections;
use durations::Durations;
pub use error::GatewayError;
use events::Events;
use gate::Gate;
use record::Recorder;
use rig::RigDesk;
use settings::Deployed;
pub use settings::Settings;
use tally::Tally;
use thruster::Thruster;

/// Largest request body, bytes.
const BODY_BYTES_MAX: usize = 16 * 1024;
/// By then a thruster whose gateway is silent is at zero, on a busy machine too.
const RAMPED_WITHIN: Duration = Duration::from_secs(1);

/// Serves until SIGINT, SIGTERM or SIGHUP; then commands nothing any more, sees what is armed come to zero, closes running
/// recordings and returns.
///
/// # Errors
/// If the address or the folder of the recordings cannot be used.
pub fn run(config: &Config, deployment: &Deployment) -> Result<(), GatewayError> {
    let settings = Settings::new(config)?;
    let thrusters = settings::thrusters(config)?;
    let _part = deployment.take_part("gateway", None)?;
    for words in doubtful(config) {
        tracing::warn!("{words}");
    }
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?.block_on(serve(
        config,
        settings,
        thrusters,
        deployment.clone(),
    ))
}

/// Waits a moment for the first word of every servo. Whoever asks a gateway that has just started waits for it too, and is
/// not told of a drive at full thrust that it is disarmed.
async fn heard_once(app: &App) {
    let began = std::time::Instant::now();
    while began.elapsed() < heard::AWAY_AFTER
        && app.thrusters().iter().any(|thruster| thruster.heard().servo.is_none())
    {
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
}

/// Waits for the ramp to zero that a gateway's silence leads to, so that recordings and events hold it.
async fn disarmed_by_its_controller(app: &App) {
    let began = std::time::Instant::now();
    let armed = || app.thrusters().iter().any(|thruster| thruster.heard().armed(std::time::Instant::now()));
    while began.elapsed() < RAMPED_WITHIN && armed() {
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
}

async fn serve(
    config: &Config,
    settings: Settings,
    thrusters: Vec<Deployed>,
    deployment: Deployment,
) -> Result<(), GatewayError> {
    let bind = settings.bind;
    let listener = serve::listen(bind).map_err(|error| GatewayError::Bind { bind, error })?;
    check::ours(&settings)?;
    let certificate = certificate(&settings)?;
    let gate = Gate::new(bind, &settings.hosts, tokens(&settings)?, settings.asks_for_tokens());
    let connections = Arc::new(Connections::new(serve::caps(settings.behind_tls_proxy)));
    let recorder = Recorder::open(&settings.recordings, settings.recording)
        .map_err(|error| GatewayError::Recordings { folder: settings.recordings.clone(), error })?;
    let recorder = Arc::new(recorder);
    let events = Events::start(&settings.events, Arc::clone(&recorder))
        .map_err(|error| GatewayError::Events { folder: settings.events.clone(), error })?;
    recorder.tell_to(&events);
    let analyses =
        Analyses::open(&settings.diagnoses, &settings.recordings, settings.diagnosis, Arc::clone(&events))
            .map_err(|error| GatewayError::Diagnoses { folder: settings.diagnoses.clone(), error })?;
    let analyses = Arc::new(analyses);
    let calibrations =
        Calibrations::open(&settings.calibrations, config, &deployment, Arc::clone(&events))
            .map_err(|error| GatewayError::Calibrations { folder: settings.calibrations.clone(), error })?;
    let calibrations = Arc::new(calibrations);
    let (stop_streams, stopping) = watch::channel(false);

    let mut app = App {
        thrusters: Vec::new(),
        rigs: Vec::new(),
        controllers: Vec::new(),
        rings: Vec::new(),
        analyses: Arc::clone(&analyses),
        calibrations: Arc::clone(&calibrations),
        tallies: Vec::new(),
        recorder: Arc::clone(&recorder),
        events: Arc::clone(&events),
        gate,
        certificate: certificate.clone(),
        connections: Arc::clone(&connections),
        streams: Streams::default(),
        address: settings.address(),
        disks: [settings.recordings.clone(), settings.events.clone()],
        deployment: deployment.clone(),
        answers: Default::default(),
        durations: Durations::default(),
        stopping: stopping.clone(),
        document: OnceLock::new(),
        patterns: OnceLock::new(),
    };
    let bell = Arc::new(Bell::default());
    let mut links = Vec::new();
    for deployed in thrusters {
        let Deployed { id, range, heartbeat, servo_silence, .. } = &deployed;
        let (thruster, asks) = Thruster::new(
            id,
            *range,
            heard::Heard::new(*servo_silence, *heartbeat),
            Arc::clone(&bell),
            Arc::clone(&events),
        );
        app.controllers.push(deployed.controller);
        let (thruster, tally, heartbeat) = (Arc::new(thruster), Arc::new(Tally::new()), *heartbeat);
        let rig = RigDesk::open(
            &settings.rigs,
            Arc::clone(&thruster),
            Arc::clone(&tally),
            deployment.clone(),
            deployed,
        )
        .map_err(|error| GatewayError::Rigs { folder: settings.rigs.clone(), error })?;
        app.rigs.push(Arc::new(rig));
        let (feed, ring) = ring::start(&settings.diagnosis)?;
        app.rings.push(ring);
        app.thrusters.push(Arc::clone(&thruster));
        app.tallies.push(Arc::clone(&tally));
        let events = Arc::clone(&events);
        links.push(bus::Link { thruster, tally, asks, heartbeat, events, ring: feed });
    }
    let app = Arc::new(app);
    for rig in &app.rigs {
        tokio::spawn(Arc::clone(rig).keep_in_force());
    }
    for thruster in &app.thrusters {
        tokio::spawn(Arc::clone(thruster).keep_law());
    }

    #[cfg(feature = "foxglove")]
    if let Some(bind) = settings.foxglove {
        let listener = tokio::net::TcpListener::bind(bind);
        // Somebody took the port since the start: thrust is no less safe without it.
        match listener.await.map_err(|error| GatewayError::Foxglove { bind, error }) {
            Ok(listener) => {
                tracing::info!("for Foxglove: ws://{bind}");
                tokio::spawn(foxglove::serve(Arc::clone(&app), listener));
            }
            Err(error) => tracing::warn!("{error}"),
        }
    }

    let stop_bus = Arc::new(AtomicBool::new(false));
    let pulse = Arc::new(Pulse::new());
    let bus = {
        let (recorder, pulse, stop) = (Arc::clone(&recorder), Arc::clone(&pulse), Arc::clone(&stop_bus));
        std::thread::Builder::new()
            .name("bus".into())
            .spawn(move || bus::run(&deployment, links, &recorder, &pulse, &bell, &stop))?
    };

    let beating = Arc::clone(&pulse);
    tokio::spawn(async move {
        let mut beat = tokio::time::interval(Pulse::EVERY);
        loop {
            beat.tick().await;
            beating.beat();
        }
    });

    let looking = Arc::clone(&app);
    tokio::spawn(async move {
        // A lease outlives its token by no more than a stream does.
        let mut look = tokio::time::interval(Duration::from_secs(1));
        loop {
            look.tick().await;
            let gate = looking.gate();
            for thruster in looking.thrusters() {
                thruster.desk().revoke(|token| gate.commands(token), Instant::now());
            }
        }
    });

    let mut ends = [SignalKind::interrupt(), SignalKind::terminate(), SignalKind::hangup()]
        .map(signal)
        .into_iter()
        .collect::<Result<Vec<_>, _>>()?
        .into_iter();
    let (Some(mut interrupt), Some(mut terminate), Some(mut hangup)) =
        (ends.next(), ends.next(), ends.next())
    else {
        return Err(std::io::Error::other("signals").into());
    };
    // A limit of the files' size fails a write, as a full disk does; it must not end the gateway.
    let _limited = signal(SignalKind::from_raw(rustix::process::Signal::XFSZ.as_raw()))?;
    let scheme = if certificate.is_some() { "https" } else { "http" };
    tracing::info!("listening on {scheme}://{}", listener.local_addr()?);
    let router = routes::router(Arc::clone(&app));
    let port = serve::Port { router, certificate, connections, stopping };
    heard_once(&app).await;
    let serving = tokio::spawn(serve::run(listener, port));
    tokio::select! { _ = interrupt.recv() => (), _ = terminate.recv() => (), _ = hangup.recv() => () }
    // Nobody asked a drive to stop: its controller hears no more of this gateway, and does what it does at any loss of it.
    pulse.end();
    let _ = stop_streams.send(true);
    let _ = serving.await;
    disarmed_by_its_controller(&app).await;
    // Answers under way and close frames get a moment; clients that keep their connection do not keep the gateway.
    for _ in 0..50 {
        if app.connections().counts().0 == 0 {
            break;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    }
    analyses.stop();
    calibrations.stop();
    recorder.stop_all();
    stop_bus.store(true, Ordering::Relaxed);
    let _ = bus.join();
    events.settle().await;
    Ok(())
}
