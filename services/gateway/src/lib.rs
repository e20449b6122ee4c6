//! The gateway: REST, WebSocket, recordings, metrics and the operator's console, on one port.
//!
//! One thread ([`bus`]) talks to shared memory; a recording has a thread of its own; everything else
//! is async. Nothing here is trusted by the controller: it goes to zero when the gateway falls silent.

#![expect(
    clippy::result_large_err,
    reason = "a problem is made at most once a request; a box would only add a step"
)]

mod analysis;
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

use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use axum::body::Bytes;
use kort_control::ControllerConfig;
use kort_proto::config::Config;
use kort_proto::transport::{Deployment, Watched};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use utoipa::openapi::OpenApi;

use analysis::Analyses;
use bus::{Bell, Pulse};
use calibration::Calibrations;
use check::{certificate, tokens};
pub use check::{check, check_config, doubtful, unused_effects};
use connections::Connections;
use durations::Durations;
pub use error::GatewayError;
use events::Events;
use gate::Gate;
use openapi::Document;
use problem::{Kind, Problem};
use record::{Recorder, Subject};
use rig::RigDesk;
use ring::Ring;
use settings::Deployed;
pub use settings::Settings;
use tally::Tally;
use thruster::Thruster;

/// Largest request body, bytes.
const BODY_BYTES_MAX: usize = 16 * 1024;
/// By then a thruster whose gateway is silent is at zero, on a busy machine too.
const RAMPED_WITHIN: Duration = Duration::from_secs(1);

/// Everything the routes share.
#[derive(Debug)]
pub(crate) struct App {
    thrusters: Vec<Arc<Thruster>>,
    rigs: Vec<Arc<RigDesk>>,
    controllers: Vec<ControllerConfig>,
    rings: Vec<Ring>,
    analyses: Arc<Analyses>,
    calibrations: Arc<Calibrations>,
    tallies: Vec<Arc<Tally>>,
    recorder: Arc<Recorder>,
    events: Arc<Events>,
    gate: Gate,
    connections: Arc<Connections>,
    streams: Streams,
    address: String,
    disks: [PathBuf; 2],
    watched: PathBuf,
    answers: [AtomicU64; 4],
    durations: Durations,
    stopping: watch::Receiver<bool>,
    document: OnceLock<Document>,
    patterns: OnceLock<Vec<String>>,
}

impl App {
    fn thrusters(&self) -> &[Arc<Thruster>] {
        &self.thrusters
    }

    fn thruster(&self, id: &str) -> Result<&Arc<Thruster>, Problem> {
        self.thrusters.iter().find(|thruster| thruster.id == id).ok_or_else(|| {
            Problem::new(Kind::UnknownThruster, format!("there is no thruster {id:?}"))
                .hint("GET /v1/thrusters lists them")
                .allowed(self.thrusters.iter().map(|thruster| thruster.id.clone()))
        })
    }

    /// What a recording of this thruster holds.
    fn subject(&self, id: &str) -> Result<Subject, Problem> {
        Ok(Subject { thruster: Arc::clone(self.thruster(id)?), rig: Arc::clone(self.rig(id)?) })
    }

    /// The rig description of this thruster.
    fn rig(&self, id: &str) -> Result<&Arc<RigDesk>, Problem> {
        Ok(&self.rigs[self.place(id)?])
    }

    /// Its controller as the deployment states it.
    fn stated_controller(&self, id: &str) -> Result<&ControllerConfig, Problem> {
        Ok(&self.controllers[self.place(id)?])
    }

    /// The last minutes of this thruster.
    fn ring(&self, id: &str) -> Result<&Ring, Problem> {
        Ok(&self.rings[self.place(id)?])
    }

    /// Its place among all: each has one rig, one ring and one tally.
    fn place(&self, id: &str) -> Result<usize, Problem> {
        let thruster = self.thruster(id)?;
        Ok(self.thrusters.iter().position(|other| Arc::ptr_eq(other, thruster)).unwrap_or_default())
    }

    fn analyses(&self) -> &Arc<Analyses> {
        &self.analyses
    }

    fn calibrations(&self) -> &Arc<Calibrations> {
        &self.calibrations
    }

    fn tallies(&self) -> &[Arc<Tally>] {
        &self.tallies
    }

    fn recorder(&self) -> &Arc<Recorder> {
        &self.recorder
    }

    fn events(&self) -> &Events {
        &self.events
    }

    fn gate(&self) -> &Gate {
        &self.gate
    }

    fn connections(&self) -> &Connections {
        &self.connections
    }

    /// The pattern of the route a path belongs to; `other` for what no route has.
    fn pattern(&self, path: &str) -> &str {
        let matches = |pattern: &str| {
            let (mut theirs, mut ours) = (path.split('/'), pattern.split('/'));
            loop {
                match (theirs.next(), ours.next()) {
                    (None, None) => return true,
                    (Some(part), Some(of)) if part == of || (of.starts_with('{') && !part.is_empty()) => (),
                    _ => return false,
                }
            }
        };
        let patterns = self.patterns.get().map_or(&[][..], Vec::as_slice);
        patterns.iter().map(String::as_str).find(|pattern| matches(pattern)).unwrap_or("other")
    }

    /// Scheme and address listened on.
    fn address(&self) -> &str {
        &self.address
    }

    /// Free and whole size of the disks that are written to, bytes, by what is written there.
    fn disks(&self) -> impl Iterator<Item = (&'static str, f64, f64)> {
        ["recordings", "events"].into_iter().zip(&self.disks).filter_map(|(what, folder)| {
            let disk = rustix::fs::statvfs(folder).ok()?;
            let block = disk.f_frsize as f64;
            Some((what, disk.f_bavail as f64 * block, disk.f_blocks as f64 * block))
        })
    }

    fn durations(&self) -> &Durations {
        &self.durations
    }

    fn streams(&self) -> &Streams {
        &self.streams
    }

    /// What the supervisor notes beside the shared memory.
    fn watched(&self) -> Watched {
        Watched::read(&self.watched)
    }

    fn stopping(&self) -> watch::Receiver<bool> {
        self.stopping.clone()
    }

    /// The OpenAPI document, once the routes are known.
    fn publish(&self, document: OpenApi) {
        let _ = self.patterns.set(document.paths.paths.keys().cloned().collect());
        let _ = self.document.set(Document(document));
    }

    /// The OpenAPI document, with the setpoints that are allowed now.
    fn document(&self) -> Bytes {
        let Some(Document(document)) = self.document.get() else { return Bytes::new() };
        let mut document = document.clone();
        openapi::finish(&mut document, self);
        serde_json::to_vec_pretty(&document).unwrap_or_default().into()
    }

    fn count_answer(&self, status: u16) {
        if let Some(count) =
            (status / 100).checked_sub(2).and_then(|class| self.answers.get(usize::from(class)))
        {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn answers(&self) -> impl Iterator<Item = (&'static str, u64)> {
        ["2xx", "3xx", "4xx", "5xx"]
            .into_iter()
            .zip(self.answers.iter().map(|count| count.load(Ordering::Relaxed)))
    }
}

/// How many streams are open.
#[derive(Debug, Default)]
pub(crate) struct Streams(Arc<AtomicU64>);

impl Streams {
    /// One more, until the guard is dropped.
    fn open(&self) -> StreamGuard {
        self.0.fetch_add(1, Ordering::Relaxed);
        StreamGuard(Arc::clone(&self.0))
    }

    fn count(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// Counts as an open stream for as long as it lives.
pub(crate) struct StreamGuard(Arc<AtomicU64>);

impl Drop for StreamGuard {
    fn drop(&mut self) {
        self.0.fetch_sub(1, Ordering::Relaxed);
    }
}

/// Serves until SIGINT, SIGTERM or SIGHUP; then commands nothing any more, sees what is armed come to zero, closes running
/// recordings and returns.
///
/// # Errors
/// If the address or the folder of the recordings cannot be used.
pub fn run(config: &Config, deployment: &Deployment) -> Result<(), GatewayError> {
    let settings = Settings::new(config)?;
    let thrusters = settings::thrusters(config)?;
    if let Some(words) = doubtful(config) {
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
        connections: Arc::clone(&connections),
        streams: Streams::default(),
        address: settings.address(),
        disks: [settings.recordings.clone(), settings.events.clone()],
        watched: deployment.watched_file(),
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
    events.settle();
    Ok(())
}
