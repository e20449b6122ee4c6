//! A drive of the profile CiA 402 on CANopen, in cyclic synchronous torque and velocity: state machine, option codes, and a motor
//! with a thruster on it.

use std::f64::consts::TAU;

use kort_thruster::rig::{AmplifierKind, Rig};

use crate::bench::Truth;
use crate::canopen::{At, CanOpen, Event};
use crate::slcan::{Frame, Node};
use crate::stand::Stand;

/// Time from power to the boot-up message, s.
const BOOT_S: f64 = 0.3;

/// How this one is made and set.
#[derive(Clone, Debug)]
pub struct Make {
    /// Its node on the bus.
    pub node: u8,
    /// Digit of its bit rate.
    pub bitrate: u8,
    /// Its serial number.
    pub serial: u32,
    /// What is stored in it, over what it is delivered with: object, bytes, value.
    pub stored: Vec<(At, u8, u32)>,
    /// Objects that it lets nobody write.
    pub locked: Vec<At>,
    /// Objects that it does not have.
    pub without: Vec<At>,
}

impl Default for Make {
    fn default() -> Self {
        Self {
            node: 1,
            bitrate: 8,
            serial: 0x00a1_b2c3,
            stored: Vec::new(),
            locked: Vec::new(),
            without: Vec::new(),
        }
    }
}

/// States of the profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum State {
    SwitchOnDisabled,
    ReadyToSwitchOn,
    SwitchedOn,
    OperationEnabled,
    QuickStopActive,
    FaultReactionActive,
    Fault,
}

/// An emulated drive with a thruster.
pub struct Cia402 {
    make: Make,
    node: CanOpen,
    stand: Stand,
    state: State,
    /// The cause of its fault, as long as it stands.
    cause: u16,
    /// The control word before, for the edge of a reset.
    control: u16,
    now_s: f64,
    boots_s: Option<f64>,
}

impl Cia402 {
    /// Encoder counts in a turn.
    pub const COUNTS: f64 = 4096.0;
    /// Rated current, mA.
    const RATED_MA: u32 = 10_000;

    /// One with the rig's motor on it.
    pub fn new(make: Make, rig: &Rig) -> Self {
        Self {
            node: dictionary(&make),
            stand: Stand::new(rig),
            state: State::SwitchOnDisabled,
            cause: 0,
            control: 0,
            now_s: 0.0,
            boots_s: None,
            make,
        }
    }

    fn signed(&self, at: At) -> f64 {
        f64::from(self.node.get(at) as i32)
    }

    /// What the power stage is asked for, in the unit of the rig's amplifier.
    fn asked(&self) -> f64 {
        let rated_a = f64::from(self.node.get((0x6075, 0))) * 1e-3;
        let mode = self.node.get((0x6061, 0));
        let units_a_turn_s = match self.node.get((0x60a9, 0)) {
            0x00b4_4700 => 60.0,
            _ => Self::COUNTS,
        };
        match (self.state, self.stand.kind()) {
            (State::OperationEnabled, AmplifierKind::Current) if mode == 10 => {
                f64::from(self.node.get((0x6071, 0)) as u16 as i16) * 1e-3 * rated_a
            }
            (State::OperationEnabled, AmplifierKind::Speed) if mode == 9 => {
                self.signed((0x60ff, 0)) / units_a_turn_s * TAU
            }
            // Whoever does not coast brakes.
            (State::FaultReactionActive | State::QuickStopActive, AmplifierKind::Current) => {
                -0.3 * rated_a * self.stand.shaft_speed_rad_s().signum()
            }
            _ => 0.0,
        }
    }

    /// The control word was written.
    fn ordered(&mut self) -> Vec<Frame> {
        let word = self.node.get((0x6040, 0)) as u16;
        let before = std::mem::replace(&mut self.control, word);
        let (shutdown, disable, quick_stop) = (word & 7 == 6, word & 2 == 0, word & 6 == 2);
        let (switch_on, enable) = (word & 0xf == 7, word & 0xf == 0xf);
        if self.state == State::Fault {
            if word & !before & 0x80 != 0 && self.cause == 0 {
                self.state = State::SwitchOnDisabled;
                self.node.set((0x603f, 0), 0);
                return vec![self.node.emergency(0, 0)];
            }
            return Vec::new();
        }
        self.state = match self.state {
            State::ReadyToSwitchOn | State::SwitchedOn | State::OperationEnabled | State::QuickStopActive
                if disable =>
            {
                State::SwitchOnDisabled
            }
            State::ReadyToSwitchOn | State::SwitchedOn if quick_stop => State::SwitchOnDisabled,
            State::OperationEnabled if quick_stop => State::QuickStopActive,
            State::SwitchOnDisabled | State::SwitchedOn | State::OperationEnabled if shutdown => {
                State::ReadyToSwitchOn
            }
            State::ReadyToSwitchOn | State::OperationEnabled if switch_on => State::SwitchedOn,
            // From ready it goes through switched on by itself, as the profile allows.
            State::ReadyToSwitchOn | State::SwitchedOn if enable => State::OperationEnabled,
            other => other,
        };
        Vec::new()
    }

    fn fails(&mut self, code: u16) -> Vec<Frame> {
        let off = self.state != State::OperationEnabled;
        // With 0 the output is off at once; with everything else it brakes first.
        let coasts = self.node.get((0x605e, 0)) == 0;
        self.state = if off || coasts { State::Fault } else { State::FaultReactionActive };
        self.node.set((0x603f, 0), code.into());
        vec![self.node.emergency(code, 1)]
    }

    fn events(&mut self) -> Vec<Frame> {
        let mut said = Vec::new();
        for event in std::mem::take(&mut self.node.events) {
            match event {
                Event::Written((0x6040, 0)) => said.extend(self.ordered()),
                Event::Written((0x6060, 0)) => {
                    let mode = self.node.get((0x6060, 0));
                    if (1..=32).contains(&mode) && self.node.get((0x6502, 0)) & 1 << (mode - 1) != 0 {
                        self.node.set((0x6061, 0), mode);
                    }
                }
                Event::Written(_) => (),
                Event::HeartbeatLost => match self.node.get((0x6007, 0)) as u16 as i16 {
                    1 => said.extend(self.fails(0x8130)),
                    2 => self.leave(State::SwitchOnDisabled),
                    3 => self.leave(State::QuickStopActive),
                    _ => (),
                },
            }
        }
        said
    }

    /// Leaves for this state, unless there is a fault.
    fn leave(&mut self, to: State) {
        if self.state == State::OperationEnabled
            || (to == State::SwitchOnDisabled && self.state != State::Fault)
        {
            self.state = to;
        }
    }

    /// What it measures, and its state, into the objects.
    fn measure(&mut self) {
        let status = match self.state {
            State::SwitchOnDisabled => 0x0240,
            State::ReadyToSwitchOn => 0x0221,
            State::SwitchedOn => 0x0233,
            State::OperationEnabled => 0x1237,
            State::QuickStopActive => 0x0217,
            State::FaultReactionActive => 0x021f,
            State::Fault => 0x0208,
        };
        self.node.set((0x6041, 0), status);
        let units_a_turn_s = if self.node.get((0x60a9, 0)) == 0x00b4_4700 { 60.0 } else { Self::COUNTS };
        let counts = (self.stand.shaft_angle_rad() / TAU * Self::COUNTS).floor() as i64 as i32;
        let speed = (self.stand.shaft_speed_rad_s() / TAU * units_a_turn_s).round() as i32;
        let rated_a = f64::from(self.node.get((0x6075, 0))) * 1e-3;
        let torque = (self.stand.current_a() / rated_a * 1e3).round() as i16;
        self.node.set((0x6064, 0), counts as u32);
        self.node.set((0x606c, 0), speed as u32);
        self.node.set((0x6077, 0), u32::from(torque as u16));
        self.node.set((0x6079, 0), (self.stand.supply_v() * 1e3) as u32);
    }
}

/// Its objects, as it is delivered and stored.
fn dictionary(make: &Make) -> CanOpen {
    let mut node = CanOpen::new(make.node);
    for (at, bytes, value, writable) in [
        ((0x1000, 0), 4, 0x0002_0192, false),
        ((0x1018, 1), 4, 0x9a, false),
        ((0x1018, 2), 4, 0x0003_0924, false),
        ((0x1018, 4), 4, make.serial, false),
        ((0x6007, 0), 2, 1, true),
        ((0x603f, 0), 2, 0, false),
        ((0x6040, 0), 2, 0, true),
        ((0x6041, 0), 2, 0x0240, false),
        // Braking on the ramp of a quick stop.
        ((0x605e, 0), 2, 2, true),
        ((0x6060, 0), 1, 1, true),
        ((0x6061, 0), 1, 1, false),
        ((0x6064, 0), 4, 0, false),
        ((0x606c, 0), 4, 0, false),
        ((0x6071, 0), 2, 0, true),
        ((0x6075, 0), 4, Cia402::RATED_MA, true),
        ((0x6077, 0), 2, 0, false),
        ((0x6079, 0), 4, 0, false),
        ((0x60ff, 0), 4, 0, true),
        ((0x6502, 0), 4, 0x03ed, false),
    ] {
        node.object(at, bytes, value, writable);
    }
    make.stored.iter().for_each(|(at, bytes, value)| node.object(*at, *bytes, *value, true));
    make.locked.iter().for_each(|at| node.lock(*at));
    make.without.iter().for_each(|at| node.remove(*at));
    node
}

impl Node for Cia402 {
    fn bitrate(&self) -> u8 {
        self.make.bitrate
    }

    fn frame(&mut self, now_s: f64, frame: &Frame) -> Vec<Frame> {
        self.now_s = now_s;
        if self.boots_s.is_some() {
            return Vec::new();
        }
        self.measure();
        let mut said = self.node.frame(now_s, frame);
        said.extend(self.events());
        said
    }

    fn live(&mut self, now_s: f64) -> Vec<Frame> {
        self.now_s = now_s;
        let mut said = Vec::new();
        if let Some(boots_s) = self.boots_s {
            if now_s >= boots_s {
                self.boots_s = None;
                said.push(self.node.boot());
            }
        } else {
            said.extend(self.node.live(now_s));
            said.extend(self.events());
            if self.cause != 0 && !matches!(self.state, State::Fault | State::FaultReactionActive) {
                said.extend(self.fails(self.cause));
            }
        }
        // Braked to rest.
        if self.stand.shaft_speed_rad_s().abs() < 0.5 {
            self.state = match self.state {
                State::FaultReactionActive => State::Fault,
                State::QuickStopActive => State::SwitchOnDisabled,
                other => other,
            };
        }
        self.stand.turn_to(now_s, self.asked());
        said
    }

    fn restart(&mut self, now_s: f64) {
        self.node = dictionary(&self.make);
        (self.state, self.cause, self.control) = (State::SwitchOnDisabled, 0, 0);
        self.boots_s = Some(now_s + BOOT_S);
    }

    fn report(&mut self, code: u32) {
        self.cause = code as u16;
    }

    fn truth(&self) -> Truth {
        self.stand.truth(self.asked())
    }
}
