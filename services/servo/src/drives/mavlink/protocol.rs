//! What is said to the autopilot and understood of it.

use kort_proto::signals::Signals;
use mavlink::dialects::ardupilotmega as msg;
use mavlink::{MAVLinkV2MessageRaw, MavlinkVersion, MessageData};
use msg::{MavCmd, MavModeFlag};

use super::Mavlink;
use super::esc::Esc;
use super::frame::Deframer;
use super::mouth::{AUTOPILOT, FORCE, Mouth, OURS};
use super::vehicle::{Clock, Hold, SPAN_US, Vehicle, ZERO_US};
use crate::link::{self, Ages, Heard};

/// Versions of ArduSub whose source was read, major and minor.
const FIRMWARE: std::ops::RangeInclusive<(u32, u32)> = (4, 0)..=(4, 8);
/// Questions without a confirmed answer before the reason is said; a heartbeat takes up to a second.
const ASKED_IN_VAIN: u32 = 30;
/// Exchanges, or questions, to the next heartbeat of kort's, and to the next wish for what was not answered.
const HEARTBEAT_EVERY: u32 = 10;
const AGAIN: u32 = 20;
/// What kort's questions for the vehicle's clock are known by in its answers.
const ASKED: i64 = 0x6b6f_7274;
/// The vehicle's messages of its supply, and its heartbeat, which tells mode and arming, a second.
const STATE_HZ: f64 = 10.0;

/// How far the vehicle is known.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// Is it there, and a submarine of ArduPilot's?
    Vehicle,
    /// Which version?
    Version,
    /// Which output is the motor on?
    Outputs,
    /// Its messages are asked for.
    Messages,
    Guarded,
    /// Not to be driven, for a reason that was said.
    Refused,
}

/// One conversation with an autopilot.
pub struct Protocol {
    drive: Mavlink,
    deframer: Deframer,
    stage: Stage,
    /// It has said something.
    known: bool,
    asked: u32,
    exchanges: u32,
    /// Exchanges since the vehicle was asked for.
    taking: u32,
    mouth: Mouth,
    version: String,
    vehicle: Vehicle,
    output: usize,
    esc: Esc,
    supply_v: f64,
    /// The supply was told since the last reading.
    supply_told: bool,
}

impl Protocol {
    /// Before the first word.
    pub fn new(drive: Mavlink) -> Self {
        Self {
            supply_v: drive.supply_v,
            mouth: Mouth::new(drive.system),
            drive,
            deframer: Deframer::default(),
            stage: Stage::Vehicle,
            known: false,
            asked: 0,
            exchanges: 0,
            taking: 0,
            version: String::new(),
            vehicle: Vehicle::default(),
            output: 0,
            esc: Esc::new(0),
            supply_told: false,
        }
    }

    fn test(&mut self, width: u16, out: &mut Vec<u8>) {
        self.vehicle.sends(width);
        self.mouth.test(self.drive.motor, width, out);
    }

    fn refuse(&mut self, words: String, heard: &mut dyn FnMut(Heard)) {
        self.stage = Stage::Refused;
        heard(Heard::Unguarded(words));
    }

    /// One sound frame of the vehicle's.
    fn message(&mut self, raw: &MAVLinkV2MessageRaw, heard: &mut dyn FnMut(Heard)) {
        fn read<D: MessageData>(raw: &MAVLinkV2MessageRaw) -> Option<D> {
            D::deser(MavlinkVersion::V2, raw.payload()).ok()
        }
        match raw.message_id() {
            msg::HEARTBEAT_DATA::ID => read(raw).into_iter().for_each(|m| self.is_there(&m, heard)),
            msg::AUTOPILOT_VERSION_DATA::ID => read(raw).into_iter().for_each(|m| self.is_of(&m, heard)),
            msg::PARAM_VALUE_DATA::ID => read(raw).into_iter().for_each(|m| self.parameter(&m, heard)),
            msg::COMMAND_ACK_DATA::ID => read(raw).into_iter().for_each(|m| self.answer(&m)),
            msg::STATUSTEXT_DATA::ID => {
                // While it is armed every word may say why it soon is not.
                let loud = msg::MavSeverity::MAV_SEVERITY_WARNING as u32;
                let said = read::<msg::STATUSTEXT_DATA>(raw);
                if let Some(m) = said.filter(|m| m.severity as u32 <= loud || self.vehicle.armed) {
                    self.vehicle.says(text(&*m.text));
                }
            }
            msg::SYS_STATUS_DATA::ID => {
                let told = read::<msg::SYS_STATUS_DATA>(raw).map(|m| m.voltage_battery);
                // The largest number stands for none, and an ESC that tells its own is nearer.
                if let Some(told) = told.filter(|told| ![0, u16::MAX].contains(told)) {
                    (self.supply_v, self.supply_told) = (f64::from(told) * 1e-3, true);
                }
            }
            msg::SERVO_OUTPUT_RAW_DATA::ID => read(raw).into_iter().for_each(|m| self.outputs(&m, heard)),
            msg::TIMESYNC_DATA::ID => {
                // Its own question, and its answer to another program, are none to kort.
                let answer = read::<msg::TIMESYNC_DATA>(raw).filter(|m| m.tc1 > 0 && m.ts1 == ASKED);
                let clock_us = answer.and_then(|m| u64::try_from(m.tc1).ok()).map(|ns| ns / 1000);
                if let Some(clock_us) = clock_us.and_then(|us| self.vehicle.clock_at(us)) {
                    heard(Heard::Marked(Some(clock_us)));
                }
            }
            id => {
                let share = self.vehicle.share(self.output);
                self.esc.hear(id, raw.payload(), share, self.vehicle.clock_us());
            }
        }
    }

    fn is_there(&mut self, m: &msg::HEARTBEAT_DATA, heard: &mut dyn FnMut(Heard)) {
        let armed = m.base_mode.contains(MavModeFlag::MAV_MODE_FLAG_SAFETY_ARMED);
        self.vehicle.heartbeat(armed, m.custom_mode);
        if self.stage != Stage::Vehicle {
            return;
        }
        if !std::mem::replace(&mut self.known, true) {
            heard(Heard::Known(format!("an autopilot with system number {} answers", self.drive.system)));
        }
        let sub = msg::MavType::MAV_TYPE_SUBMARINE;
        if (m.mavtype, m.autopilot) != (sub, msg::MavAutopilot::MAV_AUTOPILOT_ARDUPILOTMEGA) {
            let words = format!(
                "it is a {:?} of {:?}, and no submarine of ArduPilot's\nhint: only ArduSub's motor test has the time-out that kort needs",
                m.mavtype, m.autopilot
            );
            return self.refuse(words, heard);
        }
        // One that kort held, before its own time-out; or somebody else's.
        if !armed {
            (self.stage, self.asked) = (Stage::Version, 0);
        }
    }

    fn is_of(&mut self, m: &msg::AUTOPILOT_VERSION_DATA, heard: &mut dyn FnMut(Heard)) {
        if self.stage != Stage::Version {
            return;
        }
        let [major, minor, patch, _] = m.flight_sw_version.to_be_bytes().map(u32::from);
        let (wide, narrow) = (m.uid2.iter(), m.uid.to_be_bytes());
        let mut uid: String = wide.map(|b| format!("{b:02x}")).collect();
        if uid.bytes().all(|b| b == b'0') {
            uid = narrow.iter().map(|b| format!("{b:02x}")).collect();
        }
        self.version = format!("ArduSub {major}.{minor}.{patch}");
        heard(Heard::Known(format!("{}, identity {uid}", self.version)));
        if !FIRMWARE.contains(&(major, minor)) {
            let (low, high) = (FIRMWARE.start(), FIRMWARE.end());
            let words = format!(
                "{}: the time-out of its motor test is not known to kort; allowed is {}.{} to {}.{}\nhint: one of these, or read `verify_motor_test` of its source and tell us",
                self.version, low.0, low.1, high.0, high.1
            );
            self.refuse(words, heard);
        } else if let Some(words) = self.drive.wired.is_another(&uid) {
            self.refuse(words, heard);
        } else {
            (self.stage, self.asked) = (Stage::Outputs, 0);
        }
    }

    fn parameter(&mut self, m: &msg::PARAM_VALUE_DATA, heard: &mut dyn FnMut(Heard)) {
        let name = text(&*m.param_id);
        let output = name.strip_prefix("SERVO").and_then(|name| name.strip_suffix("_FUNCTION"));
        let Some(n) = output.and_then(|n| n.parse().ok()) else { return };
        self.vehicle.function(n, m.param_value.max(0.0) as u32);
        if self.stage != Stage::Outputs || self.vehicle.unknown().next().is_some() {
            return;
        }
        match self.vehicle.output_of(self.drive.motor) {
            Some(output) => {
                (self.stage, self.asked) = (Stage::Messages, 0);
                (self.output, self.esc) = (output, Esc::new(output));
            }
            None => {
                let words = format!(
                    "no output of it is motor {} (SERVO1_FUNCTION to SERVO16_FUNCTION)\nhint: FRAME_CONFIG has as many motors?",
                    self.drive.motor
                );
                self.refuse(words, heard);
            }
        }
    }

    fn answer(&mut self, m: &msg::COMMAND_ACK_DATA) {
        // An answer to another program on the same vehicle is none to kort; older versions name nobody.
        let to = (m.target_system, m.target_component);
        if to != (0, 0) && to != (self.drive.system, OURS) {
            return;
        }
        match m.command {
            MavCmd::MAV_CMD_COMPONENT_ARM_DISARM => self.vehicle.arming(m.result),
            MavCmd::MAV_CMD_DO_MOTOR_TEST => self.vehicle.testing(m.result),
            _ => (),
        }
    }

    /// The message that makes a reading: its clock says that it is new.
    fn outputs(&mut self, m: &msg::SERVO_OUTPUT_RAW_DATA, heard: &mut dyn FnMut(Heard)) {
        // A second message has outputs 17 and on.
        if m.port != 0 {
            return;
        }
        match self.vehicle.outputs(m, self.output) {
            Clock::Old => return,
            Clock::Back => {
                self.vehicle.was_reset();
                if self.stage == Stage::Guarded {
                    heard(Heard::Restarted);
                }
                return link::Protocol::begin(self);
            }
            Clock::On => (),
        }
        if self.stage == Stage::Messages {
            (self.stage, self.asked) = (Stage::Guarded, 0);
            heard(Heard::Guarded(format!(
                "{}, motor {} on output {}: a motor test ends by itself after 500 ms, as compiled into that version",
                self.version,
                self.drive.motor,
                self.output + 1
            )));
        }
        if self.stage != Stage::Guarded {
            return;
        }
        heard(Heard::Fault(self.vehicle.fault(self.drive.motor)));
        let sign = self.drive.wired.sign();
        let told = self.esc.take();
        if let Some(told) = told.filter(|told| told.supply_v > 0.0) {
            (self.supply_v, self.supply_told) = (told.supply_v, true);
        }
        let supply_v = if std::mem::take(&mut self.supply_told) { self.supply_v } else { f64::NAN };
        let clock_us = told.map_or(self.vehicle.clock_us(), |told| told.clock_us);
        let signals = match told {
            Some(told) => Signals {
                current_a: sign * told.current_a,
                shaft_speed_rad_s: sign * told.shaft_speed_rad_s,
                supply_v,
                temperature_c: told.temperature_c,
                ..Signals::UNKNOWN
            },
            None => Signals { supply_v, ..Signals::UNKNOWN },
        };
        heard(Heard::ReadAt(signals, clock_us));
    }

    /// What is asked for again and again until it comes.
    fn question(&mut self, out: &mut Vec<u8>) {
        let every = |hz: f64| (1e6 / hz) as f32;
        match self.stage {
            Stage::Version => {
                let wanted = msg::AUTOPILOT_VERSION_DATA::ID as f32;
                self.mouth.command(MavCmd::MAV_CMD_REQUEST_MESSAGE, [wanted, 0.0, 0.0, 0.0], out);
            }
            Stage::Outputs => {
                let unknown: Vec<usize> = self.vehicle.unknown().collect();
                for n in unknown {
                    self.mouth.parameter(&format!("SERVO{n}_FUNCTION"), out);
                }
            }
            Stage::Messages => {
                let rate_hz = self.drive.wired.rate_hz;
                let slow = [msg::SYS_STATUS_DATA::ID, msg::HEARTBEAT_DATA::ID].map(|id| (id, STATE_HZ));
                let fast = self.esc.messages().chain([msg::SERVO_OUTPUT_RAW_DATA::ID]);
                let wanted: Vec<(u32, f64)> = fast.map(|id| (id, rate_hz)).chain(slow).collect();
                for (id, hz) in wanted {
                    self.mouth.command(
                        MavCmd::MAV_CMD_SET_MESSAGE_INTERVAL,
                        [id as f32, every(hz), 0.0, 0.0],
                        out,
                    );
                }
            }
            Stage::Vehicle | Stage::Guarded | Stage::Refused => (),
        }
    }
}

impl link::Protocol for Protocol {
    fn begin(&mut self) {
        let mut vehicle = std::mem::take(&mut self.vehicle);
        vehicle.begin();
        let supply_v = self.supply_v;
        *self = Self { vehicle, supply_v, ..Self::new(self.drive.clone()) };
    }

    fn ask(&mut self, out: &mut Vec<u8>, heard: &mut dyn FnMut(Heard)) {
        if self.asked == ASKED_IN_VAIN {
            heard(Heard::Unguarded(match self.stage {
                Stage::Vehicle if self.vehicle.armed => {
                    "it is armed by somebody else\nhint: disarm it in the ground station; kort arms it itself"
                        .into()
                }
                Stage::Version => {
                    "does not tell its version\nhint: another firmware, or one that wants signed messages?"
                        .into()
                }
                Stage::Outputs => {
                    "does not tell SERVOn_FUNCTION of all its outputs\nhint: is it still starting?".into()
                }
                Stage::Messages => "does not send SERVO_OUTPUT_RAW\nhint: a slower rate_hz?".into(),
                _ => format!(
                    "no autopilot with system number {} is heard\nhint: baud rate, SERIALn_PROTOCOL = 2 (MAVLink 2), the endpoint's address; `address` is the vehicle's MAV_SYSID",
                    self.drive.system
                ),
            }));
            // One that is armed is there, and may be disarmed any time; else perhaps an answer was lost: from the beginning.
            if self.stage == Stage::Vehicle && self.known {
                self.asked = 0;
            } else {
                self.begin();
            }
        }
        if self.asked.is_multiple_of(HEARTBEAT_EVERY) {
            self.mouth.heartbeat(out);
        }
        self.asked += 1;
        self.question(out);
    }

    fn ages(&self) -> Ages {
        Ages::Clock
    }

    fn tell(&mut self, drive: Option<f64>, question: bool, out: &mut Vec<u8>) {
        if question {
            self.mouth.time(ASKED, out);
        }
        self.vehicle.want(drive.is_some());
        self.exchanges = self.exchanges.wrapping_add(1);
        if self.exchanges.is_multiple_of(HEARTBEAT_EVERY) {
            self.mouth.heartbeat(out);
        }
        let volts = drive.unwrap_or(0.0) * self.drive.wired.sign();
        // Without a known supply volts are no share of it.
        let share = if self.supply_v > 0.0 { (volts / self.supply_v).clamp(-1.0, 1.0) } else { 0.0 };
        let width = (f64::from(ZERO_US) + share * SPAN_US).round() as u16;
        let taking = std::mem::take(&mut self.taking);
        match self.vehicle.hold {
            Hold::Free => (),
            Hold::Taking => {
                self.taking = taking + 1;
                // Armed and tested in one breath: in between the vehicle would move its motors itself.
                if taking.is_multiple_of(AGAIN) && !self.vehicle.is_refused() {
                    self.mouth.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [1.0, 0.0, 0.0, 0.0], out);
                    self.test(ZERO_US, out);
                }
            }
            Hold::Held => self.test(width, out),
            Hold::Giving => {
                self.test(ZERO_US, out);
                self.mouth.command(MavCmd::MAV_CMD_COMPONENT_ARM_DISARM, [0.0, FORCE, 0.0, 0.0], out);
            }
        }
    }

    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard)) {
        for raw in self.deframer.take(bytes) {
            // Others on the same wire: ground stations, cameras, kort itself.
            if (raw.system_id(), raw.component_id()) == (u32::from(self.drive.system), AUTOPILOT) {
                self.message(&raw, heard);
            }
        }
    }
}

/// Words until the first zero.
fn text(bytes: &[u8]) -> String {
    let words = bytes.split(|b| *b == 0).next().unwrap_or_default();
    String::from_utf8_lossy(words).into_owned()
}
