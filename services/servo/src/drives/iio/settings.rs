//! Section `drive` of an analogue amplifier.

use std::path::{Path, PathBuf};

use kort_proto::config::{Config, ConfigError, Thruster};
use kort_proto::messages::DriveKind;
use kort_thruster::rig::Rig;
use serde::Deserialize;

use super::super::forms::NAME;
use super::super::kind_of;
use super::super::wired::Times;
use super::super::wrong::Wrong;
use super::{Counter, Iio, Monitor, Place, Watchdog};
use crate::settings::Settings;

/// Value of `watchdog` where there is none.
const NO_WATCHDOG: &str = "none";
/// Time from zero to full drive where the limits, which say it, are wrong themselves, s.
const FULL_DRIVE_S: f64 = 0.005;
/// The watchdog's wiring, for whoever has none.
const WATCHDOG_HINT: &str = "an output that kort changes with each exchange, for example /sys/class/leds/NAME/brightness, on a circuit without which the amplifier's enable falls (docs/hardware.md); with \"none\" kort only watches, and nobody can arm";

/// The section as written.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Keys {
    dac: PathBuf,
    scale_mv: Option<f64>,
    gain_a_per_v: Option<f64>,
    gain_v_per_v: Option<f64>,
    gain_rad_s_per_v: Option<f64>,
    limit_v: Option<f64>,
    identity: Option<String>,
    watchdog: PathBuf,
    enabled: PathBuf,
    current: Option<MonitorKeys>,
    counter: Option<CounterKeys>,
    rate_hz: f64,
    timeout_ms: f64,
    reading_life_ms: f64,
    reversed: bool,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct MonitorKeys {
    adc: PathBuf,
    gain_a_per_v: f64,
    #[serde(default)]
    zero_v: f64,
}

#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct CounterKeys {
    count: PathBuf,
    counts_per_turn: f64,
    ceiling: Option<i64>,
}

impl Default for Keys {
    fn default() -> Self {
        let times = Times::default();
        Self {
            dac: PathBuf::new(),
            scale_mv: None,
            gain_a_per_v: None,
            gain_v_per_v: None,
            gain_rad_s_per_v: None,
            limit_v: None,
            identity: None,
            watchdog: PathBuf::new(),
            enabled: PathBuf::new(),
            current: None,
            counter: None,
            rate_hz: times.rate_hz,
            timeout_ms: times.timeout_ms,
            reading_life_ms: times.reading_life_ms,
            reversed: false,
        }
    }
}

/// Whether these are keys of an analogue amplifier: a section that is not read now.
///
/// # Errors
/// [`ConfigError`] names the first that is none, and the nearest.
pub fn check_keys(config: &Config, section: &str, thruster: &Thruster) -> Result<(), ConfigError> {
    config.section::<Keys>(section, &thruster.drive).map(drop)
}

impl Iio {
    /// Reads the section `drive`.
    ///
    /// # Errors
    /// [`ConfigError`] names key, value and what is allowed.
    pub fn new(config: &Config, id: &str, thruster: &Thruster, rig: &Rig) -> Result<Self, ConfigError> {
        let section = format!("thrusters.{id}.drive");
        let keys: Keys = config.section(&section, &thruster.drive)?;
        let times = Times {
            rate_hz: keys.rate_hz,
            timeout_ms: keys.timeout_ms,
            reading_life_ms: keys.reading_life_ms,
        };
        let mut wrong = Wrong::default();
        wrong.all(times.check(thruster));
        let kind = kind_of(rig);
        // What is wrong with the limits is said where they are read.
        let limits = Settings::new(config, id, thruster, rig).ok().map(|settings| settings.limits);
        if let Some(name) = &keys.identity {
            wrong.of(NAME.check(name).map_err(|words| format!("identity` {words}")));
        }
        let gain = wrong.of(keys.gain(kind));
        let limit_v = wrong.of(keys.limit_v());
        if let (Some(gain), Some(limit_v), Some(most)) =
            (gain, limit_v, limits.map(|limits| limits.drive_max))
            && most / gain > limit_v * (1.0 + 1e-9)
        {
            let (unit, limit) = match kind {
                DriveKind::Current => ("A", "limits.current_a"),
                DriveKind::Speed => ("rad/s", "limits.speed_rad_s"),
                DriveKind::Voltage | DriveKind::Duty => ("V", "amplifier.supply_v of the rig"),
            };
            wrong.say(format!(
                "limit_v` = {limit_v}, but the largest command, {most} {unit}, is {:.3} V at {gain} {unit} a volt\nhint: a smaller {limit}, or a larger gain set in the amplifier",
                most / gain
            ));
        }
        if let Some(scale) = keys.scale_mv {
            let hint = "millivolts of a count: full scale over the number of counts";
            wrong.of(within("scale_mv", scale, 1e-9, 1e4, hint));
        }
        let hint = "the DAC's channel, for example /sys/bus/iio/devices/iio:device0/out_voltage0";
        let dac = wrong.of(volts("dac", &keys.dac, "out_voltage", hint));
        let watchdog = wrong.of(keys.watchdog());
        let current = keys.current.as_ref().map(|current| current.read(&mut wrong));
        let counter = keys.counter.as_ref().map(|counter| counter.read(&mut wrong));
        keys.tells_enough(kind, thruster, &mut wrong);
        let whole = dac.zip(gain.zip(limit_v)).zip(watchdog).filter(|_| wrong.is_empty());
        let first = config.first_of(wrong.of_section(config, &section).into_iter());
        let Some(((dac, (gain, limit_v)), watchdog)) = whole else {
            return Err(first.unwrap_or_else(|| config.error(format!("`{section}` cannot be read"))));
        };
        Ok(Self {
            kind,
            dac,
            scale_mv: keys.scale_mv,
            gain,
            limit_v,
            identity: keys.identity.clone().unwrap_or_default(),
            watchdog,
            current: current.flatten(),
            counter: counter.flatten(),
            rate_hz: times.rate_hz,
            timeout_s: times.timeout_ms * 1e-3,
            reading_life_ns: times.reading_life_ns(),
            full_drive_s: limits.map_or(FULL_DRIVE_S, |limits| limits.full_drive_s),
            sign: if keys.reversed { -1.0 } else { 1.0 },
        })
    }
}

impl Keys {
    /// Somebody must tell what the guard needs: the amplifier's monitors, or instruments beside it.
    fn tells_enough(&self, kind: DriveKind, thruster: &Thruster, wrong: &mut Wrong) {
        let told = |signal: &str| {
            let signals = thruster.sensors.values().filter_map(|sensor| sensor.get("signals"));
            signals.filter_map(|signals| signals.as_table()).any(|signals| signals.contains_key(signal))
        };
        if self.counter.is_none() && !told("shaft_speed_rad_s") {
            wrong.say("counter` is missing, and no sensor gives shaft_speed_rad_s\nhint: counter = { count = \"/sys/bus/counter/devices/counter0/count0\", counts_per_turn = 4096 }, or a sensor");
        }
        if self.current.is_none() && kind != DriveKind::Speed && !told("current_a") {
            wrong.say("current` is missing, and no sensor gives current_a\nhint: current = { adc = \"/sys/bus/iio/devices/iio:device1/in_voltage0\", gain_a_per_v = 2.0 }, the amplifier's current monitor, or a sensor");
        }
    }

    /// The largest voltage that the input bears.
    fn limit_v(&self) -> Result<f64, String> {
        let hint = "the largest voltage that the amplifier's input bears, either way";
        let limit_v = self.limit_v.ok_or_else(|| {
            format!("limit_v` is missing; it is never guessed\nhint: {hint}, for example 10.0")
        })?;
        within("limit_v", limit_v, 0.01, 100.0, hint).map(|()| limit_v)
    }

    /// What a volt commands: the key that has the unit of the rig's amplifier.
    fn gain(&self, kind: DriveKind) -> Result<f64, String> {
        let (wanted, example) = match kind {
            DriveKind::Current => ("gain_a_per_v", "2.0 for 20 A at 10 V"),
            DriveKind::Voltage | DriveKind::Duty => ("gain_v_per_v", "4.8 for 48 V at 10 V"),
            DriveKind::Speed => ("gain_rad_s_per_v", "31.4 for 3000 turns a minute at 10 V"),
        };
        let given = [
            ("gain_a_per_v", self.gain_a_per_v),
            ("gain_v_per_v", self.gain_v_per_v),
            ("gain_rad_s_per_v", self.gain_rad_s_per_v),
        ];
        if let Some((key, Some(value))) = given.iter().find(|(key, value)| value.is_some() && *key != wanted)
        {
            return Err(format!(
                "{key}` = {value}, but the rig's amplifier is commanded by another unit\nhint: {wanted} = {example}, or another amplifier.kind in the rig"
            ));
        }
        let gain = given.iter().find_map(|(_, value)| *value);
        let gain = gain.ok_or_else(|| {
            format!("{wanted}` is missing; it is never guessed\nhint: what a volt commands, as the amplifier is set, for example {example}")
        })?;
        within(
            wanted,
            gain,
            1e-6,
            1e6,
            &format!("what a volt commands, for example {example}; `reversed` turns the sign"),
        )?;
        Ok(gain)
    }

    fn watchdog(&self) -> Result<Option<Watchdog>, String> {
        let (pulse, enabled) = (&self.watchdog, &self.enabled);
        let given = |path: &Path| !path.as_os_str().is_empty();
        if !given(pulse) {
            return Err(format!(
                "watchdog` is missing: an analogue amplifier keeps its last torque when kort dies\nhint: {WATCHDOG_HINT}"
            ));
        }
        if pulse == Path::new(NO_WATCHDOG) {
            return match given(enabled) {
                true => {
                    Err(format!("enabled` = {enabled:?}, but `watchdog` is \"none\"\nhint: {WATCHDOG_HINT}"))
                }
                false => Ok(None),
            };
        }
        if !given(enabled) {
            return Err("enabled` is missing: without it nothing shows that the watchdog takes the torque away\nhint: an input that is 1 while the amplifier is enabled, for example /sys/class/gpio/gpio27/value".into());
        }
        for (key, path) in [("watchdog", pulse), ("enabled", enabled)] {
            if !path.is_absolute() {
                return Err(format!(
                    "{key}` = {path:?} is no whole path\nhint: for example /sys/class/gpio/gpio27/value"
                ));
            }
        }
        if pulse == enabled {
            return Err(format!(
                "enabled` = {enabled:?} is `watchdog` too: a line that kort writes shows nothing\nhint: an input at the amplifier's enable itself"
            ));
        }
        Ok(Some(Watchdog { pulse: pulse.clone(), enabled: enabled.clone() }))
    }
}

impl MonitorKeys {
    fn read(&self, wrong: &mut Wrong) -> Option<Monitor> {
        let gain = self.gain_a_per_v;
        if !(1e-6..=1e6).contains(&gain.abs()) {
            wrong.say(format!(
                "current.gain_a_per_v` = {gain}; allowed is 1e-6 to 1e6, or that with a minus\nhint: amperes in a volt, as the amplifier's manual says it"
            ));
        }
        let hint = "the monitor's voltage without current";
        wrong.of(within("current.zero_v", self.zero_v, -100.0, 100.0, hint));
        let hint = "the ADC's channel, for example /sys/bus/iio/devices/iio:device1/in_voltage0";
        let adc = wrong.of(volts("current.adc", &self.adc, "in_voltage", hint))?;
        Some(Monitor { adc, gain_a_per_v: gain, zero_v: self.zero_v })
    }
}

impl CounterKeys {
    fn read(&self, wrong: &mut Wrong) -> Option<Counter> {
        let counts = self.counts_per_turn.abs();
        if !(1.0..=1e9).contains(&counts) {
            wrong.say(format!(
                "counter.counts_per_turn` = {}; allowed is 1 to 1e9, or that with a minus\nhint: four times the encoder's lines; minus where it counts down ahead",
                self.counts_per_turn
            ));
        }
        let hint = "the count's folder, for example /sys/bus/counter/devices/counter0/count0";
        let count = wrong.of(place("counter.count", &self.count, hint));
        if let Some(ceiling) = self.ceiling.filter(|ceiling| (*ceiling as f64) < 2.0 * counts) {
            wrong.say(format!(
                "counter.ceiling` = {ceiling} is less than two turns\nhint: the counter's largest count: 65535 for one of 16 bits"
            ));
        }
        let count = count?;
        // With its file or without.
        let folder = if count.channel == "count" { count.folder } else { count.folder.join(&count.channel) };
        Some(Counter {
            folder,
            counts_per_turn: self.counts_per_turn,
            ceiling: self.ceiling.and_then(|ceiling| u64::try_from(ceiling).ok()),
        })
    }
}

fn within(key: &str, value: f64, low: f64, high: f64, hint: &str) -> Result<(), String> {
    if (low..=high).contains(&value) {
        return Ok(());
    }
    Err(format!("{key}` = {value} is outside {low} to {high}\nhint: {hint}"))
}

/// A channel of volts by its path.
fn volts(key: &str, path: &Path, kind: &str, hint: &str) -> Result<Place, String> {
    let place = place(key, path, hint)?;
    if place.channel.starts_with(kind) {
        return Ok(place);
    }
    Err(format!("{key}` = {path:?} is no channel of volts: {kind}…\nhint: {hint}"))
}

/// A channel by its path, with `_raw` or without.
fn place(key: &str, path: &Path, hint: &str) -> Result<Place, String> {
    let name = path.file_name().and_then(|name| name.to_str());
    match (name, path.parent()) {
        (Some(name), Some(folder)) if path.is_absolute() => {
            let channel = name.strip_suffix("_raw").unwrap_or(name).to_owned();
            Ok(Place { folder: folder.to_owned(), channel })
        }
        _ if path.as_os_str().is_empty() => Err(format!("{key}` is missing\nhint: {hint}")),
        _ => Err(format!("{key}` = {path:?} is no whole path\nhint: {hint}")),
    }
}

#[cfg(test)]
mod tests;
