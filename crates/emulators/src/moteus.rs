//! A moteus controller as an adapter on USB shows it, or its own UART: lines of CAN frames in hexadecimal, registers in
//! sub-frames, a diagnostic channel tunnelled through them.

use std::f64::consts::TAU;

use kort_thruster::rig::{AmplifierKind, Rig};

use crate::bench::{Device, Truth};
use crate::stand::Stand;

/// Time from power to the first answer, s.
const BOOT_S: f64 = 0.3;

/// Its number, unless it is made with another one.
const SERIAL_NUMBER: [u32; 3] = [0x8034_001c, 0x5350_4b06, 0x2037_3757];
/// Registers of that.
const SERIAL_REGISTERS: std::ops::Range<u32> = 0x120..0x123;

/// How this one is made and set.
#[derive(Clone, Debug)]
pub struct Make {
    /// Its number on the bus.
    pub address: u32,
    /// `servo.timeout_mode` stored in it: 12, zero velocity, comes from the factory.
    pub stored_timeout_mode: u32,
    /// It does not let its configuration be changed.
    pub read_only: bool,
    /// A UART, whose lines carry check sums.
    pub uart: bool,
    /// Its number, the least significant word first; none: it has no such registers.
    pub serial_number: Option<[u32; 3]>,
}

impl Default for Make {
    fn default() -> Self {
        Self {
            address: 1,
            stored_timeout_mode: 12,
            read_only: false,
            uart: false,
            serial_number: Some(SERIAL_NUMBER),
        }
    }
}

/// An emulated moteus with a thruster.
pub struct Moteus {
    make: Make,
    stand: Stand,
    torque_constant_nm_a: f64,
    held: Vec<u8>,
    /// A check sum was seen: from then on one is asked for.
    strict: bool,
    diagnostic_in: String,
    diagnostic_out: Vec<u8>,
    timeout_mode: u32,
    mode: u8,
    fault: u32,
    /// Registers 0x020 to 0x027 of the last command.
    command: [f32; 8],
    told_s: f64,
    power_s: f64,
    now_s: f64,
    answers_from_s: f64,
}

impl Moteus {
    /// One with the rig's motor on it.
    pub fn new(make: Make, rig: &Rig) -> Self {
        Self {
            stand: Stand::new(rig),
            torque_constant_nm_a: rig.motor.torque_constant_nm_a.value,
            held: Vec::new(),
            strict: false,
            diagnostic_in: String::new(),
            diagnostic_out: Vec::new(),
            timeout_mode: make.stored_timeout_mode,
            mode: 0,
            fault: 0,
            command: [0.0; 8],
            told_s: 0.0,
            power_s: 0.0,
            now_s: 0.0,
            answers_from_s: 0.0,
            make,
        }
    }

    /// What the power stage is asked for, in the unit of the rig's amplifier.
    fn asked(&self) -> f64 {
        let [_, velocity, torque, kp_scale, ..] = self.command.map(f64::from);
        match (self.mode, self.stand.kind()) {
            (10, AmplifierKind::Speed) => velocity * kp_scale * TAU,
            (10, _) => torque / self.torque_constant_nm_a,
            // The factory's time-out holds zero speed with all its torque.
            (11, AmplifierKind::Current) if self.timeout_mode != 0 => {
                -3.0 * self.stand.shaft_speed_rad_s().signum()
            }
            _ => 0.0,
        }
    }

    fn register(&self, number: u32) -> f64 {
        match number {
            0x00 => f64::from(self.mode),
            0x01 => self.stand.shaft_angle_rad() / TAU,
            0x02 => self.stand.shaft_speed_rad_s() / TAU,
            0x03 => self.stand.current_a() * self.torque_constant_nm_a,
            0x04 => self.stand.current_a(),
            0x0d => self.stand.supply_v(),
            0x0e => 31.0,
            0x0f => f64::from(self.fault),
            number if SERIAL_REGISTERS.contains(&number) => {
                let words = self.make.serial_number.unwrap_or_default();
                f64::from(words[(number - SERIAL_REGISTERS.start) as usize])
            }
            0x70 => ((self.now_s - self.power_s) * 1e3).floor(),
            _ => 0.0,
        }
    }

    fn write(&mut self, number: u32, value: f64) {
        match number {
            0x00 => {
                // Stopped clears faults, and the time-out, which ends no other way.
                if value == 0.0 {
                    (self.mode, self.fault) = (0, 0);
                } else if !matches!(self.mode, 1 | 11) {
                    self.mode = value as u8;
                }
                // What a command does not say has its default.
                self.command = [0.0, 0.0, 0.0, 1.0, 1.0, f32::NAN, f32::NAN, 0.0];
                self.told_s = self.now_s;
            }
            0x20..=0x27 => self.command[number as usize - 0x20] = value as f32,
            _ => (),
        }
    }

    /// One CAN frame; the answer's data.
    fn frame(&mut self, data: &[u8]) -> Vec<u8> {
        let mut answer = Vec::new();
        let mut rest = data.iter().copied();
        while let Some(part) = rest.next() {
            match part {
                0x50 => (),
                0x00..=0x1f => {
                    let kind = part & 0x0c;
                    let size = [1, 2, 4, 4][usize::from(kind >> 2)];
                    let count = if part & 3 == 0 { varuint(&mut rest) } else { u32::from(part & 3) };
                    let first = varuint(&mut rest);
                    if part & 0x10 != 0 {
                        if SERIAL_REGISTERS.contains(&first) && self.make.serial_number.is_none() {
                            // A read error, of the first register that is not there.
                            answer.extend([0x31, 0xa0, 0x02, 1]);
                            continue;
                        }
                        answer.extend([0x20 | kind, count as u8]);
                        put_varuint(first, &mut answer);
                    }
                    for number in first..first + count {
                        if part & 0x10 != 0 {
                            let value = self.register(number);
                            match kind {
                                0x0c => answer.extend((value as f32).to_le_bytes()),
                                0x08 => answer.extend((value as i64 as i32).to_le_bytes()),
                                0x04 => answer.extend((value as i16).to_le_bytes()),
                                _ => answer.push(value as i8 as u8),
                            }
                        } else {
                            let mut bytes = [0; 4];
                            bytes.iter_mut().take(size).for_each(|byte| *byte = rest.next().unwrap_or(0));
                            let value = match kind {
                                0x0c => f64::from(f32::from_le_bytes(bytes)),
                                0x08 => f64::from(i32::from_le_bytes(bytes)),
                                0x04 => f64::from(i16::from_le_bytes([bytes[0], bytes[1]])),
                                _ => f64::from(bytes[0] as i8),
                            };
                            self.write(number, value);
                        }
                    }
                }
                0x40 => {
                    let (_channel, length) = (rest.next(), rest.next().unwrap_or(0));
                    let text: Vec<u8> = rest.by_ref().take(usize::from(length)).collect();
                    self.diagnostic(&String::from_utf8_lossy(&text));
                }
                0x42 => {
                    let (channel, most) = (rest.next().unwrap_or(1), usize::from(rest.next().unwrap_or(0)));
                    let length = self.diagnostic_out.len().min(most);
                    answer.extend([0x41, channel, length as u8]);
                    answer.extend(self.diagnostic_out.drain(..length));
                }
                _ => break,
            }
        }
        answer
    }

    fn diagnostic(&mut self, text: &str) {
        self.diagnostic_in += text;
        while let Some((line, rest)) = self.diagnostic_in.split_once('\n') {
            let words: Vec<&str> = line.split_whitespace().collect();
            let answer = match words.as_slice() {
                ["conf", "get", "servo.timeout_mode"] => self.timeout_mode.to_string(),
                ["conf", "set", "servo.timeout_mode", mode] => {
                    if !self.make.read_only {
                        self.timeout_mode = mode.parse().unwrap_or(12);
                    }
                    "OK".into()
                }
                _ => "ERR unknown command".into(),
            };
            self.diagnostic_out.extend(format!("{answer}\r\n").bytes());
            self.diagnostic_in = rest.to_owned();
        }
    }

    /// One line from the host; the lines that answer it.
    fn line(&mut self, line: &str) -> Vec<Vec<u8>> {
        let words = match line.rsplit_once('*') {
            Some((words, sum)) => {
                if u8::from_str_radix(sum.trim(), 16) != Ok(check(words.as_bytes())) {
                    return vec![self.say("ERR checksum")];
                }
                self.strict = true;
                words
            }
            None if self.strict => return vec![self.say("ERR checksum")],
            None => line,
        };
        let words: Vec<&str> = words.split_whitespace().collect();
        let ["can", "send", id, hex, ..] = words.as_slice() else {
            return vec![self.say("ERR unknown command")];
        };
        let id = u32::from_str_radix(id, 16).unwrap_or(0);
        let data: Option<Vec<u8>> =
            (0..hex.len() / 2).map(|i| u8::from_str_radix(hex.get(2 * i..2 * i + 2)?, 16).ok()).collect();
        let Some(data) = data else { return vec![self.say("ERR malformed")] };
        let mut lines = vec![self.say("OK")];
        if id & 0x7f == self.make.address {
            let mut answer = self.frame(&data);
            if id & 0x8000 != 0 {
                let lengths = (0..=8).chain([12, 16, 20, 24, 32, 48, 64]);
                let length = lengths.into_iter().find(|length| *length >= answer.len()).unwrap_or(64);
                answer.resize(length, 0x50);
                let hex: String = answer.iter().map(|byte| format!("{byte:02X}")).collect();
                lines.push(self.say(&format!("rcv {:x} {hex} E B F", self.make.address << 8)));
            }
        }
        lines
    }

    fn say(&self, words: &str) -> Vec<u8> {
        if self.make.uart {
            let words = format!("{words} ");
            return format!("{words}*{:02X}\r\n", check(words.as_bytes())).into_bytes();
        }
        format!("{words}\r\n").into_bytes()
    }
}

impl Device for Moteus {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        self.now_s = now_s;
        if now_s < self.answers_from_s {
            return Vec::new();
        }
        self.held.extend(bytes);
        let mut answers = Vec::new();
        while let Some(end) = self.held.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.held.drain(..=end).collect();
            answers.extend(self.line(String::from_utf8_lossy(&line).trim_end()));
        }
        answers
    }

    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        self.now_s = now_s;
        let timeout_s = f64::from(self.command[7]);
        if self.mode == 10 && timeout_s > 0.0 && now_s - self.told_s > timeout_s {
            self.mode = 11;
        }
        if self.fault != 0 {
            self.mode = 1;
        }
        self.stand.turn_to(now_s, self.asked());
        Vec::new()
    }

    fn restart(&mut self, now_s: f64) {
        (self.mode, self.fault, self.timeout_mode) = (0, 0, self.make.stored_timeout_mode);
        (self.power_s, self.answers_from_s, self.strict) = (now_s, now_s + BOOT_S, false);
        self.held.clear();
        self.diagnostic_out.clear();
    }

    fn report(&mut self, code: u32) {
        self.fault = code;
    }

    fn truth(&self) -> Truth {
        self.stand.truth(self.asked())
    }
}

/// A number of seven bits a byte, the lowest first; the highest bit says that more follow.
fn varuint(bytes: &mut impl Iterator<Item = u8>) -> u32 {
    let (mut number, mut shift) = (0, 0);
    while let Some(byte) = bytes.next().filter(|_| shift < 28) {
        number |= u32::from(byte & 0x7f) << shift;
        shift += 7;
        if byte & 0x80 == 0 {
            break;
        }
    }
    number
}

fn put_varuint(mut number: u32, into: &mut Vec<u8>) {
    while number > 0x7f {
        into.push(number as u8 | 0x80);
        number >>= 7;
    }
    into.push(number as u8);
}

/// CRC-8 with the polynomial x^8 + x^7 + x^4 + x^2 + x + 1, from zero, bit by bit.
fn check(words: &[u8]) -> u8 {
    words.iter().fold(0, |rest, byte| {
        (0..8).fold(rest ^ byte, |rest, _| if rest & 0x80 != 0 { (rest << 1) ^ 0x97 } else { rest << 1 })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The first rows of the table that the documentation prints.
    #[test]
    fn the_check_sum_is_the_documented_one() {
        assert_eq!([check(&[1]), check(&[2]), check(&[3]), check(&[4])], [0x97, 0xb9, 0x2e, 0xe5]);
    }
}
