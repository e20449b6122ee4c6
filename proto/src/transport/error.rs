//! Why shared memory cannot be used, in words that say what to do.

use std::path::PathBuf;

use thiserror::Error;

use super::deployment::ROOT_BYTES_MAX;

/// Why shared memory cannot be used.
#[derive(Debug, Error)]
pub enum TransportError {
    /// Another process owns the deployment.
    #[error(
        "{}: another kort ({holder}) already runs here\nhint: stop it, or give this one a root of its own with --root DIR or transport.root in kort.toml",
        root.display()
    )]
    Locked {
        /// The root folder.
        root: PathBuf,
        /// What the lock file says of its holder.
        holder: String,
    },
    /// Another process plays this part in the deployment.
    #[error(
        "{}: the {part} already runs here ({holder})\nhint: stop it, or give this one a root of its own with --root DIR or transport.root in kort.toml",
        root.display()
    )]
    Taken {
        /// The root folder.
        root: PathBuf,
        /// Which part.
        part: String,
        /// What the lock file says of its holder.
        holder: String,
    },
    /// A file of the deployment cannot be used.
    #[error("{}: {error}\nhint: choose another folder with --root DIR or transport.root in kort.toml", path.display())]
    File {
        /// The file or folder.
        path: PathBuf,
        /// The system's words.
        error: std::io::Error,
    },
    /// A path that shared memory cannot take.
    #[error("{}: not usable as the root of shared memory: it has {} bytes; allowed are at most {ROOT_BYTES_MAX} bytes, none of them odd\nhint: a short path, such as /tmp/kort", root.display(), root.as_os_str().len())]
    Path {
        /// The root folder.
        root: PathBuf,
    },
    /// The deployment speaks another version of the messages.
    #[error(
        "{}: what runs here speaks messages of version {theirs}, this kort those of version {}\nhint: both must be of one build: stop what runs there and start it anew with this one, or give this one a root of its own with --root DIR",
        root.display(), crate::names::MESSAGES_VERSION
    )]
    Version {
        /// The root folder.
        root: PathBuf,
        /// The version of its owner; versions before 5 wrote none down.
        theirs: String,
    },
    /// A service of the right name whose messages are laid out otherwise.
    #[error(
        "shared memory, {service}: its messages are laid out otherwise than those of this kort, though both call themselves version {}\nhint: both must be of one build: stop what runs there and start it anew with this one",
        crate::names::MESSAGES_VERSION
    )]
    Layout {
        /// The service.
        service: String,
    },
    /// Nobody owns the deployment.
    #[error("{}: nothing runs here\nhint: start `kort up` or `kort servo` first, with the same --root", root.display())]
    NoGeneration {
        /// The root folder.
        root: PathBuf,
    },
    /// No room for the samples: writing them would end in SIGBUS.
    #[error(
        "/dev/shm: {free_kib} KiB and {free_files} files are free; {needed_kib} KiB and {needed_files} files are needed\nhint: delete what is left over there, or make it larger (a container: shm_size)"
    )]
    Room {
        /// Free space, KiB.
        free_kib: u64,
        /// Files that may still be made.
        free_files: u64,
        /// Needed space, KiB.
        needed_kib: u64,
        /// Needed files.
        needed_files: u64,
    },
    /// Too few files may be open.
    #[error(
        "open files: at most {limit} are allowed here; {needed} are needed\nhint: raise the limit (ulimit -n {needed}; in systemd LimitNOFILE={needed})"
    )]
    OpenFiles {
        /// Files a process may have open.
        limit: u64,
        /// Files needed.
        needed: u64,
    },
    /// A file or folder that somebody else could write.
    #[error(
        "{}: {why}\nhint: whoever can write it could hold or forge this deployment; remove it, or choose a folder of your own with --root DIR or transport.root in kort.toml",
        path.display()
    )]
    Foreign {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// iceoryx2 said no.
    #[error(
        "shared memory, {what}: {error}\nhint: see that /dev/shm has room and belongs to this user (df /dev/shm; ls -l /dev/shm)"
    )]
    Iceoryx {
        /// What was tried.
        what: String,
        /// iceoryx2's word for it.
        error: String,
    },
}

impl TransportError {
    pub(super) fn iceoryx(what: impl Into<String>, error: impl std::fmt::Debug) -> Self {
        let refused = || Self::Iceoryx { what: what.into(), error: format!("{error:?}") };
        super::files::none_left().unwrap_or_else(refused)
    }
}

impl From<crate::ours::Foreign> for TransportError {
    fn from(crate::ours::Foreign { path, why }: crate::ours::Foreign) -> Self {
        Self::Foreign { path, why }
    }
}
