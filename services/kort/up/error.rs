//! Why `up` cannot run.

use kort_proto::config::ConfigError;
use kort_proto::transport::TransportError;
use thiserror::Error;

/// Why `up` cannot run.
#[derive(Debug, Error)]
pub enum UpError {
    /// The configuration.
    #[error(transparent)]
    Config(#[from] ConfigError),
    /// Shared memory.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The gateway could not start.
    #[error(transparent)]
    Gateway(#[from] kort_gateway::GatewayError),
    /// A servo could not start.
    #[error(transparent)]
    Servo(#[from] kort_servo::ServoError),
    /// A controller could not start.
    #[error(transparent)]
    Controller(#[from] kort_controller::ControllerError),
    /// The system refuses.
    #[error("{what}: {error}")]
    System {
        /// What was tried.
        what: String,
        /// The system's words.
        error: std::io::Error,
    },
    /// A child cannot use the configuration.
    #[error("{name} cannot use this deployment; its reason stands above")]
    Refused {
        /// The child.
        name: String,
    },
    /// A servo ended armed, and nobody switched its drive off.
    #[error(
        "{thrusters}: the servo ended while armed, without switching the drive off\nhint: only the drive's own time-out stops it: look at the shaft, cut the supply if it turns"
    )]
    NotStopped {
        /// The thrusters.
        thrusters: String,
    },
    /// A child does not start.
    #[error("{name} does not start\nhint: its reason stands above; `kort {name}` alone shows it again")]
    DoesNotStart {
        /// The child.
        name: String,
    },
}
