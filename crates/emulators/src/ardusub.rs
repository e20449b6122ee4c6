//! The autopilot of an ArduSub vehicle with one thruster that is looked at, from the descriptions of MAVLink's messages and commands and of
//! ArduSub's motor test: it needs an armed vehicle, ends 500 ms after its last command, disarms then, and begins no
//! other for ten seconds. The ESC has a dead band, and tells its speed without sign.

use std::collections::BTreeMap;

use kort_thruster::rig::Rig;

use crate::bench::{Device, Truth};
use crate::mavlink::{Message, pack, unpack};
use crate::stand::Stand;

const TEST_LIFE_S: f64 = 0.5;
/// After a test that ran out none begins for so long, s.
const COOL_DOWN_S: f64 = 10.0;
/// A test that could not begin is not tried again before this, s.
const AGAIN_S: f64 = 2.0;
/// Period of the main loop, s.
const LOOP_S: f64 = 0.0025;
/// Shortest time between two messages of a kind, s.
const SHORTEST_S: f64 = 0.003;
/// Half width of the ESC's dead band, and pulse width from zero to full, us.
const DEAD_US: f64 = 25.0;
const SPAN_US: f64 = 400.0;
/// The ESC tells its state so often, s.
const ESC_S: f64 = 0.01;
const MANUAL: u32 = 19;
const OUTPUTS: usize = 16;

// Messages, by their number.
const HEARTBEAT: u32 = 0;
const SYS_STATUS: u32 = 1;
const SERVO_OUTPUT_RAW: u32 = 36;
const TIMESYNC: u32 = 111;
const ESC_INFO: u32 = 290;
const ESC_STATUS: u32 = 291;
const ESC_TELEMETRY_1_TO_4: u32 = 11030;
// Commands, and answers to them.
const ARM_DISARM: u16 = 400;
const MOTOR_TEST: u16 = 209;
const SET_INTERVAL: u16 = 511;
const REQUEST: u16 = 512;
const ACCEPTED: u8 = 0;
const UNSUPPORTED: u8 = 3;
const FAILED: u8 = 4;

/// How its ESC tells what it does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Telemetry {
    /// As ArduPilot tells it: `ESC_TELEMETRY_1_TO_4`, without sign.
    Unsigned,
    /// `ESC_STATUS` and `ESC_INFO`, with sign.
    Signed,
}

/// How this one is made and set.
#[derive(Clone, Debug)]
pub struct Make {
    /// Version of the firmware.
    pub version: [u8; 3],
    /// What it says that it is, by MAVLink's number: 12 is a submarine.
    pub kind: u8,
    /// The motor that the thruster hangs on, from 1.
    pub motor: u32,
    /// The output that it is wired to.
    pub output: usize,
    /// Its ESC.
    pub telemetry: Telemetry,
    /// It lets nobody arm it, in these words.
    pub unfit: Option<&'static str>,
    /// A pilot has armed it before.
    pub piloted: bool,
    /// Time from power to the first word, s.
    pub boot_s: f64,
}

impl Default for Make {
    fn default() -> Self {
        Self {
            version: [4, 5, 3],
            kind: 12,
            motor: 3,
            output: 2,
            telemetry: Telemetry::Unsigned,
            unfit: None,
            piloted: false,
            boot_s: 0.4,
        }
    }
}

/// An emulated vehicle.
pub struct ArduSub {
    make: Make,
    stand: Stand,
    held: Vec<u8>,
    sequence: u8,
    booted_s: f64,
    answers_from_s: f64,
    looked_s: f64,
    mode: u32,
    armed: bool,
    /// When the motor test under way was commanded last.
    test_s: Option<f64>,
    failed_s: Option<f64>,
    refused_s: Option<f64>,
    /// Pulse width at each output, us.
    widths: [u16; OUTPUTS],
    /// Messages asked for: period and when the next is due, s.
    periods: BTreeMap<u32, (f64, f64)>,
    esc_told: u16,
}

impl ArduSub {
    /// One with the rig's thruster on it; the rig's amplifier is driven by volts.
    pub fn new(make: Make, rig: &Rig) -> Self {
        Self {
            stand: Stand::new(rig),
            held: Vec::new(),
            sequence: 0,
            booted_s: 0.0,
            answers_from_s: 0.0,
            looked_s: 0.0,
            mode: MANUAL,
            armed: make.piloted,
            test_s: None,
            failed_s: None,
            refused_s: None,
            widths: [1500; OUTPUTS],
            periods: BTreeMap::from([(HEARTBEAT, (1.0, 0.0))]),
            esc_told: 0,
            make,
        }
    }

    /// `SERVOn_FUNCTION`: motors 1 to 8 on the outputs that no other has, and a lamp.
    fn function(&self, n: usize) -> f32 {
        let motor = match n {
            _ if n == self.make.output => self.make.motor as usize,
            _ if n == self.make.motor as usize => self.make.output,
            _ => n,
        };
        if motor <= 8 { 32.0 + motor as f32 } else { f32::from(u8::from(n == 9)) * 59.0 }
    }

    /// Share of the supply that the ESC gives, -1 to 1.
    fn share(&self) -> f64 {
        let width = f64::from(self.widths[self.make.output - 1]) - 1500.0;
        if width.abs() <= DEAD_US { 0.0 } else { (width / SPAN_US).clamp(-1.0, 1.0) }
    }

    fn disarm(&mut self) {
        self.armed = false;
        self.widths = [1500; OUTPUTS];
    }

    fn say(&mut self, id: u32, payload: &[u8]) -> Vec<u8> {
        self.sequence = self.sequence.wrapping_add(1);
        pack(self.sequence, id, payload)
    }

    fn warn(&mut self, words: &str) -> Vec<u8> {
        let mut payload = vec![4];
        payload.extend(words.bytes());
        payload.resize(54, 0);
        self.say(253, &payload)
    }

    /// The state of one kind of message.
    fn tell(&mut self, now_s: f64, id: u32) -> Option<Vec<u8>> {
        let clock_us = ((now_s - self.booted_s) * 1e6) as u64;
        let column = (self.make.output - 1) % 4;
        let (supply_v, rpm) =
            (self.stand.supply_v(), self.stand.shaft_speed_rad_s() * 60.0 / std::f64::consts::TAU);
        // The bridge takes from the supply what it gives to the motor.
        let supply_a = (self.share() * self.stand.current_a()).max(0.0);
        let unsigned = self.make.telemetry == Telemetry::Unsigned;
        let mut out = Vec::new();
        match id {
            HEARTBEAT => {
                out.extend(self.mode.to_le_bytes());
                let state = if self.armed { 4 } else { 3 };
                out.extend([self.make.kind, 3, 81 | u8::from(self.armed) << 7, state, 3]);
            }
            SYS_STATUS => {
                out.resize(14, 0);
                out.extend(((supply_v * 1e3) as u16).to_le_bytes());
                out.resize(31, 0);
            }
            SERVO_OUTPUT_RAW => {
                out.extend((clock_us as u32).to_le_bytes());
                let (low, high) = self.widths.split_at(8);
                low.iter().for_each(|width| out.extend(width.to_le_bytes()));
                out.push(0);
                high.iter().for_each(|width| out.extend(width.to_le_bytes()));
            }
            ESC_TELEMETRY_1_TO_4 if unsigned && self.make.output <= 4 => {
                let mut row = |value: u16| {
                    (0..4).for_each(|i| out.extend(if i == column { value } else { 0 }.to_le_bytes()));
                };
                row((supply_v * 100.0) as u16);
                row((supply_a * 100.0) as u16);
                row(0);
                row(rpm.abs() as u16);
                row(self.esc_told);
                (0..4).for_each(|i| out.push(if i == column { 34 } else { 0 }));
            }
            ESC_STATUS if !unsigned => {
                out.extend(clock_us.to_le_bytes());
                (0..4).for_each(|i| out.extend(if i == column { rpm as i32 } else { 0 }.to_le_bytes()));
                for value in [supply_v, supply_a] {
                    (0..4)
                        .for_each(|i| out.extend(if i == column { value as f32 } else { 0.0 }.to_le_bytes()));
                }
                out.push((self.make.output - 1 - column) as u8);
            }
            ESC_INFO if !unsigned => {
                out.extend(clock_us.to_le_bytes());
                out.resize(34, 0);
                (0..4).for_each(|i| out.extend(if i == column { 3400i16 } else { i16::MAX }.to_le_bytes()));
                out.extend([(self.make.output - 1 - column) as u8, 8, 0, 255]);
            }
            148 => {
                out.resize(16, 0);
                let [major, minor, patch] = self.make.version;
                out.extend([255, patch, minor, major]);
                out.resize(60, 0);
                out.extend((0..18).map(|i| i * 7 + 1));
            }
            _ => return None,
        }
        Some(self.say(id, &out))
    }

    fn answer(&mut self, now_s: f64, said: &Message) -> Vec<Vec<u8>> {
        match said.id {
            // A wish for a parameter, by its name.
            20 if said.u8(2) == 1 => {
                let name: Vec<u8> = said.payload.iter().skip(4).copied().take_while(|b| *b != 0).collect();
                let name = String::from_utf8_lossy(&name).into_owned();
                let n = name.strip_prefix("SERVO").and_then(|rest| rest.strip_suffix("_FUNCTION"));
                let Some(n) = n.and_then(|n| n.parse::<usize>().ok()).filter(|n| *n <= OUTPUTS) else {
                    return Vec::new();
                };
                let mut payload = self.function(n).to_le_bytes().to_vec();
                payload.extend([0x2c, 1, n as u8, 0]);
                payload.extend(name.bytes());
                payload.resize(24, 0);
                payload.push(4);
                vec![self.say(22, &payload)]
            }
            // What is its clock, ns? The asker's own comes back with it.
            TIMESYNC if said.payload.iter().take(8).all(|byte| *byte == 0) => {
                let mut payload = (((now_s - self.booted_s) * 1e9) as i64).to_le_bytes().to_vec();
                payload.extend((8..16).map(|at| said.u8(at)));
                vec![self.say(TIMESYNC, &payload)]
            }
            76 if said.u8(30) == 1 => {
                let command = said.u16(28);
                let mut out = Vec::new();
                let result = match command {
                    ARM_DISARM => self.arm(said.f32(0) == 1.0, &mut out),
                    MOTOR_TEST => self.test(now_s, said, &mut out),
                    SET_INTERVAL => {
                        let period_s = (f64::from(said.f32(4)) * 1e-6).max(SHORTEST_S);
                        self.periods.insert(said.f32(0) as u32, (period_s, now_s));
                        ACCEPTED
                    }
                    REQUEST => match self.tell(now_s, said.f32(0) as u32) {
                        Some(frame) => {
                            out.push(frame);
                            ACCEPTED
                        }
                        None => FAILED,
                    },
                    _ => UNSUPPORTED,
                };
                let mut payload = command.to_le_bytes().to_vec();
                payload.extend([result, 0, 0, 0, 0, 0, said.from.0, said.from.1]);
                out.push(self.say(77, &payload));
                out
            }
            _ => Vec::new(),
        }
    }

    fn arm(&mut self, arm: bool, out: &mut Vec<Vec<u8>>) -> u8 {
        if !arm {
            self.disarm();
            return ACCEPTED;
        }
        if let Some(words) = self.make.unfit {
            out.push(self.warn(words));
            return FAILED;
        }
        self.armed = true;
        ACCEPTED
    }

    fn test(&mut self, now_s: f64, said: &Message, out: &mut Vec<Vec<u8>>) -> u8 {
        if self.test_s.is_none() {
            if self.refused_s.is_some_and(|at| now_s < at + AGAIN_S) {
                return FAILED;
            }
            let words = if self.failed_s.is_some_and(|at| now_s < at + COOL_DOWN_S) {
                Some("10 second cooldown required after motor test")
            } else {
                (!self.armed).then_some("Arm motors before testing motors.")
            };
            if let Some(words) = words {
                out.push(self.warn(words));
                out.push(self.warn("motor test initialization failed!"));
                self.refused_s = Some(now_s);
                return FAILED;
            }
            self.widths = [1500; OUTPUTS];
        }
        self.test_s = Some(now_s);
        // A pulse width, for an output's number; nothing else is spoken here.
        if (said.f32(4), said.f32(20)) != (1.0, 2.0) || !self.armed {
            return FAILED;
        }
        let motor = said.f32(0) as u32 + 1;
        let output = (1..=8).find(|n| self.function(*n) == 32.0 + motor as f32);
        let Some(width) = output.and_then(|n| self.widths.get_mut(n - 1)) else { return FAILED };
        *width = said.f32(8) as u16;
        ACCEPTED
    }
}

impl Device for ArduSub {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        if now_s < self.answers_from_s {
            return Vec::new();
        }
        self.held.extend(bytes);
        let said = unpack(&mut self.held);
        said.iter().flat_map(|said| self.answer(now_s, said)).collect()
    }

    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        let mut out = Vec::new();
        if now_s - self.looked_s >= LOOP_S {
            self.looked_s = now_s;
            if self.test_s.is_some_and(|at| now_s > at + TEST_LIFE_S) {
                self.disarm();
                (self.test_s, self.failed_s) = (None, Some(now_s));
                out.push(self.warn("Motor test timed out!"));
            }
        }
        let volts = self.share() * self.stand.supply_v();
        self.stand.turn_to(now_s, volts);
        self.esc_told = 1 + ((now_s - self.booted_s) / ESC_S) as u16;
        if now_s >= self.answers_from_s {
            let due = self.periods.iter_mut().filter(|(_, (_, next_s))| now_s >= *next_s);
            let due: Vec<u32> = due
                .map(|(id, (period_s, next_s))| {
                    *next_s = (*next_s + *period_s).max(now_s);
                    *id
                })
                .collect();
            out.extend(due.into_iter().filter_map(|id| self.tell(now_s, id)).collect::<Vec<_>>());
        }
        out
    }

    fn restart(&mut self, now_s: f64) {
        self.disarm();
        self.held.clear();
        (self.mode, self.test_s, self.failed_s, self.refused_s) = (MANUAL, None, None, None);
        (self.booted_s, self.answers_from_s) = (now_s, now_s + self.make.boot_s);
        self.periods = BTreeMap::from([(HEARTBEAT, (1.0, 0.0))]);
    }

    /// Up to 99: a fail-safe puts it into that mode; 100: a pilot disarms it; 101: another program tests motor 1.
    fn report(&mut self, code: u32) {
        match code {
            0 => (self.mode, self.widths[0]) = (MANUAL, 1500),
            100 => self.disarm(),
            101 => self.widths[0] = 1600,
            mode => self.mode = mode,
        }
    }

    fn truth(&self) -> Truth {
        self.stand.truth(self.share() * self.stand.supply_v())
    }
}
