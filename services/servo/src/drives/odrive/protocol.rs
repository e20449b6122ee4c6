//! What is said to an ODrive and understood of it.

use std::f64::consts::TAU;

use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;

use super::ODrive;
use super::text::{line, words};
use crate::link::{self, Heard, Lines};

/// Error bit of the axis that every silence leaves.
const WATCHDOG_EXPIRED: u64 = 1 << 11;
/// States of the axis.
const IDLE: f64 = 1.0;
const CLOSED_LOOP: f64 = 8.0;
/// Questions without a whole answer before the reason is said.
const ASKED_IN_VAIN: u32 = 10;
/// Exchanges that the axis may take to enter closed loop.
const ENTERING: u32 = 100;

/// What lines of the answer to `i` begin with; the number is in the last one.
const FIRMWARE: &str = "Firmware version: ";
const SERIAL_NUMBER: &str = "Serial number: ";
/// Questions for the number before one that nobody asked for is done without.
const NUMBER_ASKED: u32 = 3;
/// Properties asked for behind `f 0` at the start, in this order.
const SETTINGS: [&str; 6] = [
    "fw_version_major",
    "fw_version_minor",
    "axis0.config.enable_watchdog",
    "axis0.config.watchdog_timeout",
    "axis0.motor.config.torque_constant",
    "axis0.error",
];
/// And in each exchange.
const VALUES: [&str; 5] = [
    "axis0.motor.current_control.Iq_measured",
    "vbus_voltage",
    "axis0.error",
    "axis0.current_state",
    "axis0.config.enable_watchdog",
];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Which one is it? Nothing is set in another one.
    Number,
    Settings,
    Guarded,
    /// Not to be driven, for a reason that was said.
    Refused,
}

/// One conversation with an ODrive.
pub struct Protocol {
    odrive: ODrive,
    lines: Lines,
    stage: Stage,
    asked: u32,
    known: bool,
    /// Its firmware, by its own words.
    firmware: Option<String>,
    /// Its number was just told: the next question need not wait.
    go_on: bool,
    /// The next question was asked so.
    gone_on: bool,
    /// The time-out was set; what is read next must be it.
    set: bool,
    /// The error that silence leaves is to be cleared.
    clear: bool,
    torque_constant_nm_a: f64,
    /// Angle and speed of the answer under way, turns and turns a second, and the numbers behind them.
    moving: Option<(f64, f64)>,
    numbers: Vec<f64>,
    on: bool,
    exchanges_on: u32,
}

impl Protocol {
    /// Before the first word.
    pub fn new(odrive: ODrive) -> Self {
        Self {
            odrive,
            lines: Lines::default(),
            stage: Stage::Number,
            asked: 0,
            known: false,
            firmware: None,
            go_on: false,
            gone_on: false,
            set: false,
            clear: false,
            torque_constant_nm_a: f64::NAN,
            moving: None,
            numbers: Vec::new(),
            on: false,
            exchanges_on: 0,
        }
    }

    /// An answer begins with the two numbers of `f 0` and goes on with one a line; what comes otherwise is none, and
    /// neither is one with a line lost.
    fn line(&mut self, words: &str, heard: &mut dyn FnMut(Heard)) {
        if let Some(firmware) = words.strip_prefix(FIRMWARE) {
            self.firmware = Some(firmware.trim().to_owned());
        }
        if let Some(number) = words.strip_prefix(SERIAL_NUMBER) {
            return self.number(&number.trim().to_ascii_lowercase(), heard);
        }
        let numbers: Vec<f64> = words.split(' ').filter_map(|word| word.parse().ok()).collect();
        let wanted = if self.stage == Stage::Guarded { VALUES.len() } else { SETTINGS.len() };
        match (numbers.as_slice(), self.moving) {
            (&[turns, turns_s], _) => {
                self.moving = Some((turns, turns_s));
                self.numbers.clear();
            }
            (&[number], Some(moving)) => {
                self.numbers.push(number);
                if self.numbers.len() == wanted {
                    self.moving = None;
                    let numbers = std::mem::take(&mut self.numbers);
                    if self.stage == Stage::Guarded {
                        self.values(moving, &numbers, heard);
                    } else {
                        self.settings(&numbers, heard);
                    }
                }
            }
            _ => self.moving = None,
        }
    }

    /// Its number.
    fn number(&mut self, number: &str, heard: &mut dyn FnMut(Heard)) {
        self.moving = None;
        let is_one = !number.is_empty() && number.bytes().all(|digit| digit.is_ascii_hexdigit());
        if self.stage != Stage::Number || !is_one {
            return;
        }
        self.asked = 0;
        self.is_there(number, heard);
        match self.odrive.wired.is_another(number) {
            Some(words) => self.refuse(words, heard),
            None => (self.stage, self.go_on) = (Stage::Settings, true),
        }
    }

    /// Says once who answers.
    fn is_there(&mut self, number: &str, heard: &mut dyn FnMut(Heard)) {
        if !std::mem::replace(&mut self.known, true) {
            let firmware = self.firmware.as_deref().unwrap_or("not told");
            heard(Heard::Known(format!("ODrive, firmware {firmware}, identity {number}")));
        }
    }

    fn settings(&mut self, numbers: &[f64], heard: &mut dyn FnMut(Heard)) {
        let [major, minor, enabled, timeout_s, torque_constant_nm_a, error] = *numbers else { return };
        if self.stage == Stage::Refused {
            return;
        }
        self.asked = 0;
        self.is_there("not told", heard);
        let most_s = self.odrive.wired.timeout_s;
        if (major, minor) != (0.0, 5.0) {
            self.refuse(
                format!("firmware {major}.{minor}; allowed is 0.5\nhint: newer boards speak CAN better"),
                heard,
            );
        } else if torque_constant_nm_a.is_nan() || torque_constant_nm_a <= 0.0 {
            let words = format!(
                "its motor.config.torque_constant is {torque_constant_nm_a}\nhint: set up the motor in odrivetool"
            );
            self.refuse(words, heard);
        } else if enabled == 1.0 && timeout_s > 0.0 && timeout_s <= most_s * 1.001 && self.set {
            // A watchdog that ran out before kort came is no fault; it is cleared, and must stay so.
            self.clear = error as u64 == WATCHDOG_EXPIRED;
            if self.clear {
                return;
            }
            self.torque_constant_nm_a = torque_constant_nm_a;
            self.stage = Stage::Guarded;
            heard(Heard::Guarded(format!("its own watchdog is {} ms", timeout_s * 1e3)));
        } else if self.set {
            let words = format!(
                "its watchdog stays {}, {} ms; allowed is on, at most {} ms\nhint: odrivetool: axis0.config.enable_watchdog, watchdog_timeout",
                if enabled == 1.0 { "on" } else { "off" },
                timeout_s * 1e3,
                most_s * 1e3
            );
            self.refuse(words, heard);
        }
    }

    /// Off, then what kort needs of it, and asks for it; the error that silence left goes last, when the watchdog is fed again.
    fn set(&mut self, out: &mut Vec<u8>) {
        line(&format!("w axis0.requested_state {IDLE}"), out);
        line(&format!("w axis0.config.watchdog_timeout {}", self.odrive.wired.timeout_s), out);
        line("u 0", out);
        line("w axis0.config.enable_watchdog 1", out);
        line("u 0", out);
        if std::mem::take(&mut self.clear) {
            line("sc", out);
        }
        self.set = true;
        ask_for(&SETTINGS, out);
    }

    fn refuse(&mut self, words: String, heard: &mut dyn FnMut(Heard)) {
        self.stage = Stage::Refused;
        heard(Heard::Unguarded(words));
    }

    fn values(&mut self, (turns, turns_s): (f64, f64), numbers: &[f64], heard: &mut dyn FnMut(Heard)) {
        let [iq_a, supply_v, error, state, enabled] = *numbers else { return };
        if enabled != 1.0 {
            return heard(Heard::Restarted);
        }
        self.exchanges_on = if self.on { self.exchanges_on.saturating_add(1) } else { 0 };
        heard(Heard::Fault(if error != 0.0 {
            Some(format!(
                "it reports axis error {:#x}: {}\nhint: odrivetool: dump_errors(odrv0), then odrv0.clear_errors()",
                error as u64,
                error_names(error as u64)
            ))
        } else if self.exchanges_on > ENTERING && state != CLOSED_LOOP {
            Some(format!(
                "its axis is in state {state}, not in closed loop control\nhint: calibrate it in odrivetool"
            ))
        } else {
            None
        }));
        let sign = self.odrive.wired.sign();
        heard(Heard::Reading(Signals {
            current_a: sign * iq_a,
            shaft_speed_rad_s: sign * turns_s * TAU,
            shaft_angle_rad: sign * turns * TAU,
            supply_v,
            ..Signals::UNKNOWN
        }));
    }
}

fn ask_for(properties: &[&str], out: &mut Vec<u8>) {
    line("f 0", out);
    for property in properties {
        line(&format!("r {property}"), out);
    }
}

impl link::Protocol for Protocol {
    fn begin(&mut self) {
        *self = Self::new(self.odrive.clone());
    }

    fn ask(&mut self, out: &mut Vec<u8>, heard: &mut dyn FnMut(Heard)) {
        if self.asked == ASKED_IN_VAIN {
            let nameless = self.odrive.wired.is_nameless();
            let nameless = nameless.filter(|_| self.stage == Stage::Number && self.firmware.is_some());
            if nameless.is_some() {
                self.is_there("not told", heard);
            }
            // One that was refused has been told why, and is asked anew.
            if self.stage != Stage::Refused {
                heard(Heard::Unguarded(nameless.unwrap_or_else(|| {
                    "does not answer in full\nhint: is its ASCII protocol on (config.enable_uart_a, or USB), is it an ODrive of firmware 0.5?".into()
                })));
            }
            self.begin();
        }
        self.asked += 1;
        if self.stage == Stage::Number && self.asked > NUMBER_ASKED && self.odrive.wired.identity.is_empty() {
            self.stage = Stage::Settings;
        }
        match self.stage {
            Stage::Number => line("i", out),
            // A slow line still carries the answer to what went out behind the number.
            Stage::Settings if !std::mem::take(&mut self.gone_on) => self.set(out),
            Stage::Settings | Stage::Guarded | Stage::Refused => (),
        }
    }

    fn reply(&mut self, out: &mut Vec<u8>) {
        if std::mem::take(&mut self.go_on) {
            self.gone_on = true;
            self.set(out);
        }
    }

    fn tell(&mut self, drive: Option<f64>, question: bool, out: &mut Vec<u8>) {
        let sign = self.odrive.wired.sign();
        match drive {
            Some(drive) => {
                match self.odrive.kind {
                    DriveKind::Speed => line(&format!("v 0 {:.6} 0", sign * drive / TAU), out),
                    _ => line(&format!("c 0 {:.6}", sign * drive * self.torque_constant_nm_a), out),
                }
                if !self.on {
                    line(&format!("w axis0.requested_state {CLOSED_LOOP}"), out);
                }
            }
            None => {
                line("c 0 0", out);
                line(&format!("w axis0.requested_state {IDLE}"), out);
            }
        }
        self.on = drive.is_some();
        if question {
            ask_for(&VALUES, out);
        }
    }

    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard)) {
        for line in self.lines.take(bytes) {
            // A line whose check sum is wrong counts as one without numbers: there was one.
            self.line(words(&line).unwrap_or_default(), heard);
        }
    }
}

/// Bits of an axis error by the firmware's names.
const ERRORS: [(u32, &str); 12] = [
    (0, "invalid state"),
    (6, "motor failed"),
    (7, "sensorless estimator failed"),
    (8, "encoder failed"),
    (9, "controller failed"),
    (11, "watchdog timer expired"),
    (12, "min endstop pressed"),
    (13, "max endstop pressed"),
    (14, "estop requested"),
    (17, "homing without endstop"),
    (18, "over-temperature"),
    (19, "unknown position"),
];

fn error_names(bits: u64) -> String {
    let known = ERRORS.iter().filter(|(bit, _)| bits >> bit & 1 == 1).map(|(_, name)| *name);
    let rest = ERRORS.iter().fold(bits, |rest, (bit, _)| rest & !(1 << bit));
    known.chain((rest != 0).then_some("others unknown to kort")).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::super::{OWN, READING_LIFE_MS};
    use super::*;
    use crate::link::Protocol as _;
    use kort_proto::config::Config;

    /// The longest exchange on the slowest usual wire, four times: the way of the answer that stands, the patience with one
    /// that is lost, and the way of the next; half as much again is left over.
    #[test]
    fn a_reading_lives_for_longer_than_a_lost_answer_takes() {
        let text = "[thrusters.t1]\nrig = \"r\"\namplifier = \"odrive\"\ndrive = { port = \"/dev/p\" }\n";
        let config = Config::parse(text, None).unwrap();
        let (thruster, mut wrong) = (config.thruster("t1").unwrap(), Vec::new());
        let wired = crate::drives::Wired::read(&config, "t1", thruster, &OWN, &mut wrong).unwrap();
        assert_eq!(wired.reading_life_ns as f64, READING_LIFE_MS * 1e6);
        let mut out = Vec::new();
        let mut protocol = Protocol::new(ODrive { wired, kind: DriveKind::Current });
        (protocol.torque_constant_nm_a, protocol.on) = (0.0625, true);
        protocol.tell(Some(-123.456_789), true, &mut out);
        for answer in ["-1234567.123456 -123.456789", "-123.4567", "123.45678", "4294967295", "8", "1"] {
            line(answer, &mut out);
        }
        let way_ms = out.len() as f64 * 10.0 / 115.2;
        assert!((20.0..26.0).contains(&way_ms), "{} bytes, {way_ms} ms", out.len());
        assert!(READING_LIFE_MS >= 1.5 * 4.0 * way_ms - 5.0, "{way_ms} ms");
    }

    #[test]
    fn each_bit_of_an_error_has_its_name() {
        assert_eq!(error_names(0x840), "motor failed, watchdog timer expired");
        assert_eq!(error_names(1 << 18 | 1 << 2), "over-temperature, others unknown to kort");
    }
}
