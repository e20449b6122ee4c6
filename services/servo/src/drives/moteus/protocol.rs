//! What is said to a moteus and understood of it.

use std::f64::consts::TAU;

use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;

use super::Moteus;
use super::text::{receive, send};
use crate::link::{self, Heard, Lines};

// Parts of a frame; the two lowest bits of writes, reads and answers count the registers, zero: the next byte does.
const WRITE_INT8: u8 = 0x00;
const WRITE_FLOAT: u8 = 0x0c;
const READ_INT32: u8 = 0x18;
const READ_FLOAT: u8 = 0x1c;
const REPLY_INT32: u8 = 0x28;
const REPLY_FLOAT: u8 = 0x2c;
const STREAM_TO_DRIVE: u8 = 0x40;
const STREAM_FROM_DRIVE: u8 = 0x41;
const STREAM_POLL: u8 = 0x42;
const STREAM_CHANNEL: u8 = 1;
const STREAM_MAX: u8 = 48;
const NOP: u8 = 0x50;

// Registers.
const MODE: usize = 0x00;
const POSITION: usize = 0x01;
const VELOCITY: usize = 0x02;
const Q_CURRENT: usize = 0x04;
const VOLTAGE: usize = 0x0d;
const FAULT: usize = 0x0f;
const COMMAND_POSITION: u8 = 0x20;
const TIMEOUT: u8 = 0x27;
const MILLISECONDS: u8 = 0x70;
/// Three words, the least significant first.
const SERIAL_NUMBER: usize = 0x120;
const SERIAL_WORDS: usize = 3;
/// Registers whose answers are kept.
const KEPT: usize = 0x10;

// Modes.
const STOPPED: u8 = 0;
const IN_FAULT: f64 = 1.0;
const IN_POSITION: f64 = 10.0;
const TIMED_OUT: f64 = 11.0;

/// Questions without a confirmed answer before the reason is said.
const ASKED_IN_VAIN: u32 = 12;
/// Exchanges that the drive may take to enter position mode.
const ENTERING: u32 = 50;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// `conf get servo.timeout_mode` was said, and its answer is asked for.
    Asking,
    /// It differs: `conf set` was said.
    Setting,
    Guarded,
    /// Not to be driven, for a reason that was said.
    Refused,
}

/// One conversation with a moteus.
pub struct Protocol {
    moteus: Moteus,
    lines: Lines,
    /// The far end uses check sums.
    checked: bool,
    stage: Stage,
    asked: u32,
    known: bool,
    /// Its number, once it was told.
    serial_number: Option<String>,
    set: bool,
    /// What came through the diagnostic channel and is no whole line yet.
    said: String,
    milliseconds: Option<i32>,
    on: bool,
    exchanges_on: u32,
}

impl Protocol {
    /// Before the first word.
    pub fn new(moteus: Moteus) -> Self {
        Self {
            moteus,
            lines: Lines::default(),
            checked: false,
            stage: Stage::Asking,
            asked: 0,
            known: false,
            serial_number: None,
            set: false,
            said: String::new(),
            milliseconds: None,
            on: false,
            exchanges_on: 0,
        }
    }

    fn send(&self, data: &[u8], answer: bool, out: &mut Vec<u8>) {
        let id = u16::from(self.moteus.address) | if answer { 0x8000 } else { 0 };
        send(id, data, self.checked, out);
    }

    /// A line to the diagnostic channel.
    fn say(&self, words: &str, out: &mut Vec<u8>) {
        let mut data = vec![STREAM_TO_DRIVE, STREAM_CHANNEL, words.len() as u8 + 1];
        data.extend(words.bytes());
        data.push(b'\n');
        self.send(&data, false, out);
    }

    fn frame(&mut self, data: &[u8], heard: &mut dyn FnMut(Heard)) {
        match data {
            [STREAM_FROM_DRIVE, STREAM_CHANNEL, length, rest @ ..] => {
                let text = rest.get(..usize::from(*length)).unwrap_or_default();
                self.said += &String::from_utf8_lossy(text);
                // A line that never ends is none.
                if self.said.len() > 200 {
                    self.said.clear();
                }
                while let Some((line, rest)) = self.said.split_once('\n') {
                    let (line, rest) = (line.trim().to_owned(), rest.to_owned());
                    self.said = rest;
                    self.diagnostic(&line, heard);
                }
            }
            data => self.registers(data, heard),
        }
    }

    /// Answers of the diagnostic channel: a number for `conf get`, OK for `conf set`.
    fn diagnostic(&mut self, line: &str, heard: &mut dyn FnMut(Heard)) {
        if !std::mem::replace(&mut self.known, true) {
            let number = self.serial_number.as_deref().unwrap_or("not told");
            heard(Heard::Known(format!("moteus {}, identity {number}", self.moteus.address)));
        }
        if self.stage == Stage::Refused {
            return;
        }
        let wired = &self.moteus.wired;
        let another = match &self.serial_number {
            Some(number) => wired.is_another(number),
            // An answer that was lost is asked for again.
            None if wired.is_nameless().is_some() => return,
            None => None,
        };
        if let Some(words) = another {
            self.stage = Stage::Refused;
            return heard(Heard::Unguarded(words));
        }
        match (self.stage, line) {
            (Stage::Asking, "0") => {
                self.stage = Stage::Guarded;
                let ms = self.moteus.wired.timeout_s * 1e3;
                heard(Heard::Guarded(format!("after {ms} ms without a command it stops, without braking")));
            }
            (Stage::Asking, mode) if mode.parse::<u32>().is_ok() => {
                if self.set {
                    self.stage = Stage::Refused;
                    heard(Heard::Unguarded(format!(
                        "its servo.timeout_mode stays {mode}; allowed is 0, stopped\nhint: tview: conf set servo.timeout_mode 0, conf write"
                    )));
                } else {
                    self.stage = Stage::Setting;
                    self.asked = 0;
                }
            }
            (Stage::Asking, words) if words.starts_with("ERR") => {
                self.stage = Stage::Refused;
                heard(Heard::Unguarded(format!(
                    "it does not know servo.timeout_mode: `{words}`\nhint: newer firmware by moteus_tool --flash"
                )));
            }
            (Stage::Setting, "OK") => {
                self.set = true;
                self.stage = Stage::Asking;
                self.asked = 0;
            }
            _ => (),
        }
    }

    /// Answers of registers; the float ones, and the millisecond counter.
    fn registers(&mut self, mut data: &[u8], heard: &mut dyn FnMut(Heard)) {
        let mut kept = [f64::NAN; KEPT];
        let mut milliseconds = None;
        let mut serial = [None; SERIAL_WORDS];
        while let Some((&part, rest)) = data.split_first() {
            data = rest;
            if part == NOP {
                continue;
            }
            let (kind, mut count) = (part & !3, u32::from(part & 3));
            if !matches!(kind, REPLY_FLOAT | REPLY_INT32) {
                return;
            }
            if count == 0 {
                let Some((number, rest)) = varuint(data) else { return };
                (count, data) = (number, rest);
            }
            let Some((first, rest)) = varuint(data) else { return };
            data = rest;
            for register in (first as usize..).take(count as usize) {
                let Some((value, rest)) = data.split_first_chunk::<4>() else { return };
                data = rest;
                let word = register.checked_sub(SERIAL_NUMBER).and_then(|word| serial.get_mut(word));
                if kind == REPLY_INT32 && register == usize::from(MILLISECONDS) {
                    milliseconds = Some(i32::from_le_bytes(*value));
                } else if let Some(word) = word.filter(|_| kind == REPLY_INT32) {
                    *word = Some(u32::from_le_bytes(*value));
                } else if let Some(kept) = kept.get_mut(register).filter(|_| kind == REPLY_FLOAT) {
                    *kept = f64::from(f32::from_le_bytes(*value));
                }
            }
        }
        if let [Some(low), Some(middle), Some(high)] = serial {
            self.serial_number = Some(format!("{high:08x}{middle:08x}{low:08x}"));
        }
        if let Some(milliseconds) = milliseconds {
            self.values(&kept, milliseconds, heard);
        }
    }

    fn values(&mut self, kept: &[f64; KEPT], milliseconds: i32, heard: &mut dyn FnMut(Heard)) {
        match self.milliseconds.replace(milliseconds).map(|before| milliseconds.wrapping_sub(before)) {
            Some(..0) => return heard(Heard::Restarted),
            // The same answer once more tells nothing new.
            Some(0) => return,
            _ => (),
        }
        let mode = kept[MODE];
        self.exchanges_on = if self.on { self.exchanges_on.saturating_add(1) } else { 0 };
        heard(Heard::Fault(if mode == IN_FAULT {
            Some(format!(
                "it reports fault {}: {}\nhint: the moteus register reference, 0x00f",
                kept[FAULT],
                fault_name(kept[FAULT] as u8)
            ))
        } else if self.on && (mode == TIMED_OUT || self.exchanges_on > ENTERING && mode != IN_POSITION) {
            Some(format!(
                "it is in mode {mode}, not in position mode\nhint: has it been calibrated with moteus_tool?"
            ))
        } else {
            None
        }));
        let sign = self.moteus.wired.sign();
        heard(Heard::Reading(Signals {
            current_a: sign * kept[Q_CURRENT],
            shaft_speed_rad_s: sign * kept[VELOCITY] * TAU,
            shaft_angle_rad: sign * kept[POSITION] * TAU,
            supply_v: kept[VOLTAGE],
            ..Signals::UNKNOWN
        }));
    }
}

impl link::Protocol for Protocol {
    fn begin(&mut self) {
        *self = Self::new(self.moteus.clone());
    }

    fn ask(&mut self, out: &mut Vec<u8>, heard: &mut dyn FnMut(Heard)) {
        if self.asked == ASKED_IN_VAIN {
            // One that was refused has been told why, and is asked anew.
            if self.stage != Stage::Refused {
                let nameless = self.moteus.wired.is_nameless().filter(|_| self.known);
                heard(Heard::Unguarded(nameless.unwrap_or_else(|| {
                    "does not tell its servo.timeout_mode\nhint: `address`, bus wiring and termination, its supply".into()
                })));
            }
            self.begin();
        }
        self.asked += 1;
        if self.stage == Stage::Asking && self.serial_number.is_none() {
            let [low, high] = [SERIAL_NUMBER as u8 | 0x80, (SERIAL_NUMBER >> 7) as u8];
            self.send(&[READ_INT32 | SERIAL_WORDS as u8, low, high], true, out);
        }
        match self.stage {
            Stage::Asking => self.say("conf get servo.timeout_mode", out),
            Stage::Setting => self.say("conf set servo.timeout_mode 0", out),
            Stage::Guarded | Stage::Refused => return,
        }
        self.send(&[STREAM_POLL, STREAM_CHANNEL, STREAM_MAX], true, out);
    }

    fn tell(&mut self, drive: Option<f64>, question: bool, out: &mut Vec<u8>) {
        let sign = self.moteus.wired.sign();
        let mut data = Vec::with_capacity(64);
        match drive {
            None => data.extend([WRITE_INT8 | 1, 0, STOPPED]),
            Some(drive) => {
                let turns_s = |speed: f64| speed / TAU;
                // Position, velocity, feedforward torque, scales of both gains, largest torque.
                let command = match self.moteus.kind {
                    DriveKind::Speed => [f64::NAN, sign * turns_s(drive), 0.0, 1.0, 1.0, f64::NAN],
                    _ => [f64::NAN, 0.0, sign * drive * self.moteus.torque_constant_nm_a, 0.0, 0.0, f64::NAN],
                };
                data.extend([WRITE_INT8 | 1, 0, IN_POSITION as u8]);
                data.extend([WRITE_FLOAT, command.len() as u8, COMMAND_POSITION]);
                data.extend(command.iter().flat_map(|value| (*value as f32).to_le_bytes()));
                data.extend([WRITE_FLOAT | 1, TIMEOUT]);
                data.extend((self.moteus.wired.timeout_s as f32).to_le_bytes());
            }
        }
        if question {
            data.extend([
                READ_FLOAT,
                5,
                MODE as u8,
                READ_FLOAT | 3,
                VOLTAGE as u8,
                READ_INT32 | 1,
                MILLISECONDS,
            ]);
        }
        self.on = drive.is_some();
        self.send(&data, question, out);
    }

    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard)) {
        let answer = u32::from(self.moteus.address) << 8;
        for line in self.lines.take(bytes) {
            match receive(&line, &mut self.checked) {
                Some((id, data)) if id == answer => self.frame(&data, heard),
                _ => (),
            }
        }
    }
}

/// A number in parts of seven bits, the lowest first, each but the last with its highest bit set; and what follows it.
fn varuint(data: &[u8]) -> Option<(u32, &[u8])> {
    let end = data.iter().take(5).position(|byte| byte & 0x80 == 0)?;
    let (parts, rest) = data.split_at_checked(end + 1)?;
    let number = parts.iter().rev().fold(0u64, |number, part| number << 7 | u64::from(part & 0x7f));
    Some((u32::try_from(number).ok()?, rest))
}

/// A fault in the words of the firmware's list (`error.h`); later firmware may have more.
fn fault_name(code: u8) -> &'static str {
    match code {
        1 => "DMA stream transfer",
        2 => "DMA stream FIFO",
        3..=7 => "its UART",
        32 => "calibration",
        33 => "motor driver",
        34 => "over-voltage",
        35 => "encoder",
        36 => "motor not configured",
        37 => "PWM cycle overrun",
        38 => "over-temperature",
        39 => "started outside its position limits",
        40 => "under-voltage",
        41 => "configuration changed while it ran",
        42 => "no encoder to commutate by",
        43 => "no encoder of its output",
        44 => "gate driver not enabled",
        45 => "stop position beside limits",
        46 => "its loop ran late",
        47 => "back-EMF feedforward without an acceleration limit",
        48 => "invalid limits",
        _ => "unknown to kort",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The number of a register beyond 127 takes two bytes.
    #[test]
    fn numbers_of_several_bytes_are_read() {
        assert_eq!(varuint(&[0x70, 9]), Some((0x70, &[9][..])));
        assert_eq!(varuint(&[0xa0, 0x02, 9]), Some((0x120, &[9][..])));
        assert_eq!(varuint(&[0xff, 0xff, 0xff, 0xff, 0x0f]), Some((u32::MAX, &[][..])));
        for none in [&[][..], &[0x80], &[0xff; 5], &[0x80; 9], &[0xff, 0xff, 0xff, 0xff, 0x1f]] {
            assert_eq!(varuint(none), None, "{none:?}");
        }
    }

    #[test]
    fn faults_have_the_firmwares_names() {
        assert_eq!(
            [33, 34, 40, 99].map(fault_name),
            ["motor driver", "over-voltage", "under-voltage", "unknown to kort"]
        );
    }
}
