//! `[thrusters.ID.sensors.NAME]`: the sources of a thruster as the configuration describes them.

use std::collections::BTreeMap;
use std::path::PathBuf;

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::signals::{Kind as SignalKind, SIGNALS};
use kort_thruster::rig::Rig;
use regex::Regex;
use serde::Deserialize;

use super::iio::Iio;
use super::serial_line::{Column, SerialLine};
use super::units::{printed, to_si};
use super::{Channel, Plausible, place};
use crate::claims::Claim;
use crate::drives::{DEVICE, Wrong};

/// Names of the kinds, as `kind` gives them.
const KINDS: [&str; 2] = ["serial_line", "iio"];
/// Bits a second of a serial line whose section does not say.
const BAUD: i64 = 9600;

/// A section as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Keys {
    kind: String,
    port: Option<PathBuf>,
    baud: Option<i64>,
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
    column: Option<i64>,
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
    let mut errors = Vec::new();
    for (name, table) in &thruster.sensors {
        let section = format!("thrusters.{id}.sensors.{name}");
        let keys: Keys = config.section(&section, table)?;
        let mut wrong = Wrong::default();
        let one = read(name, &keys, &plausible, &mut wrong);
        for other in &chosen {
            let given = one.iter().flat_map(|one| &one.gives).filter(|place| other.gives.contains(place));
            for signal in given.filter_map(|place| SIGNALS.get(*place)) {
                wrong.say(format!(
                    "signals.{}` is given by `{}` too\nhint: leave one of them out",
                    signal.name, other.name
                ));
            }
        }
        errors.extend(wrong.of_section(config, &section));
        chosen.extend(one);
    }
    match config.first_of(errors.into_iter()) {
        Some(first) => Err(first),
        None => Ok(chosen),
    }
}

/// One section, as far as it can be read.
fn read(name: &str, keys: &Keys, plausible: &Plausible, wrong: &mut Wrong) -> Option<Chosen> {
    let mut within = |key: &str, value: f64, low: f64, high: f64, hint: &str| {
        if !(low..=high).contains(&value) {
            wrong.say(format!("{key}` = {value} is outside {low} to {high}\nhint: {hint}"));
        }
    };
    within("rate_hz", keys.rate_hz, 0.1, 1000.0, "how often the instrument has a new value");
    within("reading_life_ms", keys.reading_life_ms, 10.0, 60_000.0, "some of the instrument's periods");
    if keys.signals.is_empty() {
        wrong.say("signals` is empty\nhint: signals = { thrust_n = { column = 1, unit = \"N\" } }");
    }
    let measured = |p: &usize| SIGNALS.get(*p).is_some_and(|s| s.kind == SignalKind::Measured);
    let mut gives = Vec::new();
    for signal in keys.signals.keys() {
        match place(signal).filter(measured) {
            Some(place) => gives.push(place),
            None => {
                let known: Vec<_> =
                    SIGNALS.iter().filter(|s| s.kind == SignalKind::Measured).map(|s| s.name).collect();
                wrong.say(format!(
                    "signals.{signal}` is nothing that is measured\nhint: known are {}",
                    known.join(", ")
                ));
            }
        }
    }
    let kind = match keys.kind.as_str() {
        "serial_line" => serial_line(keys, plausible, wrong).map(Kind::SerialLine),
        "iio" => iio(keys, plausible, wrong).map(Kind::Iio),
        other => {
            wrong.say(format!(
                "kind` = \"{other}\" is no source\nhint: known are \"{}\"",
                KINDS.join("\", \"")
            ));
            None
        }
    }?;
    let life_ns = (keys.reading_life_ms * 1e6) as u64;
    Some(Chosen { name: name.to_owned(), kind, gives, life_ns, required: keys.required })
}

/// Refuses a key that this kind of source does not read: it would be left unheard.
fn not_read<T>(key: &str, given: Option<&T>, kind: &str) -> Result<(), String> {
    match given {
        None => Ok(()),
        Some(_) => Err(format!("{key}` is not read where kind = \"{kind}\"\nhint: leave the key out")),
    }
}

fn serial_line(keys: &Keys, plausible: &Plausible, wrong: &mut Wrong) -> Option<SerialLine> {
    wrong.of(not_read("path", keys.path.as_ref(), "serial_line"));
    let port = keys.port.clone();
    let port =
        port.ok_or("port` is missing\nhint: the instrument's device, for example /dev/ttyUSB0".to_owned());
    let port = wrong.of(port.and_then(|port| {
        DEVICE.check(&port.to_string_lossy()).map_err(|words| format!("port` {words}")).map(|()| port)
    }));
    let baud = keys.baud.unwrap_or(BAUD);
    if !(300..=12_000_000).contains(&baud) {
        wrong.say(format!("baud` = {baud} is outside 300 to 12000000\nhint: see the instrument's manual"));
    }
    let pattern = keys.pattern.as_deref().map(Regex::new).transpose().map_err(|e| {
        format!("pattern` is no regular expression: {e}\nhint: (…) around each number, for example 'F=([-+.0-9]+)'")
    });
    let pattern = wrong.of(pattern);
    // The whole match is group zero.
    let groups = |pattern: &Option<Regex>| pattern.as_ref().map_or(100, |pattern| pattern.captures_len() - 1);
    let columns = pattern.as_ref().map_or(100, groups) as i64;
    let mut channels = Vec::new();
    for (signal, given) in &keys.signals {
        let key = format!("signals.{signal}");
        wrong.of(not_read(&format!("{key}.channel"), given.channel.as_ref(), "serial_line"));
        let from = given.column.filter(|from| (1..=columns).contains(from));
        if from.is_none() {
            let said = match given.column {
                Some(from) => format!("= {from} is outside 1 to {columns}"),
                None => "is missing".into(),
            };
            wrong.say(format!("{key}.column` {said}\nhint: the first column is 1"));
        }
        let Some(unit) = given.unit.as_deref() else {
            wrong.say(format!(
                "{key}.unit` is missing; a unit is never guessed\nhint: unit = \"kgf\", as the instrument prints it"
            ));
            continue;
        };
        let number = from.and_then(|from| usize::try_from(from).ok()).unwrap_or(1);
        // A scale may make of another unit the stated one.
        let si = place(signal).and_then(|p| SIGNALS.get(p)).map_or("", |s| s.unit);
        let unit_printed = printed(unit, si).filter(|_| given.scale.is_none_or(|scale| scale.abs() == 1.0));
        let from = Column { number, unit: unit_printed };
        channels.extend(channel(signal, &key, from, unit, given, plausible, wrong));
    }
    let ask = keys.ask.clone().unwrap_or_default();
    let baud = u32::try_from(baud).unwrap_or_default();
    Some(SerialLine { port: port?, baud, pattern: pattern?, ask, rate_hz: keys.rate_hz, channels })
}

fn iio(keys: &Keys, plausible: &Plausible, wrong: &mut Wrong) -> Option<Iio> {
    wrong.of(not_read("port", keys.port.as_ref(), "iio"));
    wrong.of(not_read("baud", keys.baud.as_ref(), "iio"));
    wrong.of(not_read("pattern", keys.pattern.as_ref(), "iio"));
    wrong.of(not_read("ask", keys.ask.as_ref(), "iio"));
    let path = keys.path.clone().filter(|path| !path.as_os_str().is_empty());
    let missing = "path` is missing\nhint: for example /sys/bus/iio/devices/iio:device0";
    let path = wrong.of(path.ok_or_else(|| missing.to_owned()));
    let mut channels = Vec::new();
    for (signal, given) in &keys.signals {
        let key = format!("signals.{signal}");
        wrong.of(not_read(&format!("{key}.column"), given.column.as_ref(), "iio"));
        let from = given.channel.clone().unwrap_or_default();
        if from.is_empty() {
            wrong.say(format!(
                "{key}.channel` is missing\nhint: in_voltage0 for in_voltage0_raw, count0/count for a counter"
            ));
        } else if from.contains("..") {
            wrong.say(format!(
                "{key}.channel` = \"{from}\" leaves the device's folder\nhint: give the folder as `path`"
            ));
        }
        if given.scale.is_none() {
            wrong.say(format!(
                "{key}.scale` is missing; it is never guessed\nhint: how many SI units a millivolt, a milliampere or a count is"
            ));
        }
        let si = place(signal).and_then(|p| SIGNALS.get(p)).map_or("", |s| s.unit);
        let unit = given.unit.as_deref().unwrap_or(si);
        channels.extend(channel(signal, &key, from, unit, given, plausible, wrong));
    }
    Some(Iio { path: path?, rate_hz: keys.rate_hz, channels })
}

/// A channel; none of what is no signal, which is told where the signals are looked up.
fn channel<F>(
    signal: &str,
    key: &str,
    from: F,
    unit: &str,
    given: &SignalKeys,
    plausible: &Plausible,
    wrong: &mut Wrong,
) -> Option<Channel<F>> {
    let (place, si) = place(signal).and_then(|p| SIGNALS.get(p).map(|s| (p, s.unit)))?;
    let converted = wrong.of(to_si(unit, si).map_err(|words| format!("{key}.unit` {words}")));
    let scale = given.scale.unwrap_or(1.0);
    if !scale.is_finite() || scale == 0.0 {
        wrong.say(format!(
            "{key}.scale` = {scale}; allowed is a finite number that is not zero\nhint: -1 turns the sign"
        ));
    }
    if !given.offset.is_finite() {
        wrong.say(format!(
            "{key}.offset` = {}; allowed is a finite number\nhint: SI, at the instrument's zero",
            given.offset
        ));
    }
    let (factor, zero) = converted?;
    let most = plausible.most(signal);
    Some(Channel { from, place, scale: factor * scale, offset: zero + given.offset, most })
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
