//! The gateway: REST, WebSocket, recordings, metrics and the operator's console, on one port.
//!
//! One thread ([`bus`]) talks to shared memory; a recording has a thread of its own; everything else
//! is async. Nothing here is trusted by the controller: it goes to zero when the gateway falls silent.

#![expect(
    clippy::result_large_err,
    reason = "a problem is made at most once a request; a box would only add a step"
)]

mod bus;
mod desk;
mod extract;
mod heard;
mod lease;
mod openapi;
mod problem;
mod record;
mod routes;
mod settings;
mod tally;
mod thruster;
mod view;
mod windows;

use std::net::SocketAddr;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use axum::body::Bytes;
use axum::serve::ListenerExt;
use kort_proto::config::{Config, ConfigError};
use kort_proto::transport::Deployment;
use thiserror::Error;
use tokio::net::{TcpListener, TcpStream};
use tokio::signal::unix::{SignalKind, signal};
use tokio::sync::watch;
use utoipa::openapi::OpenApi;

use problem::{Kind, Problem};
use record::Recorder;
use settings::Deployed;
pub use settings::Settings;
use tally::Tally;
use thruster::Thruster;

/// Largest request body, bytes.
const BODY_BYTES_MAX: usize = 16 * 1024;

/// Why the gateway cannot run.
#[derive(Debug, Error)]
pub enum GatewayError {
    /// The address cannot be listened on.
    #[error("gateway.bind = {bind}: {error}\nhint: {}", bind_hint(error))]
    Bind {
        /// The address.
        bind: SocketAddr,
        /// The system's words.
        error: std::io::Error,
    },
    /// The folder of the recordings cannot be used.
    #[error("gateway.recordings = {}: {error}\nhint: name a folder this user can write", folder.display())]
    Recordings {
        /// The folder.
        folder: PathBuf,
        /// The system's words.
        error: std::io::Error,
    },
    /// The configuration cannot be used.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// The system refuses something else.
    #[error("gateway: {0}")]
    System(#[from] std::io::Error),
}

fn bind_hint(error: &std::io::Error) -> &'static str {
    match error.kind() {
        std::io::ErrorKind::AddrInUse => {
            "another program uses it; choose another port with gateway.bind in kort.toml"
        }
        std::io::ErrorKind::PermissionDenied => {
            "ports below 1024 need a right; choose another with gateway.bind in kort.toml"
        }
        _ => "choose an address of this machine with gateway.bind in kort.toml",
    }
}

/// Everything the routes share.
#[derive(Debug)]
pub(crate) struct App {
    thrusters: Vec<Arc<Thruster>>,
    tallies: Vec<Arc<Tally>>,
    recorder: Arc<Recorder>,
    answers: [AtomicU64; 4],
    stopping: watch::Receiver<bool>,
    document: OnceLock<Bytes>,
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

    fn tallies(&self) -> &[Arc<Tally>] {
        &self.tallies
    }

    fn recorder(&self) -> &Arc<Recorder> {
        &self.recorder
    }

    fn stopping(&self) -> watch::Receiver<bool> {
        self.stopping.clone()
    }

    /// The OpenAPI document, once the routes are known.
    fn publish(&self, document: &OpenApi) {
        let _ = self.document.set(serde_json::to_vec_pretty(document).unwrap_or_default().into());
    }

    fn document(&self) -> Bytes {
        self.document.get().cloned().unwrap_or_default()
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

/// States and setpoints are small and urgent: no waiting for more to send.
fn at_once(stream: &mut TcpStream) {
    if let Err(error) = stream.set_nodelay(true) {
        tracing::debug!(%error, "a connection keeps its delay");
    }
}

/// Could a gateway start with this configuration? Says so before anything else is started.
///
/// # Errors
/// If the address is taken or the folder of the recordings cannot be made.
pub fn check(settings: &Settings) -> Result<(), GatewayError> {
    let (bind, folder) = (settings.bind, settings.recordings.clone());
    std::net::TcpListener::bind(bind).map_err(|error| GatewayError::Bind { bind, error })?;
    std::fs::create_dir_all(&folder).map_err(|error| GatewayError::Recordings { folder, error })
}

/// Serves until SIGINT or SIGTERM; then disarms every thruster, closes a running recording and returns.
///
/// # Errors
/// If the address or the folder of the recordings cannot be used.
pub fn run(config: &Config, deployment: &Deployment) -> Result<(), GatewayError> {
    let settings = Settings::new(config)?;
    let thrusters = settings::thrusters(config)?;
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?.block_on(serve(
        settings,
        thrusters,
        deployment.clone(),
    ))
}

async fn serve(
    settings: Settings,
    thrusters: Vec<Deployed>,
    deployment: Deployment,
) -> Result<(), GatewayError> {
    let bind = settings.bind;
    let listener = TcpListener::bind(bind).await.map_err(|error| GatewayError::Bind { bind, error })?;
    let recorder = Recorder::open(&settings.recordings)
        .map_err(|error| GatewayError::Recordings { folder: settings.recordings.clone(), error })?;
    let recorder = Arc::new(recorder);
    let (stop_streams, stopping) = watch::channel(false);

    let mut app = App {
        thrusters: Vec::new(),
        tallies: Vec::new(),
        recorder: Arc::clone(&recorder),
        answers: Default::default(),
        stopping,
        document: OnceLock::new(),
    };
    let mut links = Vec::new();
    for Deployed { id, range, heartbeat } in &thrusters {
        let (thruster, asks) = Thruster::new(id, *range);
        let (thruster, tally) = (Arc::new(thruster), Arc::new(Tally::default()));
        app.thrusters.push(Arc::clone(&thruster));
        app.tallies.push(Arc::clone(&tally));
        links.push(bus::Link { thruster, tally, asks, heartbeat: *heartbeat });
    }
    let app = Arc::new(app);

    let stop_bus = Arc::new(AtomicBool::new(false));
    let bus = {
        let (recorder, stop) = (Arc::clone(&recorder), Arc::clone(&stop_bus));
        std::thread::Builder::new()
            .name("bus".into())
            .spawn(move || bus::run(&deployment, links, &recorder, &stop))?
    };

    let (mut interrupt, mut terminate) = (signal(SignalKind::interrupt())?, signal(SignalKind::terminate())?);
    tracing::info!("listening on http://{}", listener.local_addr()?);
    let router = routes::router(Arc::clone(&app));
    let at_rest = {
        let app = Arc::clone(&app);
        async move {
            tokio::select! { _ = interrupt.recv() => (), _ = terminate.recv() => () }
            for thruster in
                app.thrusters().iter().filter(|thruster| thruster.heard().armed(std::time::Instant::now()))
            {
                if let Err(problem) = thruster.disarm().await {
                    tracing::warn!(thruster = thruster.id, ?problem, "could not disarm on the way out");
                }
            }
            let _ = stop_streams.send(true);
        }
    };
    // Clients that keep their connection open do not keep the gateway.
    let (rested, resting) = tokio::sync::oneshot::channel::<()>();
    let graceful = async move {
        at_rest.await;
        let _ = rested.send(());
    };
    tokio::select! {
        served = axum::serve(listener.tap_io(at_once), router).with_graceful_shutdown(graceful) => served?,
        () = async { let _ = resting.await; tokio::time::sleep(Duration::from_millis(500)).await } => (),
    }
    let _ = recorder.stop();
    stop_bus.store(true, Ordering::Relaxed);
    let _ = bus.join();
    Ok(())
}
