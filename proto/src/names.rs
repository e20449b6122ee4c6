//! Names of the shared-memory services. iceoryx2 compares only type name, size and alignment, so
//! swapped fields would pass unnoticed: the name carries the version of the messages.

/// Raised with every change to the layout or meaning of a message.
pub const MESSAGES_VERSION: u32 = 6;

/// One stream of one thruster.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stream {
    /// [`Setpoint`](crate::messages::Setpoint), gateway to controller.
    Setpoint,
    /// [`Command`](crate::messages::Command), controller to servo.
    Command,
    /// [`Telemetry`](crate::messages::Telemetry), servo to all.
    Telemetry,
    /// [`ControllerState`](crate::messages::ControllerState), controller to gateway.
    ControllerState,
    /// [`Request`](crate::messages::Request), gateway (or supervisor) to servo and controller.
    Request,
    /// [`Reply`](crate::messages::Reply), servo and controller to gateway.
    Reply,
    /// Event: the servo has sent telemetry.
    Tick,
}

impl Stream {
    /// Every stream.
    pub const ALL: [Self; 7] = [
        Self::Setpoint,
        Self::Command,
        Self::Telemetry,
        Self::ControllerState,
        Self::Request,
        Self::Reply,
        Self::Tick,
    ];

    /// Last part of the service name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Setpoint => "setpoint",
            Self::Command => "command",
            Self::Telemetry => "telemetry",
            Self::ControllerState => "controller_state",
            Self::Request => "request",
            Self::Reply => "reply",
            Self::Tick => "tick",
        }
    }

    /// Samples a subscriber may hold unread; the oldest falls out. Setpoints and commands are
    /// latest-value, telemetry is recorded whole, requests and replies must not be lost.
    pub const fn depth(self) -> usize {
        match self {
            Self::Setpoint | Self::Command | Self::Tick => 1,
            // Whoever reads it wants the newest.
            Self::ControllerState => 16,
            Self::Telemetry => 1024,
            Self::Request | Self::Reply => 16,
        }
    }

    /// Name of the service: version, thruster and the generation of the shared memory. A new
    /// generation begins when services have to be created afresh beside broken ones.
    pub fn service(self, thruster: &str, generation: u64) -> String {
        format!("kort/{MESSAGES_VERSION}/{generation}/{thruster}/{}", self.name())
    }
}

/// Is this a thruster's id: 1 to 16 lower-case letters, digits, `_` or `-`?
pub fn is_thruster_id(id: &str) -> bool {
    (1..=16).contains(&id.len())
        && id.bytes().all(|b| b.is_ascii_lowercase() || b.is_ascii_digit() || b == b'_' || b == b'-')
}
