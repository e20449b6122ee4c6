//! What the routes share: thrusters with what belongs to each, recorder, events, gate and counts.

use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};

use axum::body::Bytes;
use axum::http::Method;
use kort_control::ControllerConfig;
use kort_proto::transport::{Deployment, Watched};
use tokio::sync::watch;
use utoipa::openapi::OpenApi;
use utoipa::openapi::path::ParameterIn;

use crate::analysis::Analyses;
use crate::calibration::Calibrations;
use crate::connections::Connections;
use crate::durations::Durations;
use crate::events::Events;
use crate::gate::Gate;
use crate::openapi::{self, Document};
use crate::problem::{Kind, Problem};
use crate::record::{Recorder, Subject};
use crate::rig::RigDesk;
use crate::ring::Ring;
use crate::tally::Tally;
use crate::thruster::Thruster;
use crate::tls::Certificate;

/// Everything the routes share.
#[derive(Debug)]
pub(crate) struct App {
    pub(crate) thrusters: Vec<Arc<Thruster>>,
    pub(crate) rigs: Vec<Arc<RigDesk>>,
    pub(crate) controllers: Vec<ControllerConfig>,
    pub(crate) rings: Vec<Ring>,
    pub(crate) analyses: Arc<Analyses>,
    pub(crate) calibrations: Arc<Calibrations>,
    pub(crate) tallies: Vec<Arc<Tally>>,
    pub(crate) recorder: Arc<Recorder>,
    pub(crate) events: Arc<Events>,
    pub(crate) gate: Gate,
    pub(crate) certificate: Option<Arc<Certificate>>,
    pub(crate) connections: Arc<Connections>,
    pub(crate) streams: Streams,
    pub(crate) address: String,
    pub(crate) disks: [PathBuf; 2],
    pub(crate) deployment: Deployment,
    pub(crate) answers: [AtomicU64; 4],
    pub(crate) durations: Durations,
    pub(crate) stopping: watch::Receiver<bool>,
    pub(crate) document: OnceLock<Document>,
    pub(crate) patterns: OnceLock<Vec<String>>,
}

impl App {
    pub(crate) fn thrusters(&self) -> &[Arc<Thruster>] {
        &self.thrusters
    }

    pub(crate) fn thruster(&self, id: &str) -> Result<&Arc<Thruster>, Problem> {
        self.thrusters.iter().find(|thruster| thruster.id == id).ok_or_else(|| {
            Problem::new(Kind::UnknownThruster, format!("there is no thruster {id:?}"))
                .hint("GET /v1/thrusters lists them")
                .allowed(self.thrusters.iter().map(|thruster| thruster.id.clone()))
        })
    }

    /// What a recording of this thruster holds.
    pub(crate) fn subject(&self, id: &str) -> Result<Subject, Problem> {
        Ok(Subject { thruster: Arc::clone(self.thruster(id)?), rig: Arc::clone(self.rig(id)?) })
    }

    /// The rig description of this thruster.
    pub(crate) fn rig(&self, id: &str) -> Result<&Arc<RigDesk>, Problem> {
        Ok(&self.rigs[self.place(id)?])
    }

    /// Its controller as the deployment states it.
    pub(crate) fn stated_controller(&self, id: &str) -> Result<&ControllerConfig, Problem> {
        Ok(&self.controllers[self.place(id)?])
    }

    /// The last minutes of this thruster.
    pub(crate) fn ring(&self, id: &str) -> Result<&Ring, Problem> {
        Ok(&self.rings[self.place(id)?])
    }

    /// Its place among all: each has one rig, one ring and one tally.
    pub(crate) fn place(&self, id: &str) -> Result<usize, Problem> {
        let thruster = self.thruster(id)?;
        Ok(self.thrusters.iter().position(|other| Arc::ptr_eq(other, thruster)).unwrap_or_default())
    }

    pub(crate) fn analyses(&self) -> &Arc<Analyses> {
        &self.analyses
    }

    pub(crate) fn calibrations(&self) -> &Arc<Calibrations> {
        &self.calibrations
    }

    pub(crate) fn tallies(&self) -> &[Arc<Tally>] {
        &self.tallies
    }

    pub(crate) fn recorder(&self) -> &Arc<Recorder> {
        &self.recorder
    }

    pub(crate) fn events(&self) -> &Events {
        &self.events
    }

    pub(crate) fn gate(&self) -> &Gate {
        &self.gate
    }

    /// The certificate; none for plain HTTP.
    pub(crate) fn certificate(&self) -> Option<&Certificate> {
        self.certificate.as_deref()
    }

    pub(crate) fn connections(&self) -> &Connections {
        &self.connections
    }

    /// The pattern of the route a path belongs to; `other` for what no route has.
    pub(crate) fn pattern(&self, path: &str) -> &str {
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
    pub(crate) fn address(&self) -> &str {
        &self.address
    }

    /// Free and whole size of the disks that are written to, bytes, by what is written there.
    pub(crate) fn disks(&self) -> impl Iterator<Item = (&'static str, f64, f64)> {
        ["recordings", "events"].into_iter().zip(&self.disks).filter_map(|(what, folder)| {
            let disk = rustix::fs::statvfs(folder).ok()?;
            let block = disk.f_frsize as f64;
            Some((what, disk.f_bavail as f64 * block, disk.f_blocks as f64 * block))
        })
    }

    pub(crate) fn durations(&self) -> &Durations {
        &self.durations
    }

    pub(crate) fn streams(&self) -> &Streams {
        &self.streams
    }

    /// What the supervisor notes beside the shared memory.
    pub(crate) fn watched(&self) -> Watched {
        self.deployment.watched()
    }

    pub(crate) fn stopping(&self) -> watch::Receiver<bool> {
        self.stopping.clone()
    }

    /// The OpenAPI document, once the routes are known.
    pub(crate) fn publish(&self, document: OpenApi) {
        let _ = self.patterns.set(document.paths.paths.keys().cloned().collect());
        let _ = self.document.set(Document(document));
    }

    /// Names that the query of a documented route may hold.
    pub(crate) fn query_names(&self, path: &str, method: &Method) -> Option<Vec<&str>> {
        let Document(document) = self.document.get()?;
        let item = document.paths.paths.get(self.pattern(path))?;
        let operation = match *method {
            Method::POST => &item.post,
            Method::PUT => &item.put,
            Method::DELETE => &item.delete,
            Method::PATCH => &item.patch,
            _ => return None,
        };
        let parameters = operation.as_ref()?.parameters.iter().flatten();
        let of_query = parameters.filter(|parameter| parameter.parameter_in == ParameterIn::Query);
        Some(of_query.map(|parameter| parameter.name.as_str()).collect())
    }

    /// The OpenAPI document, with the setpoints that are allowed now.
    pub(crate) fn document(&self) -> Bytes {
        let Some(Document(document)) = self.document.get() else { return Bytes::new() };
        let mut document = document.clone();
        openapi::finish(&mut document, self);
        serde_json::to_vec_pretty(&document).unwrap_or_default().into()
    }

    pub(crate) fn count_answer(&self, status: u16) {
        if let Some(count) =
            (status / 100).checked_sub(2).and_then(|class| self.answers.get(usize::from(class)))
        {
            count.fetch_add(1, Ordering::Relaxed);
        }
    }

    pub(crate) fn answers(&self) -> impl Iterator<Item = (&'static str, u64)> {
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
    pub(crate) fn open(&self) -> StreamGuard {
        self.0.fetch_add(1, Ordering::Relaxed);
        StreamGuard(Arc::clone(&self.0))
    }

    pub(crate) fn count(&self) -> u64 {
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
