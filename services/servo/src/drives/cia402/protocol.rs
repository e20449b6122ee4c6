//! What is said to a CiA 402 drive and understood of it.

use std::f64::consts::TAU;

use kort_proto::messages::DriveKind;
use kort_proto::signals::Signals;

use super::Cia402;
use super::sdo::{Answer, Job, answer, request};
use super::setup::{Learned, Step, steps};
use super::state::{State, meaning};
use super::told::Told;
use crate::link::can::{Carrier, Frame, Frames};
use crate::link::{self, Ages, Heard};

// Identifiers of CANopen; the drive's own carry its node.
const NMT: u16 = 0x000;
const SYNC: u16 = 0x080;
const EMERGENCY: u16 = 0x080;
const ANSWER_1: u16 = 0x180;
const TARGET: u16 = 0x200;
const ANSWER_2: u16 = 0x280;
const SDO_ANSWER: u16 = 0x580;
const SDO_QUESTION: u16 = 0x600;
const HEARTBEAT: u16 = 0x700;

// Orders to a node, and the states that its heartbeat tells.
const START: u8 = 0x01;
const PRE_OPERATIONAL: u8 = 0x80;
const BOOTED: u8 = 0x00;
const OPERATIONAL: u8 = 0x05;

/// Questions without an answer before the reason is said.
const ASKED_IN_VAIN: u32 = 10;
/// Turns of asking that a refusal stands.
const REFUSED_FOR: u32 = 20;
/// Time that the drive may take to `operation enabled`, s.
const ENTERING_S: f64 = 2.0;
/// Exchanges between the edges of a fault reset.
const EDGE_EVERY: u32 = 32;
/// Asked in turn while it is driven: the watchdog as it was confirmed, and the supply, mV. Their answers are the marks.
const POLLS: [(u16, u8, u8); 3] = [(0x1016, 1, 4), (0x6007, 0, 2), (0x6079, 0, 4)];
/// What may have changed a setting.
const DISTURBED: &str = "a reset, or another master?";

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    /// This step was asked, and its answer is awaited.
    Setup(usize),
    /// All is set; its heartbeat must say that it is in operation.
    Starting,
    Guarded,
    /// Not to be driven, as was said; asked again after a while: a wire that turns a bit of an answer looks like that too.
    Refused,
}

/// One conversation with a drive.
pub struct Protocol {
    drive: Cia402,
    frames: Frames,
    steps: Vec<Step>,
    stage: Stage,
    asked: u32,
    /// The next step is due at once.
    go_on: bool,
    learned: Learned,
    /// An emergency message that was not yet followed by its end.
    emergency: Option<u16>,
    told: Told,
    supply_v: f64,
    exchanges: u32,
    polls: usize,
    exchanges_on: u32,
    /// It was in operation since the output was switched on.
    entered: bool,
    on: bool,
}

impl Protocol {
    /// Before the first word.
    pub fn new(drive: Cia402) -> Self {
        Self {
            frames: Frames::new(drive.carrier),
            steps: steps(&drive),
            stage: Stage::Setup(0),
            asked: 0,
            go_on: false,
            learned: Learned::default(),
            emergency: None,
            told: Told::default(),
            supply_v: f64::NAN,
            exchanges: 0,
            polls: 0,
            exchanges_on: 0,
            entered: false,
            on: false,
            drive,
        }
    }

    fn send(&self, id: u16, data: &[u8], out: &mut Vec<u8>) {
        self.drive.carrier.send(&Frame::new(id, data), out);
    }

    fn to_drive(&self, id: u16, data: &[u8], out: &mut Vec<u8>) {
        self.send(id + u16::from(self.drive.node), data, out);
    }

    /// Opens an adapter's bus at its bit rate, whatever it was told before.
    fn open(&self, out: &mut Vec<u8>) {
        if self.drive.carrier == Carrier::Slcan {
            out.extend(format!("\rC\rS{}\rO\r", self.drive.bitrate).bytes());
        }
    }

    /// The step under way.
    fn step_now(&mut self, out: &mut Vec<u8>) {
        match self.stage {
            Stage::Setup(n) => {
                if let Some(step) = self.steps.get(n) {
                    self.to_drive(SDO_QUESTION, &request(step.index, step.sub, step.job), out);
                }
            }
            Stage::Starting => self.send(NMT, &[START, self.drive.node], out),
            Stage::Guarded | Stage::Refused => (),
        }
    }

    fn refuse(&mut self, words: String, heard: &mut dyn FnMut(Heard)) {
        self.stage = Stage::Refused;
        self.asked = 0;
        heard(Heard::Unguarded(words));
    }

    /// What was confirmed is so no more: from the beginning.
    fn unguard(&mut self, words: String, heard: &mut dyn FnMut(Heard)) {
        heard(Heard::Unguarded(words));
        *self = Self::new(self.drive.clone());
    }

    fn sdo(&mut self, index: u16, sub: u8, said: Answer, heard: &mut dyn FnMut(Heard)) {
        let n = match self.stage {
            Stage::Setup(n) => n,
            Stage::Guarded => return self.polled(index, sub, said, heard),
            Stage::Starting | Stage::Refused => return,
        };
        let Some(step) = self.steps.get(n).copied().filter(|s| (s.index, s.sub) == (index, sub)) else {
            return;
        };
        let value = match (step.job, said) {
            (Job::Read(_), Answer::Value(value)) => Some(value),
            (Job::Write(..), Answer::Written) => None,
            (_, Answer::Aborted(code)) if step.needed => {
                return self.refuse(
                    format!(
                        "does not {} its {} ({index:#06x}:{sub}): abort code {code:#010x}\nhint: the drive's manual on that object; kort needs it",
                        if matches!(step.job, Job::Read(_)) { "tell" } else { "take" },
                        step.what
                    ),
                    heard,
                );
            }
            (_, Answer::Aborted(_)) => None,
            // The answer to a question that was asked twice.
            _ => return,
        };
        self.asked = 0;
        if let Err(words) = self.learned.take(&self.drive, &step, value) {
            return self.refuse(words, heard);
        }
        if (index, sub) == (0x1018, 4) {
            let identity = self.learned.identity();
            heard(Heard::Known(format!("CiA 402 drive, node {}, identity {identity}", self.drive.node)));
            if let Some(words) = self.drive.wired.is_another(&identity) {
                return self.refuse(words, heard);
            }
        }
        let next = (n + 1..self.steps.len())
            .find(|next| self.steps.get(*next).is_some_and(|step| !self.learned.spares(step)));
        self.stage = next.map_or(Stage::Starting, Stage::Setup);
        self.go_on = true;
    }

    /// The answer to one of [`POLLS`].
    fn polled(&mut self, index: u16, sub: u8, said: Answer, heard: &mut dyn FnMut(Heard)) {
        if POLLS.iter().any(|poll| (poll.0, poll.1) == (index, sub)) {
            // A half that came before it belongs to none that comes after it.
            self.told.forget();
            heard(Heard::Marked(None));
        }
        match ((index, sub), said) {
            ((0x1016, 1), Answer::Value(value)) if value != self.learned.heartbeat => {
                let words = format!("its consumer heartbeat time became {value:#x}\nhint: {DISTURBED}");
                self.unguard(words, heard);
            }
            ((0x6007, 0), Answer::Value(value)) if value != self.learned.option => {
                let words = format!("its abort connection option code became {value}\nhint: {DISTURBED}");
                self.unguard(words, heard);
            }
            ((0x6079, 0), Answer::Value(value)) => self.supply_v = f64::from(value) * 1e-3,
            _ => (),
        }
    }

    fn heartbeat(&mut self, state: u8, heard: &mut dyn FnMut(Heard)) {
        match (state & 0x7f, self.stage) {
            (BOOTED, _) => heard(Heard::Restarted),
            (OPERATIONAL, Stage::Starting) => {
                self.stage = Stage::Guarded;
                // What it sent before was about the time without kort; a fault that stands shows in its state.
                self.emergency = None;
                let ms = self.learned.heartbeat & 0xffff;
                heard(Heard::Guarded(format!(
                    "after {ms} ms without kort's heartbeat it {} (0x6007 is {}), without braking",
                    if self.learned.option == 2 { "switches its output off" } else { "goes into fault" },
                    self.learned.option
                )));
            }
            (OPERATIONAL, _) => (),
            (state, Stage::Guarded) => self.unguard(
                format!("left operation by itself: its network state is {state}\nhint: it missed kort's heartbeat, or another master"),
                heard,
            ),
            _ => (),
        }
    }

    fn frame(&mut self, frame: &Frame, heard: &mut dyn FnMut(Heard)) {
        match (frame.id.wrapping_sub(u16::from(self.drive.node)), frame.data()) {
            (SDO_ANSWER, data) => {
                if let Some((index, sub, said)) = answer(data) {
                    self.sdo(index, sub, said, heard);
                }
            }
            (HEARTBEAT, &[state]) => self.heartbeat(state, heard),
            (EMERGENCY, &[low, high, ..]) => {
                let code = u16::from_le_bytes([low, high]);
                self.learned.error = code;
                self.emergency = (code != 0).then_some(code);
            }
            (ANSWER_1, data) if self.told.first(data) => self.reading(heard),
            (ANSWER_2, data) if self.told.second(data) => self.reading(heard),
            _ => (),
        }
    }

    /// An answer, if it makes a reading with the other one.
    fn reading(&mut self, heard: &mut dyn FnMut(Heard)) {
        if self.stage != Stage::Guarded {
            return self.told.forget();
        }
        let Some((state, read)) = self.told.take() else { return };
        self.entered = self.on && (self.entered || state == State::Enabled);
        self.exchanges_on = if self.on { self.exchanges_on.saturating_add(1) } else { 0 };
        heard(Heard::Fault(self.fault(state)));
        if !self.on {
            // It was told; a drive that has left it behind sends no end of some.
            self.emergency = None;
        }
        let sign = self.drive.wired.sign();
        heard(Heard::Reading(Signals {
            current_a: sign * f64::from(read.torque) * 1e-3 * self.learned.rated_a,
            shaft_speed_rad_s: sign * f64::from(read.speed) / self.drive.speed_units * TAU,
            shaft_angle_rad: sign * read.position as f64 / self.drive.units_per_turn * TAU,
            supply_v: std::mem::replace(&mut self.supply_v, f64::NAN),
            ..Signals::UNKNOWN
        }));
    }

    fn fault(&self, state: State) -> Option<String> {
        let error = |code: u16| format!("error {code:#06x}, {}", meaning(code));
        if state.is_fault() {
            Some(format!(
                "it is in {state}: {}\nhint: its manual has the code; it is reset while the output is off",
                error(self.learned.error)
            ))
        } else if let Some(code) = self.emergency {
            Some(format!("it sent an emergency message: {}\nhint: its manual has the code", error(code)))
        } else if self.entered && state != State::Enabled {
            Some(format!(
                "it left operation enabled by itself: it is in {state}\nhint: STO, main supply, its enable input?"
            ))
        } else if f64::from(self.exchanges_on) > ENTERING_S * self.drive.wired.rate_hz
            && state != State::Enabled
        {
            Some(format!(
                "it stays in {state}, not in operation enabled\nhint: main supply, STO, its enable input?"
            ))
        } else {
            None
        }
    }

    /// Control word of this exchange.
    fn control(&self, on: bool) -> u16 {
        let state = self.told.state.unwrap_or(State::NotReady);
        if !on {
            state.towards_off(self.exchanges / EDGE_EVERY % 2 == 1)
        } else if self.entered && state != State::Enabled {
            // It left by itself; nothing is resumed.
            0
        } else {
            state.towards_enabled()
        }
    }

    /// The target in the drive's units; none of it before the drive follows.
    fn target(&self, drive: f64) -> f64 {
        let drive =
            if self.told.state == Some(State::Enabled) { self.drive.wired.sign() * drive } else { 0.0 };
        match self.drive.kind {
            DriveKind::Speed => drive / TAU * self.drive.speed_units,
            _ if self.learned.rated_a > 0.0 => drive / self.learned.rated_a * 1e3,
            _ => 0.0,
        }
    }
}

impl link::Protocol for Protocol {
    fn begin(&mut self) {
        *self = Self::new(self.drive.clone());
    }

    fn ask(&mut self, out: &mut Vec<u8>, heard: &mut dyn FnMut(Heard)) {
        match self.stage {
            Stage::Guarded => return,
            Stage::Refused if self.asked < REFUSED_FOR => return self.asked += 1,
            Stage::Refused => self.begin(),
            Stage::Setup(_) | Stage::Starting => (),
        }
        if self.asked == ASKED_IN_VAIN {
            heard(Heard::Unguarded(match self.stage {
                Stage::Starting => "does not go into operation: no heartbeat of it says so\nhint: does its manual name a condition for NMT start?".into(),
                Stage::Setup(0) => "does not answer\nhint: `address`, `bitrate`, CAN high and low, 120 ohm at both ends, its supply".to_owned(),
                _ => "no longer answers amid its setup\nhint: loose bus wiring, an overloaded bus, or two drives of one node".to_owned(),
            }));
            self.begin();
        }
        if self.stage == Stage::Setup(0) {
            if self.asked == 0 {
                self.open(out);
            }
            self.send(NMT, &[PRE_OPERATIONAL, self.drive.node], out);
        }
        self.asked += 1;
        self.step_now(out);
    }

    fn reply(&mut self, out: &mut Vec<u8>) {
        if std::mem::take(&mut self.go_on) {
            self.step_now(out);
        }
    }

    // The command acts at the SYNC, which asks for the reading too and is never left out. Nothing in an answer tells its SYNC:
    // both answers and that to a poll go the same way, one behind the other, and a poll's is its own.
    fn ages(&self) -> Ages {
        Ages::Exchanges
    }

    fn tell(&mut self, drive: Option<f64>, question: bool, out: &mut Vec<u8>) {
        // Four heartbeats in the time-out, and only with a command: a servo that stands still feeds nothing.
        let every = (self.drive.wired.timeout_s * self.drive.wired.rate_hz / 4.0) as u32;
        if self.exchanges.is_multiple_of(every.max(1)) {
            self.send(HEARTBEAT + u16::from(self.drive.ours()), &[OPERATIONAL], out);
        }
        let target = drive.map_or(0.0, |drive| self.target(drive)).round();
        let [low, high] = self.control(drive.is_some()).to_le_bytes();
        // Casts saturate.
        match self.drive.kind {
            DriveKind::Speed => {
                let [a, b, c, d] = (target as i32).to_le_bytes();
                self.to_drive(TARGET, &[low, high, a, b, c, d], out);
            }
            _ => {
                let [a, b] = (target as i16).to_le_bytes();
                self.to_drive(TARGET, &[low, high, a, b], out);
            }
        }
        self.send(SYNC, &[], out);
        if self.stage == Stage::Guarded && question {
            self.polls = (self.polls + 1) % POLLS.len();
            if let Some((index, sub, bytes)) = POLLS.get(self.polls) {
                self.to_drive(SDO_QUESTION, &request(*index, *sub, Job::Read(*bytes)), out);
            }
        }
        self.on = drive.is_some();
        self.entered &= self.on;
        self.exchanges = self.exchanges.wrapping_add(1);
    }

    fn hear(&mut self, bytes: &[u8], heard: &mut dyn FnMut(Heard)) {
        for frame in self.frames.take(bytes) {
            self.frame(&frame, heard);
        }
    }
}
