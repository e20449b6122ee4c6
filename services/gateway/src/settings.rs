//! What `kort.toml` says to the gateway.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use kort_control::model::ControlModel;
use kort_proto::config::{Config, ConfigError};
use kort_thruster::rig::Rig;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::view::SetpointRange;

/// Section `[gateway]`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Settings {
    /// Address of the console, the REST API and the WebSocket.
    #[serde(deserialize_with = "address")]
    pub bind: SocketAddr,
    /// Folder of the recordings, relative to the working directory; created if it is not there.
    pub recordings: PathBuf,
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            bind: SocketAddr::from(([127, 0, 0, 1], 8080)),
            recordings: PathBuf::from("kort-state/recordings"),
        }
    }
}

fn address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SocketAddr, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse().map_err(|_| {
        D::Error::custom(format!(
            "{text:?} is no address; allowed is IP:PORT\nhint: \"127.0.0.1:8080\", or \"0.0.0.0:8080\" for every interface"
        ))
    })
}

impl Settings {
    /// Reads the section.
    ///
    /// # Errors
    /// [`ConfigError`] names an unknown key or a value that is not allowed.
    pub fn new(config: &Config) -> Result<Settings, ConfigError> {
        config.section("gateway", &config.gateway)
    }
}

/// What the gateway needs to know of one thruster.
#[derive(Clone, Debug)]
pub struct Deployed {
    /// Its name.
    pub id: String,
    /// Largest setpoints: what the rig can give, and what the limits allow.
    pub range: SetpointRange,
    /// Period at which its setpoint is sent anew: the controller's.
    pub heartbeat: Duration,
}

/// The thrusters of the deployment.
///
/// # Errors
/// [`ConfigError`] if a rig cannot be read.
pub fn thrusters(config: &Config) -> Result<Vec<Deployed>, ConfigError> {
    config
        .thrusters
        .iter()
        .map(|(id, thruster)| {
            let (file, text) = config.rig_text(id, thruster)?;
            let rig =
                Rig::from_toml(&text).map_err(|error| ConfigError { file, message: error.to_string() })?;
            let heartbeat = Duration::from_nanos(thruster.controller_period_ns());
            let speed_limit = thruster
                .limits
                .get("speed_rad_s")
                .and_then(|v| v.as_float().or(v.as_integer().map(|v| v as f64)));
            let model = ControlModel::from_rig(&rig, heartbeat.as_secs_f64());
            let range = SetpointRange {
                thrust_n: hundredths(model.as_ref().map_or(0.0, |model| model.thrust_max_n)),
                speed_rad_s: hundredths(
                    speed_limit
                        .unwrap_or(f64::MAX)
                        .min(model.map_or(f64::MAX, |model| model.speed_max_rad_s)),
                ),
            };
            Ok(Deployed { id: id.clone(), range, heartbeat })
        })
        .collect()
}

/// Rounded towards zero, so that a message can print it and it can still be asked for.
fn hundredths(value: f64) -> f64 {
    (value * 100.0).floor() / 100.0
}
