//! What every drive on a wire is told in the section `drive` of its thruster.

use std::path::PathBuf;

use kort_proto::config::{Config, ConfigError, Thruster};
use serde::Deserialize;

use super::forms::Form;
use crate::claims::Claim;
use crate::link::Medium;

/// Section `drive` as written: whole numbers as they stand there, since what may stand there is no computer's range.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Keys {
    port: Option<PathBuf>,
    baud: i64,
    rate_hz: f64,
    timeout_ms: f64,
    reading_life_ms: Option<f64>,
    reversed: bool,
    identity: Option<String>,
    pole_pairs: Option<i64>,
    address: Option<i64>,
    bitrate: Option<i64>,
    units_per_turn: Option<f64>,
    speed_units: Option<f64>,
    motor: Option<i64>,
}

impl Default for Keys {
    fn default() -> Self {
        let times = Times::default();
        Self {
            port: None,
            baud: 115_200,
            rate_hz: times.rate_hz,
            timeout_ms: times.timeout_ms,
            reading_life_ms: None,
            reversed: false,
            identity: None,
            pole_pairs: None,
            address: None,
            bitrate: None,
            units_per_turn: None,
            speed_units: None,
            motor: None,
        }
    }
}

/// Life of a reading of most drives, ms: at 200 exchanges a second, each answered within one, ten are made in it. An answer
/// that is lost is asked for again after an eighth of it.
pub(super) const LIFE_MS: f64 = 50.0;

/// How often every real drive is spoken to, and how long it may be silent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Times {
    pub(super) rate_hz: f64,
    pub(super) timeout_ms: f64,
    pub(super) reading_life_ms: f64,
}

impl Default for Times {
    fn default() -> Self {
        Self { rate_hz: 200.0, timeout_ms: 100.0, reading_life_ms: LIFE_MS }
    }
}

impl Times {
    /// All that is wrong; each begins with its key, behind the section's name.
    pub(super) fn check(&self, thruster: &Thruster) -> Vec<String> {
        let mut wrong = Vec::new();
        for (key, value, low, high, hint) in [
            (
                "rate_hz",
                self.rate_hz,
                10.0,
                thruster.servo.rate_hz,
                "200; at most the servo's rate and what the wire carries",
            ),
            ("timeout_ms", self.timeout_ms, 20.0, 1000.0, "100: torque outlives a broken cable by this time"),
            (
                "reading_life_ms",
                self.reading_life_ms,
                5.0,
                1000.0,
                "50, of an ODrive 150: an answer and more may be lost in it",
            ),
        ] {
            if !(low..=high).contains(&value) {
                wrong.push(format!("{key}` = {value} is outside {low} to {high}\nhint: {hint}"));
            }
        }
        if !wrong.is_empty() {
            // What one is beside another is told once each can be meant.
            return wrong;
        }
        let period_ms = 1e3 / self.rate_hz;
        for (key, value) in [("timeout_ms", self.timeout_ms), ("reading_life_ms", self.reading_life_ms)] {
            if value < 3.0 * period_ms {
                wrong.push(format!(
                    "{key}` = {value} is less than three exchanges at rate_hz = {}\nhint: {} or more, or a faster exchange",
                    self.rate_hz,
                    3.0 * period_ms
                ));
            }
        }
        wrong
    }

    pub(super) fn reading_life_ns(&self) -> u64 {
        (self.reading_life_ms * 1e6) as u64
    }
}

/// Keys that only some drives have: why another has none, and what to do.
const OWN: [(&str, &str, &str); 6] = [
    ("pole_pairs", "this drive tells the speed of the shaft itself", "leave the key out"),
    ("address", "this drive is alone on its wire", "leave the key out"),
    ("bitrate", "this drive is on no CAN adapter", "leave the key out; `baud` is a serial port's"),
    ("units_per_turn", "this drive tells angles in turns", "leave the key out"),
    ("speed_units", "this drive tells speed in a unit that kort knows", "leave the key out"),
    ("motor", "this drive has one motor", "leave the key out"),
];

/// What of the section's keys is a drive's own.
pub struct Own {
    /// Those of the keys that not every drive has which this one has.
    pub keys: &'static [&'static str],
    /// What leads to it.
    pub port: Form,
    /// How its maker's number is written.
    pub identity: Form,
    /// How long a reading stands where the section does not say, ms.
    pub reading_life_ms: f64,
}

/// Whether these are keys of a drive on a wire: a section that is not read now.
///
/// # Errors
/// [`ConfigError`] names the first that is none, and the nearest.
pub(super) fn check_keys(config: &Config, section: &str, thruster: &Thruster) -> Result<(), ConfigError> {
    config.section::<Keys>(section, &thruster.drive).map(drop)
}

/// A drive on a wire, as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Wired {
    /// The device, as it is written.
    pub port: PathBuf,
    /// What that is: a serial port, unless the drive knows better.
    pub medium: Medium,
    /// Exchanges a second: a command, and a question for the measurements.
    pub rate_hz: f64,
    /// Longest time-out of the drive itself that is accepted, and the one it is given, s.
    pub timeout_s: f64,
    /// How long a reading stands before its absence is `drive_lost`, ns.
    pub reading_life_ns: u64,
    /// The motor is wired, or the propeller cut, the other way round: command, current, speed and angle change sign.
    pub reversed: bool,
    /// Serial number of the one drive that is meant; empty takes any.
    pub identity: String,
    /// Pole pairs of the motor, for drives that tell electrical speed.
    pub pole_pairs: Option<i64>,
    /// Number on the bus, for drives that share one.
    pub address: Option<i64>,
    /// Bits a second on the CAN behind an adapter on a serial port.
    pub bitrate: Option<i64>,
    /// Position units of a turn of the shaft, for drives whose unit is a setting.
    pub units_per_turn: Option<f64>,
    /// Velocity units at a turn a second, likewise.
    pub speed_units: Option<f64>,
    /// Number of the motor, for drives that have several.
    pub motor: Option<i64>,
    /// What no other device may have too: the wire, unless the drive shares it, and the one drive that is meant.
    pub claims: Vec<Claim>,
}

impl Wired {
    /// Reads the section; what is wrong in it goes to `wrong`, and the drive is then not to be had.
    ///
    /// # Errors
    /// [`ConfigError`] where it cannot be read at all.
    pub fn read(
        config: &Config,
        id: &str,
        thruster: &Thruster,
        own: &Own,
        wrong: &mut Vec<ConfigError>,
    ) -> Result<Self, ConfigError> {
        let section = format!("thrusters.{id}.drive");
        let keys: Keys = config.section(&section, &thruster.drive)?;
        let mut fail =
            |key: &str, words: String| wrong.push(config.error(format!("`{section}.{key}` {words}")));
        for (key, why, hint) in OWN {
            if let Some(value) = thruster.drive.get(key).filter(|_| !own.keys.contains(&key)) {
                fail(key, format!("= {value}: {why}\nhint: {hint}"));
            }
        }
        match &keys.port {
            Some(port) => {
                own.port.check(&port.to_string_lossy()).unwrap_or_else(|words| fail("port", words));
            }
            None => {
                fail("port", format!("is missing; allowed is {}\nhint: {}", own.port.allowed, own.port.hint))
            }
        }
        if let Some(Err(words)) = keys.identity.as_deref().map(|number| own.identity.check(number)) {
            fail("identity", words);
        }
        if !(1200..=12_000_000).contains(&keys.baud) {
            fail(
                "baud",
                format!("= {} is outside 1200 to 12000000\nhint: 115200; an USB device takes any", keys.baud),
            );
        }
        let times = Times {
            rate_hz: keys.rate_hz,
            timeout_ms: keys.timeout_ms,
            reading_life_ms: keys.reading_life_ms.unwrap_or(own.reading_life_ms),
        };
        wrong.extend(
            times.check(thruster).into_iter().map(|words| config.error(format!("`{section}.{words}"))),
        );
        let port = keys.port.unwrap_or_default();
        let identity = keys.identity.unwrap_or_default().to_ascii_lowercase();
        let meant = Some(&identity).filter(|identity| !identity.is_empty());
        let meant = meant.map(|identity| Claim::identity(&thruster.amplifier, identity));
        Ok(Self {
            claims: [Claim::port(&port)].into_iter().chain(meant).collect(),
            medium: Medium::Serial { port: port.clone(), baud: u32::try_from(keys.baud).unwrap_or_default() },
            port,
            rate_hz: keys.rate_hz,
            timeout_s: keys.timeout_ms * 1e-3,
            reading_life_ns: times.reading_life_ns(),
            reversed: keys.reversed,
            identity,
            pole_pairs: keys.pole_pairs,
            address: keys.address,
            bitrate: keys.bitrate,
            units_per_turn: keys.units_per_turn,
            speed_units: keys.speed_units,
            motor: keys.motor,
        })
    }

    /// The wire as its thread is told it; `priority` is the loop's.
    #[cfg(feature = "process")]
    pub fn wire(self, id: &str, priority: i32) -> crate::link::Wire {
        crate::link::Wire {
            name: format!("drive of {id}"),
            medium: self.medium,
            rate_hz: self.rate_hz,
            reading_life_ns: self.reading_life_ns,
            priority,
            is_drive: true,
        }
    }

    /// Why the drive that says this of itself is not the one that is meant, if it is not.
    pub fn is_another(&self, found: &str) -> Option<String> {
        let wanted = &self.identity;
        (!wanted.is_empty() && wanted != found).then(|| {
            format!(
                "`drive.identity` = {wanted}, but {found} answers\nhint: two drives swapped? else put that number there"
            )
        })
    }

    /// Why a drive that tells no number is not known to be the one that is meant, if one is.
    pub fn is_nameless(&self) -> Option<String> {
        let wanted = &self.identity;
        (!wanted.is_empty()).then(|| {
            format!(
                "`drive.identity` = {wanted}, but it does not tell its serial number\nhint: a noisy wire? else leave the key out, and name the port by the adapter's: /dev/serial/by-id/…"
            )
        })
    }

    /// Sign between the thruster's ahead and the drive's.
    pub fn sign(&self) -> f64 {
        if self.reversed { -1.0 } else { 1.0 }
    }
}
