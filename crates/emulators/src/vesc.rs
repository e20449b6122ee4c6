//! A VESC, from the description of its packets and commands: frames of start, length, payload, CRC and stop; commands
//! by number; values by a mask of bits; an app configuration of which the first fields are known and the rest is carried.

use std::f64::consts::TAU;

use kort_thruster::rig::{AmplifierKind, Rig};

use crate::bench::{Device, Lie, Mischief, Truth};
use crate::stand::Stand;

/// Period of the thread that looks at the time-out, s.
const LOOK_S: f64 = 0.01;
/// Length of the app configuration behind its four fields.
const REST: usize = 320;
const SIGNATURE: u32 = 0x3a91_7f26;

/// What the motor was told.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Motor {
    Current(f64),
    Duty(f64),
    Erpm(f64),
}

/// How this one is made and set.
#[derive(Clone, Debug)]
pub struct Make {
    /// Firmware, major and minor.
    pub firmware: (u8, u8),
    /// Pole pairs of the motor.
    pub pole_pairs: f64,
    /// Time-out stored in it, ms; zero switches it off, as in the firmware.
    pub stored_timeout_ms: u32,
    /// Current it brakes with after the time-out, A.
    pub stored_brake_current_a: f32,
    /// It does not let its app configuration be changed.
    pub read_only: bool,
    /// Its serial number.
    pub uuid: [u8; 12],
    /// Time from power to the first answer, s.
    pub boot_s: f64,
    /// Its encoder counts the other way round.
    pub reversed_encoder: bool,
}

impl Default for Make {
    fn default() -> Self {
        Self {
            firmware: (6, 5),
            pole_pairs: 7.0,
            stored_timeout_ms: 1000,
            stored_brake_current_a: 0.0,
            read_only: false,
            uuid: [0x10, 0x32, 0x54, 0x76, 0x98, 0xba, 0xdc, 0xfe, 1, 2, 3, 4],
            boot_s: 0.3,
            reversed_encoder: false,
        }
    }
}

/// An emulated VESC with a thruster.
pub struct Vesc {
    make: Make,
    stand: Stand,
    held: Vec<u8>,
    /// The app configuration in force, without the command's number.
    settings: Vec<u8>,
    motor: Motor,
    told_s: f64,
    looked_s: f64,
    timed_out: bool,
    answers_from_s: f64,
    fault: u8,
    tacho: i32,
    tacho_abs: i32,
    last_steps: f64,
    iq_sum: f64,
    iq_count: u32,
    /// What its encoder makes of the shaft.
    lie: Lie,
}

impl Vesc {
    /// One with the rig's motor on it.
    pub fn new(make: Make, rig: &Rig) -> Self {
        let mut vesc = Self {
            stand: Stand::new(rig),
            held: Vec::new(),
            settings: Vec::new(),
            motor: Motor::Current(0.0),
            told_s: 0.0,
            looked_s: 0.0,
            timed_out: false,
            answers_from_s: 0.0,
            fault: 0,
            tacho: 0,
            tacho_abs: 0,
            last_steps: 0.0,
            iq_sum: 0.0,
            iq_count: 0,
            lie: Lie::default(),
            make,
        };
        vesc.settings = vesc.stored();
        vesc
    }

    fn stored(&self) -> Vec<u8> {
        let mut bytes = SIGNATURE.to_be_bytes().to_vec();
        bytes.push(57);
        bytes.extend(self.make.stored_timeout_ms.to_be_bytes());
        bytes.extend(self.make.stored_brake_current_a.to_bits().to_be_bytes());
        bytes.extend((0..REST).map(|i| (i * 37 % 251) as u8));
        bytes
    }

    fn timeout_s(&self) -> f64 {
        f64::from(u32::from_be_bytes([
            self.settings[5],
            self.settings[6],
            self.settings[7],
            self.settings[8],
        ])) * 1e-3
    }

    fn brake_current_a(&self) -> f64 {
        let bits = [self.settings[9], self.settings[10], self.settings[11], self.settings[12]];
        f64::from(f32::from_bits(u32::from_be_bytes(bits)))
    }

    /// What the power stage gives, in the unit of the rig's amplifier.
    fn command(&self) -> f64 {
        if self.fault != 0 {
            return 0.0;
        }
        let speed = self.stand.shaft_speed_rad_s();
        match (self.stand.kind(), self.motor) {
            _ if self.timed_out => {
                -self.brake_current_a() * speed.signum() * f64::from(u8::from(speed.abs() > 1.0))
            }
            (AmplifierKind::Current, Motor::Current(amperes)) => amperes,
            (AmplifierKind::Voltage, Motor::Duty(duty)) => duty * self.stand.supply_v(),
            (AmplifierKind::Speed, Motor::Erpm(erpm)) => erpm / self.make.pole_pairs * TAU / 60.0,
            // Current zero releases the motor; other mixtures are not of this emulator.
            _ => 0.0,
        }
    }

    fn act(&mut self, now_s: f64, payload: &[u8]) -> Option<Vec<u8>> {
        let (&command, data) = payload.split_first()?;
        let number = |at: usize| {
            data.get(at..at + 4).map(|b| i32::from_be_bytes([b[0], b[1], b[2], b[3]])).map(f64::from)
        };
        match command {
            0 => {
                let mut answer = vec![0, self.make.firmware.0, self.make.firmware.1];
                answer.extend(b"60_MK6\0");
                answer.extend(self.make.uuid);
                answer.extend([0, 0, 0, 0, 0, 0, 0]);
                return Some(answer);
            }
            5 => self.motor = Motor::Duty(number(0)? / 100_000.0),
            6 => self.motor = Motor::Current(number(0)? / 1000.0),
            8 => self.motor = Motor::Erpm(number(0)?),
            17 => return Some([&[17], self.settings.as_slice()].concat()),
            149 if self.make.read_only => return None,
            149 => {
                // Another signature, or another length, is another firmware's.
                if data.len() != self.settings.len() || data[..4] != self.settings[..4] {
                    return None;
                }
                self.settings = data.to_vec();
                return Some(vec![149]);
            }
            50 => return Some(self.values(number(0)? as i32 as u32)),
            _ => return None,
        }
        self.told_s = now_s;
        self.timed_out = false;
        None
    }

    fn values(&mut self, mask: u32) -> Vec<u8> {
        let mut out = vec![50];
        out.extend(mask.to_be_bytes());
        let iq =
            if self.iq_count == 0 { self.stand.current_a() } else { self.iq_sum / f64::from(self.iq_count) };
        (self.iq_sum, self.iq_count) = (0.0, 0);
        let sign = if self.make.reversed_encoder { -1.0 } else { 1.0 };
        let erpm =
            sign * self.lie.factor() * self.stand.shaft_speed_rad_s() * 60.0 / TAU * self.make.pole_pairs;
        for bit in (0..32).filter(|bit| mask & (1 << bit) != 0) {
            match bit {
                0 => out.extend(312i16.to_be_bytes()),
                1 => out.extend(285i16.to_be_bytes()),
                2 | 5 => out.extend(((iq * 100.0) as i32).to_be_bytes()),
                3 | 4 | 9..=12 | 16 | 19 | 20 => out.extend(0i32.to_be_bytes()),
                6 => out.extend(0i16.to_be_bytes()),
                7 => out.extend((erpm as i32).to_be_bytes()),
                8 => out.extend(((self.stand.supply_v() * 10.0) as i16).to_be_bytes()),
                13 => out.extend((self.tacho * sign as i32).to_be_bytes()),
                14 => out.extend(self.tacho_abs.to_be_bytes()),
                15 => out.push(self.fault),
                17 => out.push(57),
                18 => out.extend([1, 56, 1, 56, 1, 56]),
                21 => out.push(u8::from(self.timed_out)),
                _ => (),
            }
        }
        out
    }
}

impl Device for Vesc {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        if now_s < self.answers_from_s {
            return Vec::new();
        }
        self.held.extend(bytes);
        let mut answers = Vec::new();
        while !self.held.is_empty() {
            match unpack(&self.held) {
                Unpacked::More => break,
                Unpacked::Wrong => drop(self.held.remove(0)),
                Unpacked::Packet(payload, length) => {
                    self.held.drain(..length);
                    answers.extend(self.act(now_s, &payload).map(|answer| pack(&answer)));
                }
            }
        }
        answers
    }

    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        if now_s - self.looked_s >= LOOK_S {
            self.looked_s = now_s;
            let timeout_s = self.timeout_s();
            self.timed_out = timeout_s > 0.0 && now_s - self.told_s > timeout_s;
        }
        self.stand.turn_to(now_s, self.command());
        self.iq_sum += self.stand.current_a();
        self.iq_count += 1;
        let steps = (self.stand.shaft_angle_rad() / TAU * 6.0 * self.make.pole_pairs).floor();
        let moved = ((steps - self.last_steps) * self.lie.factor()).round() as i32;
        // What is less than a step of a slower count is kept.
        self.last_steps += (f64::from(moved) / self.lie.factor()).round();
        self.tacho += moved;
        self.tacho_abs += moved.abs();
        Vec::new()
    }

    fn restart(&mut self, now_s: f64) {
        self.settings = self.stored();
        self.motor = Motor::Current(0.0);
        self.answers_from_s = now_s + self.make.boot_s;
        self.held.clear();
        (self.tacho, self.tacho_abs, self.fault) = (0, 0, 0);
    }

    fn report(&mut self, code: u32) {
        self.fault = code as u8;
    }

    fn truth(&self) -> Truth {
        self.stand.truth(self.command())
    }

    fn mislead(&mut self, mischief: Mischief) {
        self.lie.tell(mischief);
    }
}

enum Unpacked {
    More,
    Wrong,
    Packet(Vec<u8>, usize),
}

/// The packet at the beginning.
fn unpack(held: &[u8]) -> Unpacked {
    let (begin, length) = match held {
        [2, length, ..] => (2, usize::from(*length)),
        [3, high, low, ..] => (3, usize::from(*high) * 256 + usize::from(*low)),
        [2 | 3] | [3, _] => return Unpacked::More,
        _ => return Unpacked::Wrong,
    };
    if length > 512 {
        return Unpacked::Wrong;
    }
    if held.len() < begin + length + 3 {
        return Unpacked::More;
    }
    let payload = &held[begin..begin + length];
    let tail = &held[begin + length..begin + length + 3];
    let check = check(payload);
    if tail == [(check >> 8) as u8, check as u8, 3] {
        Unpacked::Packet(payload.to_vec(), begin + length + 3)
    } else {
        Unpacked::Wrong
    }
}

fn pack(payload: &[u8]) -> Vec<u8> {
    let mut packet = if payload.len() <= 255 {
        vec![2, payload.len() as u8]
    } else {
        vec![3, (payload.len() >> 8) as u8, payload.len() as u8]
    };
    packet.extend(payload);
    let check = check(payload);
    packet.extend([(check >> 8) as u8, check as u8, 3]);
    packet
}

/// CRC-16 with the polynomial x^16 + x^12 + x^5 + 1, from zero, bit by bit.
fn check(payload: &[u8]) -> u16 {
    let mut rest = 0u16;
    for bit in payload.iter().flat_map(|byte| (0..8).rev().map(move |i| byte >> i & 1 == 1)) {
        let out = rest >> 15 == 1;
        rest <<= 1;
        if out != bit {
            rest ^= 0x1021;
        }
    }
    rest
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The check value that catalogues of CRCs give for this one.
    #[test]
    fn the_check_sum_is_the_catalogued_one() {
        assert_eq!(check(b"123456789"), 0x31c3);
    }
}
