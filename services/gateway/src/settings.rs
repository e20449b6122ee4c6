//! What `kort.toml` says to the gateway.

use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use std::time::Duration;

use kort_control::model::ControlModel;
use kort_control::{ControllerConfig, LawKind, advise};
use kort_proto::config::{Config, ConfigError, Thruster};
use kort_thruster::rig::{AmplifierKind, Rig};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::hosts;
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
    /// Folder of the event log, likewise.
    pub events: PathBuf,
    /// Folder of the rigs' revisions, likewise.
    pub rigs: PathBuf,
    /// Folder of the diagnoses and fits, likewise.
    pub diagnoses: PathBuf,
    /// Folder of the calibrations, likewise.
    pub calibrations: PathBuf,
    /// File of the tokens, likewise; `kort token new` writes it.
    pub tokens: PathBuf,
    /// Ask for a token on loopback too; beyond it, and behind a proxy, one is always asked for.
    pub require_tokens: bool,
    /// Names and addresses under which this gateway is reached, beside its own: what `Host` and `Origin` may say.
    pub hosts: Vec<String>,
    /// A proxy in front of this address speaks TLS: the traffic here never leaves trusted wires. Whoever comes through it
    /// brings a token.
    pub behind_tls_proxy: bool,
    /// TLS of its own.
    pub tls: Option<Tls>,
    /// Address of a live server for Foxglove, read only, of this machine; none if left out.
    #[serde(deserialize_with = "maybe_address")]
    pub foxglove: Option<SocketAddr>,
    /// When a recording ends by itself.
    pub recording: RecordingLimits,
    /// What is kept for diagnoses and fits, and of them.
    pub diagnosis: DiagnosisLimits,
}

/// Section `[gateway.tls]`.
#[derive(Clone, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tls {
    /// Certificate chain, PEM.
    pub certificate: PathBuf,
    /// Private key, PEM.
    pub key: PathBuf,
    /// Make both, self-signed, if neither is there.
    #[serde(default)]
    pub self_signed: bool,
}

/// Section `[gateway.recording]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct RecordingLimits {
    /// Size at which a recording goes on in a new file, bytes.
    pub file_bytes_max: u64,
    /// Files of one recording, after which it ends.
    pub files_max: u32,
    /// Time after which a recording ends, s.
    pub time_max_s: f64,
    /// Free space that a recording leaves on the disk, bytes.
    pub free_bytes_min: u64,
}

impl Default for RecordingLimits {
    fn default() -> RecordingLimits {
        RecordingLimits {
            file_bytes_max: 256 << 20,
            files_max: 64,
            time_max_s: 86_400.0,
            free_bytes_min: 256 << 20,
        }
    }
}

/// Section `[gateway.diagnosis]`.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DiagnosisLimits {
    /// Time that is always kept of each thruster, s.
    pub ring_time_s: f64,
    /// Rate at which it is kept, Hz.
    pub ring_rate_hz: f64,
    /// Diagnoses that are kept, and fits likewise; the oldest goes for the next.
    pub kept_max: usize,
}

impl DiagnosisLimits {
    /// Rows that are kept of each thruster.
    pub fn ring_rows(&self) -> usize {
        (self.ring_time_s * self.ring_rate_hz).ceil().max(1.0) as usize
    }
}

impl Default for DiagnosisLimits {
    fn default() -> DiagnosisLimits {
        DiagnosisLimits { ring_time_s: 600.0, ring_rate_hz: 100.0, kept_max: 50 }
    }
}

impl Default for Settings {
    fn default() -> Settings {
        Settings {
            bind: SocketAddr::from(([127, 0, 0, 1], 8080)),
            recordings: PathBuf::from("kort-state/recordings"),
            events: PathBuf::from("kort-state/events"),
            rigs: PathBuf::from("kort-state/rigs"),
            diagnoses: PathBuf::from("kort-state/diagnoses"),
            calibrations: PathBuf::from("kort-state/calibrations"),
            tokens: PathBuf::from("kort-state/tokens.toml"),
            require_tokens: false,
            hosts: Vec::new(),
            behind_tls_proxy: false,
            tls: None,
            foxglove: None,
            recording: RecordingLimits::default(),
            diagnosis: DiagnosisLimits::default(),
        }
    }
}

fn address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<SocketAddr, D::Error> {
    let text = String::deserialize(deserializer)?;
    text.parse().map_err(|_| {
        D::Error::custom(format!(
            "{text:?} is no address; allowed is IP:PORT\nhint: \"127.0.0.1:8080\"; any address beyond this machine also needs tokens and TLS"
        ))
    })
}

fn maybe_address<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Option<SocketAddr>, D::Error> {
    address(deserializer).map(Some)
}

impl Settings {
    /// Reads the section.
    ///
    /// # Errors
    /// [`ConfigError`] names an unknown key or a value that is not allowed.
    pub fn new(config: &Config) -> Result<Settings, ConfigError> {
        let settings = Settings::new_unchecked(config)?;
        match settings.wrong().into_iter().next() {
            Some(words) => Err(config.error(words)),
            None => Ok(settings),
        }
    }

    /// Reads the section without asking whether a gateway could run with it: a token can be made first.
    ///
    /// # Errors
    /// [`ConfigError`] names an unknown key or a value of the wrong kind.
    pub fn new_unchecked(config: &Config) -> Result<Settings, ConfigError> {
        config.section("gateway", &config.gateway)
    }

    /// What each value alone may be, and what an address beyond this machine needs beside it.
    pub fn wrong(&self) -> Vec<String> {
        let mut wrong = Vec::new();
        if self.bind.port() == 0 {
            wrong.push("`gateway.bind` has port 0; allowed are 1 to 65535\nhint: \"127.0.0.1:8080\"".into());
        }
        for odd in self.hosts.iter().filter(|host| !hosts::is_host(host)) {
            wrong.push(format!(
                "`gateway.hosts` holds {odd:?}; allowed are names and addresses without scheme, port or path\nhint: \"thruster.example.org\""
            ));
        }
        if let Some(bind) = self.foxglove {
            let own = bind.port() == self.bind.port()
                && (bind.ip() == self.bind.ip() || self.bind.ip().is_unspecified());
            if bind.port() == 0 || own {
                wrong.push(format!(
                    "`gateway.foxglove` = {bind}; allowed are the ports 1 to 65535 but that of gateway.bind\nhint: \"127.0.0.1:8765\""
                ));
            }
            if !bind.ip().is_loopback() || self.require_tokens {
                wrong.push(format!(
                    "`gateway.foxglove` = {bind} asks nobody for a token; allowed are addresses of this machine, without require_tokens\nhint: \"127.0.0.1:8765\", and a tunnel from elsewhere"
                ));
            }
            if !cfg!(feature = "foxglove") {
                wrong.push("`gateway.foxglove`: this program was built without the feature `foxglove`\nhint: leave the key out".into());
            }
        }
        let limits = &self.recording;
        for (key, value, low, high) in [
            ("file_bytes_max", limits.file_bytes_max as f64, 65_536.0, 1e12),
            ("files_max", f64::from(limits.files_max), 1.0, 10_000.0),
            ("time_max_s", limits.time_max_s, 1.0, 3.2e7),
            ("free_bytes_min", limits.free_bytes_min as f64, 0.0, 1e15),
        ] {
            if !(low..=high).contains(&value) {
                wrong.push(format!(
                    "`gateway.recording.{key}` = {value} is outside {low} to {high}\nhint: leave the key out for the usual value"
                ));
            }
        }
        let diagnosis = &self.diagnosis;
        for (key, value, low, high) in [
            ("ring_time_s", diagnosis.ring_time_s, 10.0, 3600.0),
            ("ring_rate_hz", diagnosis.ring_rate_hz, 1.0, 1000.0),
            ("kept_max", diagnosis.kept_max as f64, 1.0, 10_000.0),
        ] {
            if !(low..=high).contains(&value) {
                wrong.push(format!(
                    "`gateway.diagnosis.{key}` = {value} is outside {low} to {high}\nhint: leave the key out for the usual value"
                ));
            }
        }
        if !self.bind.ip().is_loopback() && self.tls.is_none() && !self.behind_tls_proxy {
            wrong.push(format!(
                "`gateway.bind` = {} is reached from other machines, and `gateway.tls` is missing\nhint: name certificate and key in [gateway.tls] (self_signed = true makes them), or say behind_tls_proxy = true where a proxy does it",
                self.bind
            ));
        }
        wrong
    }

    /// What is no mistake, and hardly as it is meant: the gateway starts, and says so.
    pub fn doubtful(&self) -> Option<String> {
        (self.bind.ip().is_unspecified() && self.hosts.is_empty()).then(|| {
            format!(
                "`gateway.hosts` = [], but `gateway.bind` = {} is reached by other names than localhost, 127.0.0.1 and [::1]: whoever asks by one is refused (421 foreign-host)\nhint: hosts = [\"thruster.example.org\", \"192.168.2.2\"], every name and address by which others reach this machine; or bind = \"127.0.0.1:{}\"",
                self.bind,
                self.bind.port()
            )
        })
    }

    /// Must every request bring a token?
    pub fn asks_for_tokens(&self) -> bool {
        self.why_tokens().is_some()
    }

    /// Why every request must bring a token, if it must.
    pub fn why_tokens(&self) -> Option<String> {
        if !self.bind.ip().is_loopback() {
            Some(format!("`gateway.bind` = {} is reached from other machines", self.bind))
        } else if self.behind_tls_proxy {
            Some("`gateway.behind_tls_proxy` = true: other machines come through the proxy".into())
        } else {
            self.require_tokens.then(|| "`gateway.require_tokens` = true".into())
        }
    }

    /// Where a browser finds the console: an address that stands for all of this machine's is none to go to.
    pub fn address(&self) -> String {
        let host = match self.hosts.first() {
            Some(host) if self.bind.ip().is_unspecified() => format!("{host}:{}", self.bind.port()),
            None if self.bind.ip().is_unspecified() => format!("localhost:{}", self.bind.port()),
            _ => self.bind.to_string(),
        };
        format!("{}://{host}", self.scheme())
    }

    /// `http` or `https`, as the console is reached.
    pub fn scheme(&self) -> &'static str {
        if self.tls.is_some() { "https" } else { "http" }
    }
}

/// What the gateway needs to know of one thruster.
#[derive(Clone, Debug)]
pub struct Deployed {
    /// Its name.
    pub id: String,
    /// File and text of its rig description, for recordings.
    pub rig: (String, String),
    /// Silence of the servo after which it is not shown as armed any more.
    pub servo_silence: Duration,
    /// Largest setpoints: what the rig can give, and what the limits allow.
    pub range: SetpointRange,
    /// Its controller as the deployment states it.
    pub controller: ControllerConfig,
    /// Period at which its setpoint is sent anew: the controller's.
    pub heartbeat: Duration,
    /// Kind of its drive.
    pub drive: AmplifierKind,
    /// Largest shaft speed that the configuration allows, rad/s.
    pub speed_limit_rad_s: Option<f64>,
}

impl Deployed {
    /// Largest setpoints with this model of the thruster.
    pub fn range_of(&self, model: &ControlModel) -> SetpointRange {
        range(Some(model), self.speed_limit_rad_s)
    }
}

fn range(model: Option<&ControlModel>, speed_limit_rad_s: Option<f64>) -> SetpointRange {
    let limit = speed_limit_rad_s.unwrap_or(f64::MAX);
    SetpointRange {
        thrust_n: hundredths(model.map_or(0.0, |model| model.thrust_max_n)),
        speed_rad_s: hundredths(limit.min(model.map_or(f64::MAX, |model| model.speed_max_rad_s))),
    }
}

/// The thrusters of the deployment.
///
/// # Errors
/// [`ConfigError`] if a rig cannot be read.
pub fn thrusters(config: &Config) -> Result<Vec<Deployed>, ConfigError> {
    let (thrusters, wrong) = thrusters_with_all(config);
    wrong.into_iter().next().map_or(Ok(thrusters), Err)
}

/// Those of the thrusters that can be read, and everything that is wrong with the files of the others.
pub fn thrusters_with_all(config: &Config) -> (Vec<Deployed>, Vec<ConfigError>) {
    let mut wrong = Vec::new();
    let read = config.thrusters.iter().filter_map(|(id, thruster)| {
        let rig = match config.rig_text(id, thruster) {
            Ok((file, text)) => match Rig::from_toml_with_all(&text) {
                Ok(rig) => Some((file, text, rig)),
                Err(errors) => {
                    let words = errors.iter().map(ToString::to_string);
                    wrong.extend(words.map(|message| ConfigError { file: file.clone(), message }));
                    None
                }
            },
            Err(error) => {
                wrong.push(error);
                None
            }
        };
        let of_rig = rig.as_ref().map(|(.., rig)| rig);
        let controller = controller(config, id, thruster, of_rig).map_err(|errors| wrong.extend(errors)).ok();
        let ((file, text, rig), controller) = (rig?, controller?);
        let heartbeat = Duration::from_nanos(thruster.controller_period_ns());
        let speed_limit_rad_s = thruster
            .limits
            .get("speed_rad_s")
            .and_then(|v| v.as_float().or(v.as_integer().map(|v| v as f64)));
        let model = ControlModel::from_rig(&rig, heartbeat.as_secs_f64());
        let range = range(model.as_ref().ok(), speed_limit_rad_s);
        let servo_silence =
            Duration::from_nanos((5 * thruster.servo_period_ns()).max(2 * thruster.controller_period_ns()));
        Some(Deployed {
            id: id.clone(),
            rig: (file, text),
            servo_silence,
            range,
            controller,
            heartbeat,
            drive: rig.amplifier.kind,
            speed_limit_rad_s,
        })
    });
    let read = read.collect();
    (read, wrong)
}

/// The file of law, observer and estimator; the deployment's law goes before its own, and where neither is stated the rig's.
fn controller(
    config: &Config,
    id: &str,
    thruster: &Thruster,
    rig: Option<&Rig>,
) -> Result<ControllerConfig, Vec<ConfigError>> {
    let keys = &thruster.controller;
    let period_s = thruster.controller_period_ns() as f64 * 1e-9;
    // The controller's process refuses a rig that has no default in its own words.
    let advised = rig.filter(|_| keys.takes_default()).and_then(|rig| advise(rig, period_s).ok());
    let advised = advised.map(|advice| advice.config);
    let mut stated = advised.unwrap_or_default();
    if keys.file != Path::new("") {
        let key = format!("thrusters.{id}.controller.file");
        let (file, text) = config.text_of(&key, &keys.file, &[]).map_err(|error| vec![error])?;
        let words = |message: String| ConfigError { file: file.clone(), message };
        stated = ControllerConfig::from_toml_with_all(&text)
            .map_err(|wrong| wrong.iter().map(|error| words(error.to_string())).collect::<Vec<_>>())?;
    }
    // And another law too.
    let named = keys.law.as_deref().and_then(LawKind::from_name);
    stated.law = named.or(advised.map(|advised| advised.law)).unwrap_or(stated.law);
    Ok(stated)
}

/// Rounded towards zero, so that a message can print it and it can still be asked for.
fn hundredths(value: f64) -> f64 {
    (value * 100.0).floor() / 100.0
}
