//! What is said to a VESC and understood of it.

use std::f64::consts::TAU;

use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;

use super::Vesc;
use super::frame::{Deframer, PAYLOAD_MAX, frame};
use crate::link::{self, Heard};

// Commands, by their number in the firmware.
const FW_VERSION: u8 = 0;
const SET_DUTY: u8 = 5;
const SET_CURRENT: u8 = 6;
const SET_RPM: u8 = 8;
const GET_APPCONF: u8 = 17;
const GET_VALUES_SELECTIVE: u8 = 50;
const SET_APPCONF_NO_STORE: u8 = 149;

/// Major versions of the firmware that are spoken.
const FIRMWARE: std::ops::RangeInclusive<u8> = 6..=7;
/// The values asked for: motor temperature, iq, speed, supply, both step counters, fault, controller's id, status.
const VALUES: u32 = 1 << 1 | 1 << 5 | 1 << 7 | 1 << 8 | 1 << 13 | 1 << 14 | 1 << 15 | 1 << 17 | 1 << 21;
/// Longest answer while driving.
const VALUES_MAX: usize = 64;
/// App configuration behind the command: signature (4), controller's id (1), time-out in ms (4), braking current (4), …
const TIMEOUT_AT: usize = 6;
const BRAKE_AT: usize = 10;
const BRAKE_END: usize = 14;
/// Steps of the counters in an electrical turn.
const STEPS: f64 = 6.0;
/// Questions without a confirmed answer before the reason is said.
const ASKED_IN_VAIN: u32 = 10;
/// Motor temperatures outside this are of a sensor that is not there, deg C.
const TEMPERATURE: std::ops::Range<f64> = -50.0..250.0;

/// How far the drive is known.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Which firmware and which device?
    Version,
    /// Which time-out?
    Settings,
    /// The time-out is being set; then it is read again.
    Setting,
    Guarded,
    /// Not to be driven, for a reason that was said.
    Refused,
}

/// One conversation with a VESC.
pub struct Protocol {
    vesc: Vesc,
    deframer: Deframer,
    stage: Stage,
    asked: u32,
    set: bool,
    /// The app configuration with the time-out as it must be, as it is sent.
    settings: Vec<u8>,
    supply_v: f64,
    steps: Option<u32>,
}

impl Protocol {
    /// Before the first word.
    pub fn new(vesc: Vesc) -> Self {
        Self {
            supply_v: vesc.supply_v,
            vesc,
            deframer: Deframer::default(),
            stage: Stage::Version,
            asked: 0,
            set: false,
            settings: Vec::with_capacity(PAYLOAD_MAX),
            steps: None,
        }
    }

    /// One answer.
    fn answer(&mut self, payload: &[u8], heard: &mut dyn FnMut(Heard)) {
        match (payload.split_first(), self.stage) {
            (Some((&FW_VERSION, rest)), Stage::Version) => self.version(rest, heard),
            (Some((&GET_APPCONF, _)), Stage::Settings) => self.time_out(payload, heard),
            (Some((&SET_APPCONF_NO_STORE, _)), Stage::Setting) => self.stage = Stage::Settings,
            (Some((&GET_VALUES_SELECTIVE, rest)), Stage::Guarded) => self.values(rest, heard),
            _ => (),
        }
    }

    /// `major minor name 0 uuid(12) …`
    fn version(&mut self, rest: &[u8], heard: &mut dyn FnMut(Heard)) {
        let [major, minor, rest @ ..] = rest else { return };
        let name_end = rest.iter().position(|b| *b == 0).unwrap_or(rest.len());
        let uuid = rest.get(name_end + 1..name_end + 13).unwrap_or_default();
        let uuid: String = uuid.iter().map(|b| format!("{b:02x}")).collect();
        let name = String::from_utf8_lossy(rest.get(..name_end).unwrap_or_default()).into_owned();
        self.asked = 0;
        heard(Heard::Known(format!("{name}, firmware {major}.{minor:02}, identity {uuid}")));
        if !FIRMWARE.contains(major) {
            self.stage = Stage::Refused;
            heard(Heard::Unguarded(format!(
                "firmware {major}.{minor:02} of {name}; allowed is {} to {}\nhint: VESC Tool brings it up to date",
                FIRMWARE.start(),
                FIRMWARE.end()
            )));
        } else if let Some(words) = self.vesc.wired.is_another(&uuid) {
            self.stage = Stage::Refused;
            heard(Heard::Unguarded(words));
        } else {
            self.stage = Stage::Settings;
        }
    }

    fn time_out(&mut self, payload: &[u8], heard: &mut dyn FnMut(Heard)) {
        let (Some(timeout), Some(brake)) = (
            payload.get(TIMEOUT_AT..BRAKE_AT).and_then(|b| b.try_into().ok()).map(u32::from_be_bytes),
            payload.get(BRAKE_AT..BRAKE_END).and_then(|b| b.try_into().ok()).map(u32::from_be_bytes),
        ) else {
            return;
        };
        let most_ms = (self.vesc.wired.timeout_s * 1e3).round() as u32;
        self.asked = 0;
        // A braking current of zero is all zeros; the sign of a zero does not matter.
        if (1..=most_ms).contains(&timeout) && brake << 1 == 0 {
            self.stage = Stage::Guarded;
            self.deframer.longest = VALUES_MAX;
            heard(Heard::Guarded(format!("its own time-out is {timeout} ms, without braking")));
        } else if self.set {
            self.stage = Stage::Refused;
            heard(Heard::Unguarded(format!(
                "its time-out stays {timeout} ms{}; allowed is 1 to {most_ms} ms without braking\nhint: VESC Tool, App Settings, General",
                if brake << 1 == 0 { "" } else { " with a braking current" }
            )));
        } else {
            self.settings.clear();
            self.settings.extend_from_slice(payload);
            if let Some(command) = self.settings.first_mut() {
                *command = SET_APPCONF_NO_STORE;
            }
            let wanted = most_ms.to_be_bytes().into_iter().chain([0; 4]);
            for (byte, wanted) in self.settings.iter_mut().skip(TIMEOUT_AT).zip(wanted) {
                *byte = wanted;
            }
            self.stage = Stage::Setting;
            self.set = true;
        }
    }

    /// The values of [`VALUES`], in the order of their bits, behind the mask.
    fn values(&mut self, rest: &[u8], heard: &mut dyn FnMut(Heard)) {
        let mut read = Reader(rest);
        let (Some(VALUES), Some(temperature), Some(iq), Some(erpm), Some(supply), Some(steps), Some(total)) =
            (read.u32(), read.i16(), read.i32(), read.i32(), read.i16(), read.i32(), read.u32())
        else {
            return;
        };
        let [fault, _id, status] = *read.0 else { return };
        if self.steps.replace(total).is_some_and(|before| before.wrapping_sub(total) as i32 > 0) {
            return heard(Heard::Restarted);
        }
        // A kill switch is as good as a fault: the drive takes no command.
        let fault = if fault == 0 && status & 2 != 0 { KILL_SWITCH } else { fault };
        heard(Heard::Fault((fault != 0).then(|| fault_words(fault))));
        let (sign, pairs) = (self.vesc.wired.sign(), self.vesc.pole_pairs);
        let temperature_c = f64::from(temperature) * 0.1;
        self.supply_v = f64::from(supply) * 0.1;
        heard(Heard::Reading(Signals {
            current_a: sign * f64::from(iq) * 0.01,
            shaft_speed_rad_s: sign * f64::from(erpm) / pairs * TAU / 60.0,
            shaft_angle_rad: sign * f64::from(steps) / (STEPS * pairs) * TAU,
            supply_v: self.supply_v,
            temperature_c: if TEMPERATURE.contains(&temperature_c) { temperature_c } else { f64::NAN },
            ..Signals::UNKNOWN
        }));
    }
}

impl link::Protocol for Protocol {
    fn begin(&mut self) {
        // The supply it told last is nearer than the rig's.
        *self = Self { supply_v: self.supply_v, ..Self::new(self.vesc.clone()) };
    }

    fn ask(&mut self, out: &mut Vec<u8>, heard: &mut dyn FnMut(Heard)) {
        if self.asked == ASKED_IN_VAIN {
            let why = match self.stage {
                Stage::Setting => {
                    "does not take its settings: its time-out is not as it must be\nhint: VESC Tool, App Settings, General: time-out, without a braking current"
                }
                Stage::Settings => {
                    "does not tell its app settings, and its time-out with them\nhint: is the firmware whole?"
                }
                _ => {
                    "does not answer\nhint: baud rate, wiring (TX to RX), and UART switched on in VESC Tool, App Settings"
                }
            };
            // One that was refused has been told why.
            if self.stage != Stage::Refused {
                heard(Heard::Unguarded(why.to_owned()));
            }
            // Perhaps an answer was lost, or the drive is another one by now: from the beginning.
            self.begin();
        }
        self.asked += 1;
        match self.stage {
            Stage::Version => frame(&[FW_VERSION], out),
            Stage::Settings => frame(&[GET_APPCONF], out),
            Stage::Setting => frame(&self.settings, out),
            Stage::Guarded | Stage::Refused => (),
        }
    }

    fn tell(&mut self, drive: Option<f64>, question: bool, out: &mut Vec<u8>) {
        let sign = self.vesc.wired.sign();
        let scaled = |value: f64, scale: f64| (sign * value * scale).round() as i32;
        let (command, value) = match (drive, self.vesc.kind) {
            // A drive that knows no supply cannot be given volts.
            (Some(volts), DriveKind::Voltage) if self.supply_v > 0.0 => {
                (SET_DUTY, scaled((volts / self.supply_v).clamp(-1.0, 1.0), 1e5))
            }
            (None, _) | (_, DriveKind::Voltage) => (SET_CURRENT, 0),
            (Some(amperes), DriveKind::Current) => (SET_CURRENT, scaled(amperes, 1e3)),
            (Some(duty), DriveKind::Duty) => (SET_DUTY, scaled(duty.clamp(-1.0, 1.0), 1e5)),
            (Some(speed), DriveKind::Speed) => (SET_RPM, scaled(speed, 60.0 / TAU * self.vesc.pole_pairs)),
        };
        let [a, b, c, d] = value.to_be_bytes();
        frame(&[command, a, b, c, d], out);
        if question {
            let [a, b, c, d] = VALUES.to_be_bytes();
            frame(&[GET_VALUES_SELECTIVE, a, b, c, d], out);
        }
    }

    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard)) {
        for payload in self.deframer.take(bytes) {
            self.answer(&payload, heard);
        }
    }
}

/// Big-endian numbers, one after the other.
struct Reader<'a>(&'a [u8]);

impl Reader<'_> {
    fn bytes<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (bytes, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*bytes)
    }
    fn i16(&mut self) -> Option<i16> {
        self.bytes().map(i16::from_be_bytes)
    }
    fn i32(&mut self) -> Option<i32> {
        self.bytes().map(i32::from_be_bytes)
    }
    fn u32(&mut self) -> Option<u32> {
        self.bytes().map(u32::from_be_bytes)
    }
}

/// No code of the firmware's.
const KILL_SWITCH: u8 = 255;

/// A fault in the firmware's words.
fn fault_words(code: u8) -> String {
    let name = match code {
        1 => "over-voltage",
        2 => "under-voltage",
        3 => "gate driver",
        4 => "absolute over-current",
        5 => "transistors too hot",
        6 => "motor too hot",
        7 => "gate driver over-voltage",
        8 => "gate driver under-voltage",
        9 => "controller under-voltage",
        10 => "started after a reset by its watchdog",
        11..=13 | 25..=26 | 28 | 30 => "encoder",
        14 | 23 | 24 => "corrupted flash",
        15..=17 => "offset of a current sensor",
        18 => "unbalanced currents",
        19 => "brake",
        20..=22 => "resolver",
        27 => "phase filter",
        29 => "output",
        31 => "over-speed",
        32 => "under-speed",
        KILL_SWITCH => return "its kill switch is active".into(),
        _ => "unknown to kort",
    };
    format!("it reports fault {code}: {name}")
}
