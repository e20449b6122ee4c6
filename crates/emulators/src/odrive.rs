//! An ODrive of firmware 0.5, from the description of its ASCII protocol: lines of words with a check sum, properties by
//! name, a watchdog that any motor command feeds.

use std::collections::BTreeMap;
use std::f64::consts::TAU;

use kort_thruster::rig::{AmplifierKind, Rig};

use crate::bench::{Device, Truth};
use crate::stand::Stand;

/// Time from power to the first answer, s.
const BOOT_S: f64 = 0.3;
/// Bit of the axis's error.
const WATCHDOG_EXPIRED: u64 = 0x800;
/// States of the axis.
const IDLE: u32 = 1;
const CLOSED_LOOP: u32 = 8;

/// Characters of a number that `r` prints: the firmware's buffer ends there.
const PRINTED: usize = 9;

/// How this one is made.
#[derive(Clone, Debug)]
pub struct Make {
    /// Its number, as `i` prints it; none: it does not print it.
    pub serial_number: Option<&'static str>,
    /// The watchdog's settings cannot be written.
    pub read_only: bool,
}

impl Default for Make {
    fn default() -> Self {
        Self { serial_number: Some("2084377D3548"), read_only: false }
    }
}

/// An emulated ODrive with a thruster on its first axis.
pub struct ODrive {
    make: Make,
    stand: Stand,
    held: String,
    properties: BTreeMap<&'static str, f64>,
    error: u64,
    state: u32,
    torque_n_m: f64,
    speed_turns_s: f64,
    fed_s: f64,
    answers_from_s: f64,
}

fn stored() -> BTreeMap<&'static str, f64> {
    BTreeMap::from([
        ("fw_version_major", 0.0),
        ("fw_version_minor", 5.0),
        ("axis0.config.enable_watchdog", 0.0),
        ("axis0.config.watchdog_timeout", 0.0),
        ("axis0.motor.config.torque_constant", 0.0625),
    ])
}

impl ODrive {
    /// One with the rig's motor on it.
    pub fn new(make: Make, rig: &Rig) -> Self {
        Self {
            make,
            stand: Stand::new(rig),
            held: String::new(),
            properties: stored(),
            error: 0,
            state: IDLE,
            torque_n_m: 0.0,
            speed_turns_s: 0.0,
            fed_s: 0.0,
            answers_from_s: 0.0,
        }
    }

    fn property(&self, name: &str) -> f64 {
        self.properties.get(name).copied().unwrap_or(0.0)
    }

    fn command(&self) -> f64 {
        if self.state != CLOSED_LOOP || self.error != 0 {
            return 0.0;
        }
        match self.stand.kind() {
            AmplifierKind::Speed => self.speed_turns_s * TAU,
            _ => self.torque_n_m / self.property("axis0.motor.config.torque_constant"),
        }
    }

    /// The lines that answer one.
    fn act(&mut self, now_s: f64, words: &str) -> Vec<String> {
        if words.trim() != "i" {
            return self.act_alone(now_s, words).into_iter().collect();
        }
        let lines = ["Hardware version: 3.6-56V", "Firmware version: 0.5.6"].map(str::to_owned);
        let number = self.make.serial_number.map(|number| format!("Serial number: {number}"));
        lines.into_iter().chain(number).collect()
    }

    fn act_alone(&mut self, now_s: f64, words: &str) -> Option<String> {
        let mut words = words.split_whitespace();
        let (command, mut rest) = (words.next()?, words.map(str::to_owned));
        let mut number = || rest.next().and_then(|word| word.parse::<f64>().ok());
        match command {
            "c" | "v" | "u" => {
                (number()? == 0.0).then_some(())?;
                match command {
                    "c" => self.torque_n_m = number()?,
                    "v" => self.speed_turns_s = number()?,
                    _ => (),
                }
                self.fed_s = now_s;
            }
            "f" => {
                let (angle, speed) =
                    (self.stand.shaft_angle_rad() / TAU, self.stand.shaft_speed_rad_s() / TAU);
                return Some(format!("{angle:.6} {speed:.6}"));
            }
            "sc" => self.error = 0,
            "r" => return Some(self.read(&rest.next()?).chars().take(PRINTED).collect()),
            "w" => {
                let name = rest.next()?;
                let value = rest.next()?.parse::<f64>().ok()?;
                if name == "axis0.requested_state" {
                    // Closed loop is not entered with an error standing.
                    let enters = value == f64::from(CLOSED_LOOP) && self.error == 0;
                    self.state = if enters { CLOSED_LOOP } else { IDLE };
                } else if let Some((_, held)) = self.properties.iter_mut().find(|(held, _)| **held == name) {
                    if !self.make.read_only {
                        *held = value;
                    }
                } else {
                    return Some("invalid property".into());
                }
            }
            _ => return Some("unknown command".into()),
        }
        None
    }

    fn read(&self, name: &str) -> String {
        match name {
            "axis0.motor.current_control.Iq_measured" => format!("{:.6}", self.stand.current_a()),
            "vbus_voltage" => format!("{:.6}", self.stand.supply_v()),
            "axis0.error" => self.error.to_string(),
            "axis0.current_state" => self.state.to_string(),
            name => match self.properties.get(name) {
                Some(value) if name.starts_with("fw_") || name.ends_with("enable_watchdog") => {
                    format!("{value:.0}")
                }
                Some(value) => format!("{value:.6}"),
                // Its own refusals are words, which nothing cuts short.
                None => "invalid property".into(),
            },
        }
    }
}

impl Device for ODrive {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        if now_s < self.answers_from_s {
            return Vec::new();
        }
        self.held += &String::from_utf8_lossy(bytes);
        let mut answers = Vec::new();
        while let Some((line, rest)) = self.held.split_once('\n') {
            let (line, rest) = (line.to_owned(), rest.to_owned());
            self.held = rest;
            // With a check sum the answer has one too; a wrong one is not answered.
            let (words, sum) = match line.split_once('*') {
                Some((words, sum)) => (words, Some(sum.trim().parse::<u8>())),
                None => (line.as_str(), None),
            };
            let right = words.bytes().reduce(|a, b| a ^ b).unwrap_or(0);
            if sum.as_ref().is_some_and(|sum| *sum != Ok(right)) {
                continue;
            }
            for answer in self.act(now_s, words) {
                let end = sum
                    .as_ref()
                    .map_or(String::new(), |_| format!("*{}", answer.bytes().fold(0, |a, b| a ^ b)));
                answers.push(format!("{answer}{end}\r\n").into_bytes());
            }
        }
        answers
    }

    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        let on = self.property("axis0.config.enable_watchdog") == 1.0;
        if on && now_s - self.fed_s > self.property("axis0.config.watchdog_timeout") {
            self.error |= WATCHDOG_EXPIRED;
        }
        if self.error != 0 {
            self.state = IDLE;
        }
        self.stand.turn_to(now_s, self.command());
        Vec::new()
    }

    fn restart(&mut self, now_s: f64) {
        self.properties = stored();
        (self.error, self.state, self.torque_n_m, self.speed_turns_s) = (0, IDLE, 0.0, 0.0);
        self.answers_from_s = now_s + BOOT_S;
        self.held.clear();
    }

    fn report(&mut self, code: u32) {
        self.error = u64::from(code);
    }

    fn truth(&self) -> Truth {
        self.stand.truth(self.command())
    }
}
