//! `[thrusters.ID.sensors.NAME]`: the sources of a thruster as the configuration describes them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::signals::{Kind as SignalKind, SIGNALS};
use kort_thruster::rig::Rig;
use regex::Regex;
use serde::Deserialize;

use super::iio::Iio;
use super::serial_line::SerialLine;
use super::units::to_si;
use super::{Channel, Plausible, place};
use crate::claims::Claim;
use crate::drives::DEVICE;

/// Names of the kinds, as `kind` gives them.
const KINDS: [&str; 2] = ["serial_line", "iio"];
/// Bits a second of a serial line whose section does not say.
const BAUD: u32 = 9600;

/// A section as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    kind: String,
    port: Option<PathBuf>,
    baud: Option<u32>,
    pattern: Option<String>,
    ask: Option<String>,
    path: Option<PathBuf>,
    #[serde(default = "rate_hz")]
    rate_hz: f64,
    #[serde(default = "life_ms")]
    reading_life_ms: f64,
    #[serde(default = "required")]
    required: bool,
    signals: BTreeMap<String, SignalKeys>,
}

fn rate_hz() -> f64 {
    50.0
}
fn life_ms() -> f64 {
    500.0
}
fn required() -> bool {
    true
}

/// One of `signals`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct SignalKeys {
    column: Option<usize>,
    channel: Option<String>,
    unit: Option<String>,
    scale: Option<f64>,
    #[serde(default)]
    offset: f64,
}

/// What a source is.
#[derive(Clone, Debug)]
pub enum Kind {
    /// An instrument that prints lines.
    SerialLine(SerialLine),
    /// Channels of Industrial I/O or a counter.
    Iio(Iio),
}

/// A source that can be started.
#[derive(Clone, Debug)]
pub struct Chosen {
    /// Its name in the configuration.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// Places in the signal table of what it gives.
    pub gives: Vec<usize>,
    /// How long a reading stands, ns.
    pub life_ns: u64,
    /// Its silence is a fault.
    pub required: bool,
}

/// Reads the sources of a thruster.
///
/// # Errors
/// [`ConfigError`] names section, key, value and what is allowed.
pub fn choose(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Vec<Chosen>, ConfigError> {
    let plausible = Plausible::of(rig);
    let mut chosen: Vec<Chosen> = Vec::new();
    for (name, table) in &thruster.sensors {
        let section = format!("thrusters.{id}.sensors.{name}");
        let keys: Keys = config.section(&section, table)?;
        let one =
            read(name, &keys, &plausible).map_err(|words| config.error(format!("`{section}.{words}")))?;
        for other in &chosen {
            if let Some(signal) =
                one.gives.iter().find(|p| other.gives.contains(p)).and_then(|p| SIGNALS.get(*p))
            {
                return Err(config.error(format!(
                    "`{section}.signals.{}` is given by `{}` too\nhint: leave one of them out",
                    signal.name, other.name
                )));
            }
        }
        chosen.push(one);
    }
    Ok(chosen)
}

/// One section; an error begins with its key, behind the section's name.
fn read(name: &str, keys: &Keys, plausible: &Plausible) -> Result<Chosen, String> {
    let within = |key: &str, value: f64, low: f64, high: f64, hint: &str| {
        if (low..=high).contains(&value) {
            return Ok(());
        }
        Err(format!("{key}` = {value} is outside {low} to {high}\nhint: {hint}"))
    };
    within("rate_hz", keys.rate_hz, 0.1, 1000.0, "how often the instrument has a new value")?;
    within("reading_life_ms", keys.reading_life_ms, 10.0, 60_000.0, "some of the instrument's periods")?;
    if keys.signals.is_empty() {
        return Err("signals` is empty\nhint: signals = { thrust_n = { column = 1, unit = \"N\" } }".into());
    }
    let mut gives = Vec::new();
    for signal in keys.signals.keys() {
        let measured = |p: &usize| SIGNALS.get(*p).is_some_and(|s| s.kind == SignalKind::Measured);
        gives.push(place(signal).filter(measured).ok_or_else(|| {
            let known: Vec<_> =
                SIGNALS.iter().filter(|s| s.kind == SignalKind::Measured).map(|s| s.name).collect();
            format!("signals.{signal}` is nothing that is measured\nhint: known are {}", known.join(", "))
        })?);
    }
    let kind = match keys.kind.as_str() {
        "serial_line" => Kind::SerialLine(serial_line(keys, plausible)?),
        "iio" => Kind::Iio(iio(keys, plausible)?),
        other => {
            return Err(format!(
                "kind` = \"{other}\" is no source\nhint: known are \"{}\"",
                KINDS.join("\", \"")
            ));
        }
    };
    let life_ns = (keys.reading_life_ms * 1e6) as u64;
    Ok(Chosen { name: name.to_owned(), kind, gives, life_ns, required: keys.required })
}

/// Refuses a key that this kind of source does not read: it would be left unheard.
fn not_read<T>(key: &str, given: Option<&T>, kind: &str) -> Result<(), String> {
    match given {
        None => Ok(()),
        Some(_) => Err(format!("{key}` is not read where kind = \"{kind}\"\nhint: leave the key out")),
    }
}

fn serial_line(keys: &Keys, plausible: &Plausible) -> Result<SerialLine, String> {
    not_read("path", keys.path.as_ref(), "serial_line")?;
    let port = keys.port.clone();
    let port =
        port.ok_or("port` is missing\nhint: the instrument's device, for example /dev/ttyUSB0".to_owned())?;
    DEVICE.check(&port.to_string_lossy()).map_err(|words| format!("port` {words}"))?;
    let baud = keys.baud.unwrap_or(BAUD);
    if !(300..=12_000_000).contains(&baud) {
        return Err(format!("baud` = {baud} is outside 300 to 12000000\nhint: see the instrument's manual"));
    }
    let pattern = keys.pattern.as_deref().map(Regex::new).transpose().map_err(|e| {
        format!("pattern` is no regular expression: {e}\nhint: (…) around each number, for example 'F=([-+.0-9]+)'")
    })?;
    // The whole match is group zero.
    let columns = pattern.as_ref().map_or(100, |pattern| pattern.captures_len() - 1);
    let mut channels = Vec::new();
    for (signal, given) in &keys.signals {
        let key = format!("signals.{signal}");
        not_read(&format!("{key}.channel"), given.channel.as_ref(), "serial_line")?;
        let from =
            given.column.ok_or_else(|| format!("{key}.column` is missing\nhint: the first column is 1"))?;
        if !(1..=columns).contains(&from) {
            return Err(format!(
                "{key}.column` = {from} is outside 1 to {columns}\nhint: the first column is 1"
            ));
        }
        let unit = given.unit.as_deref().ok_or_else(|| {
            format!("{key}.unit` is missing; a unit is never guessed\nhint: unit = \"kgf\", as the instrument prints it")
        })?;
        channels.push(channel(signal, &key, from, unit, given, plausible)?);
    }
    let ask = keys.ask.clone().unwrap_or_default();
    Ok(SerialLine { port, baud, pattern, ask, rate_hz: keys.rate_hz, channels })
}

fn iio(keys: &Keys, plausible: &Plausible) -> Result<Iio, String> {
    not_read("port", keys.port.as_ref(), "iio")?;
    not_read("baud", keys.baud.as_ref(), "iio")?;
    not_read("pattern", keys.pattern.as_ref(), "iio")?;
    not_read("ask", keys.ask.as_ref(), "iio")?;
    let path = keys.path.clone().filter(|path| !path.as_os_str().is_empty());
    let path =
        path.ok_or("path` is missing\nhint: for example /sys/bus/iio/devices/iio:device0".to_owned())?;
    let mut channels = Vec::new();
    for (signal, given) in &keys.signals {
        let key = format!("signals.{signal}");
        not_read(&format!("{key}.column"), given.column.as_ref(), "iio")?;
        let from = given.channel.clone().filter(|c| !c.is_empty()).ok_or_else(|| {
            format!(
                "{key}.channel` is missing\nhint: in_voltage0 for in_voltage0_raw, count0/count for a counter"
            )
        })?;
        if from.contains("..") {
            return Err(format!(
                "{key}.channel` = \"{from}\" leaves the device's folder\nhint: give the folder as `path`"
            ));
        }
        if given.scale.is_none() {
            return Err(format!(
                "{key}.scale` is missing; it is never guessed\nhint: how many SI units a millivolt, a milliampere or a count is"
            ));
        }
        let si = place(signal).and_then(|p| SIGNALS.get(p)).map_or("", |s| s.unit);
        channels.push(channel(signal, &key, from, given.unit.as_deref().unwrap_or(si), given, plausible)?);
    }
    Ok(Iio { path, rate_hz: keys.rate_hz, channels })
}

fn channel<F>(
    signal: &str,
    key: &str,
    from: F,
    unit: &str,
    given: &SignalKeys,
    plausible: &Plausible,
) -> Result<Channel<F>, String> {
    let (place, si) = place(signal)
        .and_then(|p| SIGNALS.get(p).map(|s| (p, s.unit)))
        .ok_or_else(|| format!("{key}` is no signal\nhint: see docs/hardware.md"))?;
    let (factor, zero) = to_si(unit, si).map_err(|words| format!("{key}.unit` {words}"))?;
    let scale = given.scale.unwrap_or(1.0);
    if !scale.is_finite() || scale == 0.0 {
        return Err(format!(
            "{key}.scale` = {scale}; allowed is a finite number that is not zero\nhint: -1 turns the sign"
        ));
    }
    if !given.offset.is_finite() {
        return Err(format!(
            "{key}.offset` = {}; allowed is a finite number\nhint: SI, at the instrument's zero",
            given.offset
        ));
    }
    let most = plausible.most(signal);
    Ok(Channel { from, place, scale: factor * scale, offset: zero + given.offset, most })
}

impl Chosen {
    /// What no other device may have too. Files of the kernel are read by any number.
    pub fn claims(&self) -> Vec<Claim> {
        match &self.kind {
            Kind::SerialLine(line) => vec![Claim::port(&line.port)],
            Kind::Iio(_) => Vec::new(),
        }
    }
}

#[cfg(feature = "process")]
impl Chosen {
    /// Starts it; `priority` is the loop's.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had. An instrument that is not there is a fault, not an error.
    pub fn start(self, id: &str, priority: i32) -> std::io::Result<super::Sensor> {
        use crate::link::{Link, Medium, Wire};
        let name = format!("sensor {} of {id}", self.name);
        let source: Box<dyn super::Source> = match self.kind {
            Kind::SerialLine(line) => {
                let wire = Wire {
                    name,
                    medium: Medium::Serial { port: line.port.clone(), baud: line.baud },
                    rate_hz: line.rate_hz,
                    reading_life_ns: self.life_ns,
                    priority,
                    is_drive: false,
                };
                let listening = super::serial_line::Listening::new(line);
                Box::new(Link::start(wire, Box::new(listening))?)
            }
            Kind::Iio(iio) => Box::new(super::polled::Polled::start(name, super::iio::Reader::new(iio))?),
        };
        Ok(super::Sensor {
            source,
            gives: self.gives,
            life_ns: self.life_ns,
            required: self.required,
            read_ns: 0,
        })
    }
}

#[cfg(test)]
mod tests;
