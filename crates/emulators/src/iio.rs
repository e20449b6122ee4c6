//! An analogue servo amplifier behind Linux Industrial I/O, from the kernel's description of its files: a DAC that keeps what it was
//! given last, an ADC on the amplifier's current monitor, a quadrature counter of 16 bits on the shaft; and beside it a watchdog
//! circuit whose input is a line that must change, and whose output is the amplifier's enable, through a relay.

use std::f64::consts::TAU;

use kort_thruster::rig::Rig;

use crate::bench::Truth;
use crate::folder::InFiles;
use crate::stand::Stand;

/// Full scale of DAC and ADC either way, V.
const FULL_SCALE_V: f64 = 10.0;
/// Counts from one end of DAC and ADC to the other.
const COUNTS: f64 = 65536.0;
/// Largest count of the counter.
const CEILING: i64 = 65535;

const DAC: &str = "iio:device0/out_voltage0_raw";
const PULSE: &str = "leds/watchdog/brightness";

/// What the input at the amplifier's enable shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Enabled {
    /// What is.
    Honest,
    /// The same always.
    Stuck(bool),
}

/// How this one is made and set.
#[derive(Clone, Debug)]
pub struct Make {
    /// The DAC's name.
    pub name: &'static str,
    /// What a volt commands, in the unit of the rig's amplifier.
    pub gain: f64,
    /// Volts of an ampere at the current monitor.
    pub monitor_v_a: f64,
    /// Time without a change of its line after which the watchdog lets the enable fall, s; infinite: it is bridged.
    pub watchdog_s: f64,
    /// Time that the relay takes to close, s.
    pub relay_s: f64,
    /// The input that shows the enable.
    pub enabled: Enabled,
    /// Counts of a turn; negative where it counts down ahead.
    pub counts_per_turn: f64,
    /// The kernel says the DAC's scale; else it says nothing.
    pub tells_scale: bool,
    /// The DAC gives volts of one sign only.
    pub unipolar: bool,
}

impl Default for Make {
    fn default() -> Self {
        Self {
            name: "ad5754r",
            gain: 2.0,
            monitor_v_a: 0.5,
            watchdog_s: 0.1,
            relay_s: 0.02,
            enabled: Enabled::Honest,
            counts_per_turn: 4096.0,
            tells_scale: true,
            unipolar: false,
        }
    }
}

/// An emulated amplifier with a thruster.
pub struct Amplifier {
    make: Make,
    stand: Stand,
    volts: f64,
    /// What the DAC was given last, which not every one tells.
    raw: i64,
    powered_down: bool,
    line: bool,
    /// When the watchdog's line changed last, and since when the watchdog lets the amplifier be enabled, s.
    changed_s: f64,
    closed_s: Option<f64>,
    enabled: bool,
    /// Since its supply was cut the watchdog waits for a line that stands still before it lets anything be enabled.
    starting: bool,
    fault: bool,
    now_s: f64,
}

impl Amplifier {
    /// One with the rig's motor on it, left by somebody at three volts.
    pub fn new(make: Make, rig: &Rig) -> Self {
        let mut new = Self {
            stand: Stand::new(rig),
            volts: 0.0,
            raw: 0,
            powered_down: true,
            line: false,
            changed_s: f64::NEG_INFINITY,
            closed_s: None,
            enabled: false,
            starting: false,
            fault: false,
            now_s: 0.0,
            make,
        };
        new.give((3.0 / FULL_SCALE_V * COUNTS / 2.0) as i64 + new.middle());
        new
    }

    /// The count of zero volts.
    fn middle(&self) -> i64 {
        if self.make.unipolar { 0 } else { (COUNTS / 2.0) as i64 }
    }

    fn lsb_mv(&self) -> f64 {
        2e3 * FULL_SCALE_V / COUNTS
    }

    /// Beyond its bits a DAC takes nothing.
    fn give(&mut self, raw: i64) {
        if (0..COUNTS as i64).contains(&raw) {
            self.raw = raw;
            self.volts = (raw - self.middle()) as f64 * self.lsb_mv() * 1e-3;
        }
    }

    /// What the power stage is asked for.
    fn command(&self) -> f64 {
        if self.enabled && !self.powered_down { self.volts * self.make.gain } else { 0.0 }
    }

    fn count(&self) -> i64 {
        // Between two steps of the simulation the shaft turns on.
        let counts = self.stand.shaft_angle_rad_at(self.now_s) / TAU * self.make.counts_per_turn;
        (counts.floor() as i64).rem_euclid(CEILING + 1)
    }

    /// The current monitor on an ADC of 16 bits.
    fn current(&self) -> i64 {
        let counts = self.stand.current_a() * self.make.monitor_v_a * 1e3 / self.lsb_mv();
        (counts.round() as i64).clamp(-(COUNTS as i64) / 2, COUNTS as i64 / 2 - 1)
    }
}

impl InFiles for Amplifier {
    fn files(&self) -> Vec<(&'static str, String)> {
        let enabled = match self.make.enabled {
            Enabled::Honest => self.enabled,
            Enabled::Stuck(always) => always,
        };
        let mut files: Vec<(&'static str, String)> = vec![
            ("iio:device0/name", self.make.name.to_owned()),
            (DAC, self.raw.to_string()),
            ("iio:device0/out_voltage0_raw_available", format!("[0 1 {}]", COUNTS as i64 - 1)),
            ("iio:device0/out_voltage0_powerdown", i64::from(self.powered_down).to_string()),
            ("iio:device0/out_voltage_offset", (-self.middle()).to_string()),
            ("iio:device1/name", "ads8688".into()),
            ("iio:device1/in_voltage0_raw", self.current().to_string()),
            ("iio:device1/in_voltage_scale", format!("{:.9}", self.lsb_mv())),
            ("counter0/count0/count", self.count().to_string()),
            ("counter0/count0/ceiling", CEILING.to_string()),
            ("counter0/count0/count_mode", "normal".into()),
            ("counter0/count0/enable", "1".into()),
            (PULSE, i64::from(self.line).to_string()),
            ("gpio/enabled/value", i64::from(enabled).to_string()),
        ];
        if self.make.tells_scale {
            files.push(("iio:device0/out_voltage_scale", format!("{:.9}", self.lsb_mv())));
        }
        files.into_iter().map(|(file, text)| (file, text + "\n")).collect()
    }

    fn takes(&self) -> &'static [&'static str] {
        &[DAC, PULSE, "iio:device0/out_voltage0_powerdown"]
    }

    fn hear(&mut self, now_s: f64, file: &str, text: &str) {
        match (file, text.parse::<i64>()) {
            (DAC, Ok(raw)) => self.give(raw),
            (PULSE, Ok(level)) if self.line != (level != 0) => {
                self.line = level != 0;
                self.changed_s = now_s;
            }
            ("iio:device0/out_voltage0_powerdown", Ok(down)) => self.powered_down = down != 0,
            _ => (),
        }
    }

    fn live(&mut self, now_s: f64) {
        self.now_s = now_s;
        let pulsed = now_s - self.changed_s < self.make.watchdog_s;
        self.starting &= pulsed;
        let closed = pulsed && !self.starting && !self.fault;
        self.closed_s = if closed { Some(self.closed_s.unwrap_or(now_s)) } else { None };
        self.enabled = self.closed_s.is_some_and(|since| now_s - since >= self.make.relay_s);
        self.stand.turn_to(now_s, self.command());
    }

    fn restart(&mut self) {
        self.give(self.middle());
        self.changed_s = self.now_s;
        self.starting = true;
    }

    fn report(&mut self, code: u32) {
        self.fault = code != 0;
    }

    fn truth(&self) -> Truth {
        self.stand.truth(self.command())
    }
}
