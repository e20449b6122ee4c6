//! An analogue servo amplifier: a DAC of Linux Industrial I/O gives it the command as a voltage, and an ADC and a quadrature
//! counter tell what it does, as on the seed paper's own stand.
//!
//! Read for this: the kernel's `Documentation/ABI/testing/sysfs-bus-iio` and `sysfs-bus-counter`; of its DAC drivers that
//! a scale is often of the kind (`out_voltage_scale`), that not all can tell what they were given, and that a value beyond their
//! bits is refused (EINVAL).
//!
//! Units: the kernel's raw value is volts 1000 / scale - offset, rounded to a count; volts are the command over the gain that the owner states
//! (`gain_a_per_v`, `gain_v_per_v` or `gain_rad_s_per_v`, as the rig's amplifier is). Zero volts are zero torque: there is no key for
//! another zero, for a DAC that is reset gives zero. The current monitor is (volts - zero_v) times its gain; angle is counts over
//! `counts_per_turn`; speed is the difference of two counts over the time between their readings, so that a count more or less
//! is 2 pi rate_hz / counts_per_turn. Positive is ahead; `reversed` turns command, current, speed and angle together.
//!
//! Its own watchdog: it has none, and a DAC keeps its last voltage when kort dies. So an external one must stand between: a circuit
//! that lets the amplifier's enable fall when the line `watchdog` does not change for a while, and an input `enabled` that shows that
//! enable itself. Nothing is set at the start; it is tried: kort pulses with zero volts until `enabled` is 1, withholds the pulse, and
//! `enabled` must be 0 within `timeout_ms`. No pulse is given while nobody is armed, so each disarming tries it anew, and who
//! arms finds zero volts until it has fallen and come again. What is not confirmed is `drive_unguarded`, and nobody can arm
//! ([`interlock`]). The line changes with each exchange, which each tick asks for: a servo that stands still gives no pulse.
//!
//! Output off is zero volts at once and no pulse: the enable falls within the watchdog's time. Whatever cannot be read or
//! written, is no number, or is not within its range: zero volts if that still can be written, no pulse, `drive_lost` with the file's name in
//! the log. An enable that falls while the pulse goes on (emergency stop, the amplifier's own fault) is `amplifier_fault`.
//!
//! Unplugged: its files are gone, `drive_lost` within an exchange, and the watchdog takes the torque away. Then all files are looked
//! for anew, and the watchdog is tried anew.

#[cfg(feature = "process")]
mod files;
#[cfg(any(feature = "process", test))]
mod interlock;
#[cfg(feature = "process")]
mod serving;
mod settings;

pub(super) use settings::check_keys;

use std::path::PathBuf;

use kort_proto::messages::DriveKind;

use crate::claims::{Claim, real};

/// An analogue amplifier as the configuration describes it.
#[derive(Clone, Debug, PartialEq)]
pub struct Iio {
    /// Unit of the drive.
    pub kind: DriveKind,
    /// The DAC's channel: its device's folder and its name there.
    pub dac: Place,
    /// Millivolts of a count, where the kernel does not say.
    pub scale_mv: Option<f64>,
    /// What a volt commands, in the drive's unit.
    pub gain: f64,
    /// Largest voltage either way, V.
    pub limit_v: f64,
    /// The kernel's name of the DAC that is meant; empty takes any.
    pub identity: String,
    /// The external watchdog; none: it is watched only, and nobody can arm.
    pub watchdog: Option<Watchdog>,
    /// The amplifier's current monitor.
    pub current: Option<Monitor>,
    /// The counter of the shaft's encoder.
    pub counter: Option<Counter>,
    /// Exchanges a second: readings, a command, a pulse.
    pub rate_hz: f64,
    /// Longest time-out of the watchdog that is accepted, s.
    pub timeout_s: f64,
    /// How long a reading stands before its absence is `drive_lost`, ns.
    pub reading_life_ns: u64,
    /// Time from zero to full drive, in which the command comes in once the amplifier is enabled, s.
    pub full_drive_s: f64,
    /// Sign between the thruster's ahead and the amplifier's.
    pub sign: f64,
}

/// A channel of a device.
#[derive(Clone, Debug, PartialEq)]
pub struct Place {
    /// The device's folder.
    pub folder: PathBuf,
    /// The channel's name there, for example `out_voltage0`.
    pub channel: String,
}

/// The line that feeds the external watchdog, and the one that shows what it does.
#[derive(Clone, Debug, PartialEq)]
pub struct Watchdog {
    /// An output that takes 0 and 1; each change is a pulse.
    pub pulse: PathBuf,
    /// An input: 1 while the amplifier is enabled.
    pub enabled: PathBuf,
}

/// A current monitor on an ADC.
#[derive(Clone, Debug, PartialEq)]
pub struct Monitor {
    /// The ADC's channel.
    pub adc: Place,
    /// Amperes in a volt.
    pub gain_a_per_v: f64,
    /// Voltage at zero current, V.
    pub zero_v: f64,
}

/// A quadrature counter.
#[derive(Clone, Debug, PartialEq)]
pub struct Counter {
    /// The count's folder, for example `/sys/bus/counter/devices/counter0/count0`.
    pub folder: PathBuf,
    /// Counts of a turn of the shaft.
    pub counts_per_turn: f64,
    /// Largest count, where the kernel does not say.
    pub ceiling: Option<u64>,
}

impl Iio {
    /// What no other device may have too: each file that is driven, and each that tells of this amplifier alone.
    pub fn claims(&self) -> Vec<Claim> {
        let channel = |key, place: &Place, allowed, hint| {
            let at = real(&place.folder).join(&place.channel);
            Claim::file(key, &place.folder.join(&place.channel), at, allowed, hint)
        };
        let file = |key, path: &PathBuf, allowed, hint| Claim::file(key, path, real(path), allowed, hint);
        let mut claims = vec![channel(
            "dac",
            &self.dac,
            "one thruster a channel",
            "the channel that the other amplifier is wired to: `ls` in the DAC's folder shows them",
        )];
        if let Some(watchdog) = &self.watchdog {
            claims.push(file(
                "watchdog",
                &watchdog.pulse,
                "one thruster a watchdog",
                "a line and a circuit for each: one that is shared is fed by the other thruster when this one's servo dies",
            ));
            claims.push(file(
                "enabled",
                &watchdog.enabled,
                "one thruster an input",
                "an input at each amplifier's own enable: the other one's says nothing of this one's watchdog",
            ));
        }
        if let Some(current) = &self.current {
            claims.push(channel(
                "current.adc",
                &current.adc,
                "one thruster a current monitor",
                "the channel of the other amplifier's own monitor",
            ));
        }
        if let Some(counter) = &self.counter {
            claims.push(file(
                "counter.count",
                &counter.folder,
                "one thruster a counter",
                "the counter of the other shaft's encoder",
            ));
        }
        claims
    }
}

#[cfg(feature = "process")]
impl Iio {
    /// Starts the thread that serves it; `priority` is the loop's.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had. A device that is not there is a fault, not an error.
    pub fn start(self, id: &str, priority: i32) -> std::io::Result<crate::link::Link> {
        let name = format!("drive of {id}");
        let life_ns = self.reading_life_ns;
        crate::link::Link::spawn(life_ns, true, move |ends| {
            serving::Serving::new(name, self, ends).run(priority)
        })
    }
}
