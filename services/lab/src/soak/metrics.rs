//! Metrics of a soak run, scraped while it runs: `GET /metrics` on an address of one's own.
//!
//! ```text
//! kort_soak_progress_ratio{law,scenario}                  share done, mean over seeds
//! kort_soak_thrust_error_newtons{law,scenario,stat}       stat = "rms" so far, "p95" when done
//! kort_soak_energy_joules{law,scenario}                   so far, mean over seeds
//! ```

use std::collections::HashMap;
use std::net::SocketAddr;
use std::sync::{Arc, Mutex, PoisonError};

use prometheus::{GaugeVec, Opts, Registry, TextEncoder};
use thiserror::Error;

use kort_soak::LawResult;

/// Why metrics cannot be served.
#[derive(Debug, Error)]
pub enum MetricsError {
    /// The address is taken or not ours.
    #[error(
        "--metrics-addr {address}: {source}\nhint: a free port of this machine, for example 127.0.0.1:9464"
    )]
    Bind {
        /// The address.
        address: SocketAddr,
        /// What the system says.
        source: std::io::Error,
    },
    /// A metric could not be registered.
    #[error("metrics: {0}")]
    Registry(#[from] prometheus::Error),
}

/// Share done, thrust RMS and energy of one seed.
type SeedState = [f64; 3];

/// Gauges, and the thread that serves them until the process ends.
pub struct Metrics {
    progress: GaugeVec,
    error: GaugeVec,
    energy: GaugeVec,
    seeds: Mutex<HashMap<(String, String), HashMap<u32, SeedState>>>,
    /// Where they are served.
    pub address: SocketAddr,
}

impl Metrics {
    /// Binds and serves.
    ///
    /// # Errors
    /// [`MetricsError`] if the address cannot be bound.
    pub fn serve(address: SocketAddr) -> Result<Self, MetricsError> {
        let registry = Registry::new();
        let gauge = |name: &str, help: &str, labels: &[&str]| -> Result<GaugeVec, prometheus::Error> {
            let gauge = GaugeVec::new(Opts::new(name, help), labels)?;
            registry.register(Box::new(gauge.clone()))?;
            Ok(gauge)
        };
        let progress = gauge(
            "kort_soak_progress_ratio",
            "Share of the run that is done, mean over seeds.",
            &["law", "scenario"],
        )?;
        let error = gauge(
            "kort_soak_thrust_error_newtons",
            "Thrust error: stat rms is the root mean square so far, p95 what is not passed 95 % of the time.",
            &["law", "scenario", "stat"],
        )?;
        let energy = gauge(
            "kort_soak_energy_joules",
            "Electrical energy so far, mean over seeds.",
            &["law", "scenario"],
        )?;
        let bind = |source| MetricsError::Bind { address, source };
        let listener = std::net::TcpListener::bind(address).map_err(bind)?;
        listener.set_nonblocking(true).map_err(bind)?;
        let bound = listener.local_addr().map_err(bind)?;
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().map_err(bind)?;
        let registry = Arc::new(registry);
        std::thread::Builder::new()
            .name("soak-metrics".into())
            .spawn(move || {
                runtime.block_on(async move {
                    let text = move || {
                        let registry = registry.clone();
                        async move { TextEncoder::new().encode_to_string(&registry.gather()).unwrap_or_default() }
                    };
                    let app = axum::Router::new().route("/metrics", axum::routing::get(text));
                    match tokio::net::TcpListener::from_std(listener) {
                        Ok(listener) => {
                            if let Err(e) = axum::serve(listener, app).await {
                                tracing::warn!("metrics of the soak ended: {e}");
                            }
                        }
                        Err(e) => tracing::warn!("metrics of the soak not served: {e}"),
                    }
                });
            })
            .map_err(bind)?;
        Ok(Self { progress, error, energy, seeds: Mutex::default(), address: bound })
    }

    /// A run stands here.
    pub fn progress(&self, law: &str, scenario: &str, seed: u32, share: f64, rms_n: f64, energy_j: f64) {
        let mut all = self.seeds.lock().unwrap_or_else(PoisonError::into_inner);
        let states = all.entry((law.into(), scenario.into())).or_default();
        states.insert(seed, [share, rms_n, energy_j]);
        let n = states.len() as f64;
        let mean = |i: usize| states.values().map(|s| s[i]).sum::<f64>() / n;
        self.progress.with_label_values(&[law, scenario]).set(mean(0));
        self.error.with_label_values(&[law, scenario, "rms"]).set(mean(1));
        self.energy.with_label_values(&[law, scenario]).set(mean(2));
    }

    /// All seeds of a law are done.
    pub fn finished(&self, law: &str, scenario: &str, result: &LawResult) {
        self.progress.with_label_values(&[law, scenario]).set(1.0);
        for (stat, score) in [("rms", "thrust_rms_n"), ("p95", "thrust_p95_n")] {
            self.error.with_label_values(&[law, scenario, stat]).set(result.mean(score));
        }
    }
}
