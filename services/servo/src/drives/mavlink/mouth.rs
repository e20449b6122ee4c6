//! What kort says: messages in their frames.

use mavlink::dialects::ardupilotmega as msg;
use mavlink::{MavHeader, MessageData};
use msg::{MavCmd, MavModeFlag};

use super::frame::frame;

/// kort's component number, an onboard computer's.
pub const OURS: u8 = 191;
/// The autopilot's.
pub const AUTOPILOT: u8 = 1;
/// Disarms whatever stands against it: second parameter of `MAV_CMD_COMPONENT_ARM_DISARM`.
pub const FORCE: f32 = 21196.0;
/// Parameters of a motor test: the value is a pulse width, the number an output's.
const AS_WIDTH: f32 = 1.0;
const BY_OUTPUT: f32 = 2.0;

/// Speaks to one vehicle, as a part of it.
#[derive(Clone, Copy, Debug)]
pub struct Mouth {
    system: u8,
    sequence: u8,
}

impl Mouth {
    /// To the vehicle with this system number.
    pub fn new(system: u8) -> Self {
        Self { system, sequence: 0 }
    }

    fn say<D: MessageData>(&mut self, data: &D, out: &mut Vec<u8>) {
        let (system_id, component_id) = (u32::from(self.system), OURS);
        frame(MavHeader { system_id, component_id, sequence: self.sequence }, data, out);
        self.sequence = self.sequence.wrapping_add(1);
    }

    /// A command, with those of its parameters that are used here.
    pub fn command(
        &mut self,
        command: MavCmd,
        [param1, param2, param3, param6]: [f32; 4],
        out: &mut Vec<u8>,
    ) {
        let data = msg::COMMAND_LONG_DATA {
            param1,
            param2,
            param3,
            param6,
            command,
            target_system: self.system,
            target_component: AUTOPILOT,
            ..Default::default()
        };
        self.say(&data, out);
    }

    /// A motor, from 1, at this pulse width, us.
    pub fn test(&mut self, motor: u32, width: u16, out: &mut Vec<u8>) {
        let motor = motor.saturating_sub(1) as f32;
        self.command(MavCmd::MAV_CMD_DO_MOTOR_TEST, [motor, AS_WIDTH, f32::from(width), BY_OUTPUT], out);
    }

    /// kort is there: an onboard computer, and no ground station.
    pub fn heartbeat(&mut self, out: &mut Vec<u8>) {
        let ours = msg::HEARTBEAT_DATA {
            mavtype: msg::MavType::MAV_TYPE_ONBOARD_CONTROLLER,
            autopilot: msg::MavAutopilot::MAV_AUTOPILOT_INVALID,
            base_mode: MavModeFlag::empty(),
            system_status: msg::MavState::MAV_STATE_ACTIVE,
            mavlink_version: 3,
            ..Default::default()
        };
        self.say(&ours, out);
    }

    /// What is its clock? The answer holds `known_by`.
    pub fn time(&mut self, known_by: i64, out: &mut Vec<u8>) {
        self.say(&msg::TIMESYNC_DATA { tc1: 0, ts1: known_by, ..Default::default() }, out);
    }

    /// A parameter, please.
    pub fn parameter(&mut self, name: &str, out: &mut Vec<u8>) {
        let wanted = msg::PARAM_REQUEST_READ_DATA {
            param_index: -1,
            target_system: self.system,
            target_component: AUTOPILOT,
            param_id: name.into(),
        };
        self.say(&wanted, out);
    }
}
