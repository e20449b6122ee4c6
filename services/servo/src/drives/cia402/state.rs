//! The state machine of CiA 402: what the status word says, and which control word leads on.

use std::fmt;

/// State of the drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum State {
    /// It is starting.
    NotReady,
    /// Output off.
    SwitchOnDisabled,
    /// Output off, and it may be switched on.
    Ready,
    /// Output on, without torque.
    SwitchedOn,
    /// It follows its target.
    Enabled,
    /// It stops by itself.
    QuickStop,
    /// It reacts to a fault.
    FaultReaction,
    /// Output off, for a fault.
    Fault,
}

// Control words.
const DISABLE_VOLTAGE: u16 = 0x00;
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE: u16 = 0x0f;
/// Its rising edge counts.
pub const FAULT_RESET: u16 = 0x80;

impl State {
    /// The state that a status word (0x6041) says.
    pub fn of(status: u16) -> Self {
        match (status & 0x6f, status & 0x4f) {
            (0x21, _) => Self::Ready,
            (0x23, _) => Self::SwitchedOn,
            (0x27, _) => Self::Enabled,
            (0x07, _) => Self::QuickStop,
            (_, 0x40) => Self::SwitchOnDisabled,
            (_, 0x0f) => Self::FaultReaction,
            (_, 0x08) => Self::Fault,
            _ => Self::NotReady,
        }
    }

    /// There is a fault.
    pub fn is_fault(self) -> bool {
        matches!(self, Self::Fault | Self::FaultReaction)
    }

    /// The control word that leads from here towards `Enabled`; where no word does, output off.
    pub fn towards_enabled(self) -> u16 {
        match self {
            Self::SwitchOnDisabled => SHUTDOWN,
            Self::Ready => SWITCH_ON,
            Self::SwitchedOn | Self::Enabled => ENABLE,
            _ => DISABLE_VOLTAGE,
        }
    }

    /// The control word for output off. A fault is reset by an edge, which `edge` makes.
    pub fn towards_off(self, edge: bool) -> u16 {
        if self == Self::Fault && edge { FAULT_RESET } else { DISABLE_VOLTAGE }
    }
}

impl fmt::Display for State {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotReady => "not ready to switch on",
            Self::SwitchOnDisabled => "switch on disabled",
            Self::Ready => "ready to switch on",
            Self::SwitchedOn => "switched on",
            Self::Enabled => "operation enabled",
            Self::QuickStop => "quick stop active",
            Self::FaultReaction => "fault reaction active",
            Self::Fault => "fault",
        })
    }
}

/// What an error code (0x603F, and the first word of an emergency message) is about, by the classes of CiA 301 and 402.
pub fn meaning(code: u16) -> &'static str {
    match code {
        0x8110..=0x811f => "CAN overrun",
        0x8130 => "kort's heartbeat did not come",
        0x8140 => "it was off the bus",
        0x2000..=0x2fff => "current",
        0x3000..=0x3fff => "voltage",
        0x4000..=0x4fff => "temperature",
        0x5000..=0x5fff => "its hardware",
        0x6000..=0x6fff => "its software",
        0x7300..=0x73ff => "a sensor",
        0x7000..=0x7fff => "a module of it",
        0x8100..=0x81ff => "communication",
        0x8300..=0x83ff => "its torque controller",
        0x8400..=0x84ff => "its speed controller",
        0x8500..=0x86ff => "its position controller",
        0x9000..=0x9fff => "an external error",
        0xff00..=0xffff => "the maker's own code",
        _ => "an error without a class",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The patterns of the profile's table, with the bits that it leaves open both ways.
    #[test]
    fn every_status_word_is_the_state_of_the_table() {
        for (pattern, mask, state) in [
            (0x00, 0x4f, State::NotReady),
            (0x40, 0x4f, State::SwitchOnDisabled),
            (0x21, 0x6f, State::Ready),
            (0x23, 0x6f, State::SwitchedOn),
            (0x27, 0x6f, State::Enabled),
            (0x07, 0x6f, State::QuickStop),
            (0x0f, 0x4f, State::FaultReaction),
            (0x08, 0x4f, State::Fault),
        ] {
            for open in 0..=u16::MAX {
                assert_eq!(State::of(pattern | open & !mask), state, "{pattern:#x} {open:#x}");
            }
        }
    }

    #[test]
    fn no_word_leads_out_of_a_fault_but_the_edge_of_a_reset_while_off() {
        assert_eq!(State::Fault.towards_enabled(), DISABLE_VOLTAGE);
        assert_eq!((State::Fault.towards_off(true), State::Fault.towards_off(false)), (FAULT_RESET, 0));
        assert_eq!(State::Enabled.towards_off(true), DISABLE_VOLTAGE);
    }
}
