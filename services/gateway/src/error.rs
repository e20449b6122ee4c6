//! Why the gateway cannot run.

use std::net::SocketAddr;
use std::path::PathBuf;

use kort_proto::config::ConfigError;
use kort_proto::transport::TransportError;
use thiserror::Error;

use crate::{tls, token};

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
    /// The address for Foxglove cannot be listened on.
    #[error("gateway.foxglove = {bind}: {error}\nhint: another port, or leave the key out")]
    Foxglove {
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
    /// The folder of the event log cannot be used.
    #[error("gateway.events = {}: {error}\nhint: name a folder this user can write", folder.display())]
    Events {
        /// The folder.
        folder: PathBuf,
        /// The system's words.
        error: std::io::Error,
    },
    /// The folder of the rigs' revisions cannot be used.
    #[error("gateway.rigs = {}: {error}\nhint: name a folder this user can write", folder.display())]
    Rigs {
        /// The folder.
        folder: PathBuf,
        /// The system's words.
        error: std::io::Error,
    },
    /// The folder of the diagnoses cannot be used.
    #[error("gateway.diagnoses = {}: {error}\nhint: name a folder this user can write", folder.display())]
    Diagnoses {
        /// The folder.
        folder: PathBuf,
        /// The system's words.
        error: std::io::Error,
    },
    /// The folder of the calibrations cannot be used.
    #[error("gateway.calibrations = {}: {error}\nhint: name a folder this user can write", folder.display())]
    Calibrations {
        /// The folder.
        folder: PathBuf,
        /// The system's words.
        error: std::io::Error,
    },
    /// Somebody else could have written what is to be believed, or could replace what is written.
    #[error(
        "gateway.{key}: {}: {why}\nhint: whoever can write there could make tokens of their own or forge what happened; \
         see what lies there, then give it to this user and take the right to write from others (chown, chmod go-w), or \
         name another in kort.toml",
        path.display()
    )]
    Foreign {
        /// The key that names it.
        key: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// Tokens are asked for, and there is none.
    #[error(
        "{why}, and {} holds no token\nhint: kort token new NAME --role viewer|pilot|admin makes one",
        file.display()
    )]
    NoTokens {
        /// Why they are asked for.
        why: String,
        /// The file of the tokens.
        file: PathBuf,
    },
    /// The tokens cannot be read.
    #[error(transparent)]
    Tokens(#[from] token::TokenError),
    /// Certificate or key cannot be used.
    #[error(transparent)]
    Tls(#[from] tls::TlsError),
    /// Another gateway runs here.
    #[error(transparent)]
    Transport(#[from] TransportError),
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
