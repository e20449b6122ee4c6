//! One deployment's shared memory on this machine: a folder (the root), a prefix in `/dev/shm`,
//! a lock, and the number of the present generation.
//!
//! A kill while iceoryx2 creates a service leaves it broken for good. So one process, the owner,
//! holds the lock, clears what others left under its root and prefix, creates every service under
//! a new generation, and only then writes the generation down; all others wait for the number
//! and only open. A generation has a folder and a prefix of its own: a peer that is just opening
//! the previous one cannot put anything in the way of the next.

use std::fs;
use std::os::unix::fs::DirBuilderExt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use iceoryx2::prelude::*;

use super::clock::monotonic_ns;
use super::error::TransportError;
use super::files::{allow_files, none_left};
use super::ours::{nobody_else_may_replace, ours_alone, owner_only, owner_only_from_the_start, write_whole};
use super::part::locked;
use super::ports::{Services, create_services};
use super::room;
use super::stillborn::Remover;
use super::watched::Watched;
use crate::names::MESSAGES_VERSION;

/// Longest root: the sockets by which iceoryx2 wakes a process lie under it, and a socket path has 107 bytes.
pub(super) const ROOT_BYTES_MAX: usize = 35;

/// What lies beside the root, whichever process made it.
const BESIDE: [&str; 5] = ["lock", "generation", "generation.new", "watched", "watched.new"];

/// Where a deployment's shared memory lives.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Deployment {
    root: PathBuf,
}

impl Deployment {
    /// A deployment at a root folder; `None` or an empty path takes the environment variable
    /// `KORT_ROOT`, else a folder of the user's.
    pub fn new(root: Option<&Path>) -> Self {
        let given = root.filter(|r| !r.as_os_str().is_empty()).map(Path::to_path_buf);
        let root = given.or_else(|| std::env::var_os("KORT_ROOT").map(PathBuf::from)).unwrap_or_else(|| {
            match std::env::var_os("XDG_RUNTIME_DIR") {
                Some(dir) if Path::new(&dir).is_dir() => Path::new(&dir).join("kort"),
                _ => PathBuf::from(format!("/tmp/kort-{}", rustix::process::getuid().as_raw())),
            }
        });
        Self { root: std::path::absolute(&root).unwrap_or(root) }
    }

    /// The root folder.
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Number of the present generation; `None` while nobody has created one.
    pub fn generation(&self) -> Option<u64> {
        fs::read_to_string(self.generation_file()).ok()?.split_whitespace().next()?.parse().ok()
    }

    /// The present generation, where its owner speaks as this program does.
    ///
    /// # Errors
    /// [`TransportError::NoGeneration`] if there is none, [`TransportError::Version`] if its messages are others,
    /// [`TransportError::OpenFiles`] if no file can be opened to read it.
    pub fn generation_of_our_version(&self) -> Result<u64, TransportError> {
        // Whoever else could write these could have us take part in a deployment of theirs.
        ours_alone(&self.root)?;
        ours_alone(&self.generation_file())?;
        let text = fs::read_to_string(self.generation_file()).map_err(|_| self.nothing_here())?;
        let mut words = text.split_whitespace();
        let generation =
            words.next().and_then(|number| number.parse().ok()).ok_or_else(|| self.nothing_here())?;
        match words.next() {
            Some(version) if version == MESSAGES_VERSION.to_string() => Ok(generation),
            other => {
                let theirs = other.map_or_else(|| "4 or older".to_owned(), str::to_owned);
                Err(TransportError::Version { root: self.root.clone(), theirs })
            }
        }
    }

    /// Waits for an owner to have created a generation; what one that is gone left is none.
    ///
    /// # Errors
    /// [`TransportError::NoGeneration`] if there is none after `timeout`.
    pub fn wait_for_generation(&self, timeout: Duration) -> Result<u64, TransportError> {
        let end = std::time::Instant::now() + timeout;
        loop {
            if let Some(generation) = self.generation().filter(|_| self.owner_lives()) {
                return Ok(generation);
            }
            if std::time::Instant::now() >= end {
                return Err(self.nothing_here());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// No generation can be read: there is none, or no file can be opened any more.
    fn nothing_here(&self) -> TransportError {
        none_left().unwrap_or_else(|| TransportError::NoGeneration { root: self.root.clone() })
    }

    /// Becomes the owner: takes the lock and clears root and prefix.
    ///
    /// # Errors
    /// [`TransportError::Locked`] if another process is the owner; [`TransportError::File`] if the
    /// folder cannot be made.
    pub fn own(&self) -> Result<Owner, TransportError> {
        let file_error = |path: &Path| {
            let path = path.to_path_buf();
            move |error| TransportError::File { path, error }
        };
        allow_files(1)?;
        self.in_our_hands()?;
        let lock = locked(&self.beside("lock"))?
            .map_err(|holder| TransportError::Locked { root: self.root.clone(), holder })?;
        let stillborn = Remover::start(self.prefix())?;
        let owner = Owner {
            deployment: self.clone(),
            _lock: lock,
            _stillborn: stillborn,
            node: None,
            services: Vec::new(),
        };
        owner.clear();
        let mut folder = fs::DirBuilder::new();
        folder.recursive(true).mode(0o700).create(&self.root).map_err(file_error(&self.root))?;
        Ok(owner)
    }

    /// Makes the folder that the root lies in, and sees to it that nobody else laid what is believed there.
    pub(super) fn in_our_hands(&self) -> Result<(), TransportError> {
        if let Some(parent) = self.root.parent() {
            let failed = |error| TransportError::File { path: parent.to_owned(), error };
            fs::create_dir_all(parent).map_err(failed)?;
            nobody_else_may_replace(parent)?;
        }
        ours_alone(&self.root)?;
        BESIDE.iter().try_for_each(|extension| ours_alone(&self.beside(extension)))
    }

    /// A node (iceoryx2's word for a participant) of one generation of this deployment.
    pub(super) fn node(&self, name: &str, generation: u64) -> Result<Node<ipc::Service>, TransportError> {
        let node = self.new_node(name, generation)?;
        owner_only(Path::new(room::SHM), &self.prefix_of(generation))?;
        Ok(node)
    }

    fn new_node(&self, name: &str, generation: u64) -> Result<Node<ipc::Service>, TransportError> {
        // iceoryx2 talks about every dead peer; what matters is in our own errors.
        set_log_level(LogLevel::Fatal);
        let name = NodeName::new(name).map_err(|e| TransportError::iceoryx("node name", e))?;
        NodeBuilder::new()
            .name(&name)
            .config(&self.config(generation)?)
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<ipc::Service>()
            .map_err(|e| TransportError::iceoryx("creating a node", e))
    }

    /// Makes what the nodes of a new generation share, and sees to it that nobody else has it open.
    fn first_node(&self, generation: u64) -> Result<(), TransportError> {
        drop(self.new_node("first", generation)?);
        owner_only_from_the_start(Path::new(room::SHM), &self.prefix_of(generation))
    }

    /// What iceoryx2 must know to find one generation of this deployment, for those who listen without our ports.
    ///
    /// # Errors
    /// [`TransportError::Path`] if the root cannot be one.
    pub fn config(&self, generation: u64) -> Result<Config, TransportError> {
        let path_error = || TransportError::Path { root: self.root.clone() };
        if self.root.as_os_str().len() > ROOT_BYTES_MAX {
            return Err(path_error());
        }
        let mut config = Config::default();
        let tag = tag(generation);
        let folder = self.root.join(&tag);
        let root =
            iceoryx2::prelude::Path::new(folder.as_os_str().as_encoded_bytes()).map_err(|_| path_error())?;
        config.global.set_root_path(&root);
        let prefix = self.prefix_of(generation);
        config.global.prefix = FileName::new(prefix.as_bytes()).map_err(|_| path_error())?;
        // Each receiver keeps room for so many senders that are gone and were not read to their end: 3.6 kB each, 128 of them if nobody says
        // so, in every receiver of every process.
        config.defaults.publish_subscribe.subscriber_expired_connection_buffer = 16;
        // Clearing up after the dead takes tens of milliseconds: only the owner does it.
        config.global.node.cleanup_dead_nodes_on_creation = false;
        config.global.node.cleanup_dead_nodes_on_destruction = false;
        config.global.service.cleanup_dead_nodes_on_open = false;
        Ok(config)
    }

    /// Prefix of the objects in `/dev/shm`: a hash (FNV-1a, 32 bits) of the root keeps deployments apart.
    fn prefix(&self) -> String {
        let hash = self
            .root
            .as_os_str()
            .as_encoded_bytes()
            .iter()
            .fold(0x811c_9dc5_u32, |hash, byte| (hash ^ u32::from(*byte)).wrapping_mul(0x0100_0193));
        format!("kort_{hash:08x}_")
    }

    /// Prefix of one generation's objects.
    fn prefix_of(&self, generation: u64) -> String {
        format!("{}{}_", self.prefix(), tag(generation))
    }

    /// Takes every page of one generation's shared memory, see [`room::reserve`], and keeps others out of it.
    pub(super) fn reserve(&self, generation: u64) -> Result<(), TransportError> {
        let prefix = self.prefix_of(generation);
        owner_only(Path::new(room::SHM), &prefix)?;
        room::reserve(&prefix)
    }

    /// The file in which the supervisor notes what it watches, see [`super::Watched`].
    pub fn watched_file(&self) -> PathBuf {
        self.beside("watched")
    }

    /// What the supervisor noted of the generation that is here now: what stands there of an earlier one, whose supervisor is
    /// gone, says nothing of it.
    pub fn watched(&self) -> Watched {
        let watched = Watched::read(&self.watched_file());
        if watched.generation.is_some() && watched.generation == self.generation() {
            watched
        } else {
            Watched::default()
        }
    }

    fn generation_file(&self) -> PathBuf {
        self.beside("generation")
    }

    /// A file beside the root, so that clearing the root leaves it.
    pub(super) fn beside(&self, extension: &str) -> PathBuf {
        let mut name = self.root.file_name().unwrap_or_default().to_os_string();
        name.push(".");
        name.push(extension);
        self.root.with_file_name(name)
    }
}

/// A generation in names of files: milliseconds are enough to tell two apart, and short.
fn tag(generation_ns: u64) -> String {
    format!("{:x}", generation_ns / 1_000_000)
}

/// The process that owns a deployment; the lock is given up when it is dropped or dies.
pub struct Owner {
    deployment: Deployment,
    _lock: fs::File,
    _stillborn: Remover,
    node: Option<Node<ipc::Service>>,
    services: Vec<Services>,
}

impl Owner {
    /// Creates all services of the thrusters under a new generation and publishes its number.
    ///
    /// # Errors
    /// [`TransportError`] if iceoryx2 or the file system refuses.
    pub fn create(&mut self, thrusters: &[&str]) -> Result<u64, TransportError> {
        room::room_for_thrusters(thrusters.len() as u64)?;
        allow_files(thrusters.len() as u64)?;
        let generation = monotonic_ns();
        // The first node makes the objects that all share, open to everybody; they are ours alone before anybody is told of them.
        self.deployment.first_node(generation)?;
        let node = self.deployment.node("owner", generation)?;
        self.services = thrusters
            .iter()
            .map(|thruster| create_services(&node, thruster, generation))
            .collect::<Result<_, _>>()?;
        self.deployment.reserve(generation)?;
        self.node = Some(node);
        let path = self.deployment.generation_file();
        let draft = self.deployment.beside("generation.new");
        write_whole(&path, &draft, format!("{generation} {MESSAGES_VERSION}").as_bytes())?;
        Ok(generation)
    }

    /// Could the services of so many thrusters be created afresh?
    ///
    /// # Errors
    /// [`TransportError::Room`] if `/dev/shm` is too full for them.
    pub fn has_room(&self, thrusters: usize) -> Result<(), TransportError> {
        room::room_for_thrusters(thrusters as u64)
    }

    /// Frees what dead processes held. Takes tens of milliseconds for each of them.
    pub fn clear_up_after_the_dead(&self) {
        if let Some(node) = &self.node {
            let _ = node.try_cleanup_dead_nodes();
        }
    }

    /// The deployment.
    pub fn deployment(&self) -> &Deployment {
        &self.deployment
    }

    /// Removes everything under root and prefix, whoever left it. What a peer creates meanwhile
    /// belongs to a generation that is gone, and stays for the next clearing.
    fn clear(&self) {
        let _ = fs::remove_file(self.deployment.generation_file());
        let _ = fs::remove_dir_all(&self.deployment.root);
        let prefix = self.deployment.prefix();
        for folder in ["/dev/shm", "/tmp"] {
            for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
                if entry.file_name().as_encoded_bytes().starts_with(prefix.as_bytes()) {
                    let _ = fs::remove_file(entry.path());
                }
            }
        }
    }
}

impl Drop for Owner {
    fn drop(&mut self) {
        // Services first: iceoryx2 removes what nobody uses; then whatever the dead left.
        self.services.clear();
        self.node = None;
        self.clear();
    }
}
