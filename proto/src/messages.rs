//! Fixed-layout messages. Every message starts with a [`Header`]; numbers are SI; NaN means "not
//! there". Enumerations travel as `u32` and are read through `from_u32`, so that a foreign value
//! is an answer and not undefined behaviour.

use crate::signals::{Estimates, Signals};
use crate::text::Text;
#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

/// Most control laws in one message.
pub const LAWS: usize = 16;

macro_rules! message {
    ($type_name:literal, $(#[$doc:meta])* $name:ident { $($(#[$field_doc:meta])* $field:ident: $type:ty,)* }) => {
        $(#[$doc])*
        #[repr(C)]
        #[derive(Clone, Copy, Debug, Default, PartialEq)]
        #[cfg_attr(feature = "transport", derive(ZeroCopySend))]
        #[cfg_attr(feature = "transport", type_name($type_name))]
        pub struct $name {
            $($(#[$field_doc])* pub $field: $type,)*
        }
    };
}

macro_rules! enumeration {
    ($(#[$doc:meta])* $name:ident { $($(#[$case_doc:meta])* $case:ident = $value:literal $word:literal,)* }) => {
        $(#[$doc])*
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u32)]
        pub enum $name { $($(#[$case_doc])* $case = $value,)* }

        impl $name {
            /// Reads it from a message; `None` for a value this version does not know.
            pub const fn from_u32(value: u32) -> Option<Self> {
                match value {
                    $($value => Some(Self::$case),)*
                    _ => None,
                }
            }

            /// Its word in logs and JSON.
            pub const fn name(self) -> &'static str {
                match self { $(Self::$case => $word,)* }
            }
        }
    };
}

mod answered;
mod freshness;
mod kinds;
mod parameters;
mod timing;
pub use answered::Answered;
pub use freshness::{Fresh, Freshness};
pub use kinds::{DriveKind, Outcome, Process, RequestKind, SetpointKind};
pub use parameters::{LAW_PARAMETERS, PARAMETERS, Parameter, ParameterTable};
pub use timing::{LATENESS_BOUNDS_NS, Timing};

message! { "kort.Header",
    /// In front of every message.
    Header {
        /// Counts up by one a message of one sender; a repeated or smaller one is old.
        sequence: u64,
        /// CLOCK_MONOTONIC when sent, ns.
        stamp_ns: u64,
        /// The sending process's start on CLOCK_MONOTONIC, ns: changes when it restarts.
        session: u64,
    }
}

message! { "kort.Setpoint",
    /// Gateway to controller, sent again every heartbeat so that silence means loss.
    Setpoint {
        /// Sequence, stamp, session of the gateway.
        header: Header,
        /// Counts accepted operator commands of this gateway session.
        generation: u64,
        /// When the operator's command was accepted, CLOCK_MONOTONIC, ns. Only one given after the arming counts.
        given_at_ns: u64,
        /// End of the lease on CLOCK_MONOTONIC, ns; zero without a lease.
        lease_until_ns: u64,
        /// [`SetpointKind`]
        kind: u32,
        /// Spare, zero.
        reserved: u32,
        /// Value in the unit of the kind.
        value: f64,
    }
}

message! { "kort.Command",
    /// Controller to servo, one a controller tick.
    Command {
        /// Sequence, stamp, session of the controller.
        header: Header,
        /// Stamp of the telemetry this command answers, ns.
        telemetry_stamp_ns: u64,
        /// The drive, in the unit of `kind`.
        drive: f64,
        /// Thrust setpoint in force, N; NaN if none (for the recording).
        thrust_cmd_n: f64,
        /// Shaft speed asked for, rad/s; NaN if none (for the recording).
        speed_cmd_rad_s: f64,
        /// [`DriveKind`]
        kind: u32,
        /// Non-zero: stop, zero output and disarm now; [`Command::ENDS`] where that is because the controller itself ends.
        stop: u32,
    }
}

impl Command {
    /// The `stop` of a controller that has nothing to command, for a lease that ended or a fault.
    pub const STOPS: u32 = 1;
    /// The `stop` of a controller that is told to end: nobody asked the drive to.
    pub const ENDS: u32 = 2;
}

message! { "kort.Trip",
    /// A stop that nobody asked for, and what the thruster did just before it.
    Trip {
        /// When, on CLOCK_MONOTONIC, ns; zero: there was none.
        at_ns: u64,
        /// Thrust before, N; NaN if not measured.
        thrust_n: f64,
        /// Shaft speed before, rad/s; NaN if not measured.
        shaft_speed_rad_s: f64,
        /// Drive before, in the unit of the drive.
        drive: f64,
    }
}

message! { "kort.Telemetry",
    /// Servo to all, one a servo tick: a whole row of the recording and the servo's state.
    Telemetry {
        /// Sequence, stamp, session of the servo.
        header: Header,
        /// The instant of the tick on CLOCK_MONOTONIC, ns: `time_s` of the row.
        time_ns: u64,
        /// Every column; NaN if not measured.
        signals: Signals,
        /// Latched faults, bits of [`Fault`](crate::faults::Fault).
        faults: u64,
        /// Limits in force, bits of [`Limit`](crate::limits::Limit).
        limits: u64,
        /// Armed: the drive may be non-zero.
        armed: u32,
        /// [`DriveKind`] of the amplifier.
        drive_kind: u32,
        /// When it was armed last on CLOCK_MONOTONIC, ns; zero if never.
        armed_at_ns: u64,
        /// Sequence of the command in force.
        command_sequence: u64,
        /// Stamp of the command in force, ns.
        command_stamp_ns: u64,
        /// Telemetry stamp the command in force answers, ns.
        command_telemetry_stamp_ns: u64,
        /// Commands refused since start: not finite, out of range, wrong kind.
        commands_invalid: u64,
        /// Commands ignored since start: repeated, reordered or too old.
        commands_stale: u64,
        /// Share of the I2t budget in use, 0 to 1.
        thermal_load: f64,
        /// How old the newest reading of the shaft speed is at `time_ns`, ns.
        shaft_age_ns: u64,
        /// How long a reading of the shaft speed stands, ns; after that it is not measured.
        shaft_life_ns: u64,
        /// Largest drive the servo takes, in the unit of the drive.
        drive_max: f64,
        /// The last stop that nobody asked for; all zero without one.
        tripped: Trip,
        /// The loop's timing.
        timing: Timing,
    }
}

message! { "kort.ControllerState",
    /// Controller to gateway, one a controller tick.
    ControllerState {
        /// Sequence, stamp, session of the controller.
        header: Header,
        /// Law that runs.
        law: Text<32>,
        /// Observer that runs.
        observer: Text<32>,
        /// Estimator that runs.
        estimator: Text<32>,
        /// Parameters of the controller that may be changed.
        law_parameters: ParameterTable,
        /// How many are used.
        law_parameter_count: u32,
        /// [`SetpointKind`] in force.
        setpoint_kind: u32,
        /// Setpoint in force, after ramps and limits; what the law is given now.
        setpoint_value: f64,
        /// Setpoint as accepted, before ramps and limits.
        setpoint_accepted: f64,
        /// Gateway session of the setpoint in force.
        setpoint_session: u64,
        /// Generation of the setpoint in force.
        setpoint_generation: u64,
        /// Largest thrust the controller takes, N.
        thrust_max_n: f64,
        /// Largest shaft speed the controller takes, rad/s.
        speed_max_rad_s: f64,
        /// Setpoints refused since start: not finite, out of range, unknown kind.
        setpoints_invalid: u64,
        /// What the observer believes.
        estimates: Estimates,
        /// Revision of the rig description that it runs on.
        rig_revision: u64,
        /// The estimator's parameters.
        parameters: [Parameter; PARAMETERS],
        /// How many are used.
        parameter_count: u32,
        /// Non-zero: the estimator is frozen for want of excitation.
        estimator_frozen: u32,
        /// Latched faults, bits of [`Fault`](crate::faults::Fault).
        faults: u64,
        /// Limits in force, bits of [`Limit`](crate::limits::Limit).
        limits: u64,
        /// Every law that can be chosen.
        laws: [Text<32>; LAWS],
        /// How many are used.
        law_count: u32,
        /// Path that has changed since what is usual was learnt, from 1 in the order of [`PATHS`]; zero without an alarm.
        mismatch_path: u32,
        /// How near each path is to an alarm, as [`PATHS`]: 1 is one; NaN while what is usual is learnt.
        mismatch_level: [f64; 5],
        /// Time since the mismatch began, s.
        mismatch_since_s: f64,
        /// What it was off the rig as stated in the last minute of driving, as [`RESIDUALS`]; NaN before that is known.
        mismatch_lately: [f64; 6],
        /// The loop's timing.
        timing: Timing,
    }
}

/// Paths of a thruster that a mismatch is told of, by their names in a diagnosis.
pub const PATHS: [&str; 5] = ["drive", "shaft", "blade", "flow", "sensor"];

/// What a mismatch is seen in: shares of what the model expects, but for the last two, which are shares of the largest thrust and
/// of the largest current.
pub const RESIDUALS: [&str; 6] = ["current", "torque", "thrust", "flow", "thrust_at_rest", "current_late"];

message! { "kort.Request",
    /// Gateway (or supervisor) to servo and controller. Whom the kind concerns answers with one [`Reply`]: arm, servo;
    /// disarm and clear-faults, both; the rest, controller. One older than [`REQUEST_LIFE_NS`] is not acted upon, but for
    /// a disarming; one that was answered is answered again, see [`Answered`].
    Request {
        /// Sequence, stamp, session of the sender.
        header: Header,
        /// Chosen by the sender, comes back in the reply; one that asks no answer has 0.
        id: u64,
        /// Revision of the rig description to go on with.
        rig_revision: u64,
        /// [`RequestKind`]
        kind: u32,
        /// How many parameters are used.
        parameter_count: u32,
        /// Law to switch to; empty keeps the present one.
        law: Text<32>,
        /// Observer to switch to; empty keeps the present one.
        observer: Text<32>,
        /// Estimator to switch to; empty keeps the present one.
        estimator: Text<32>,
        /// Parameters to set: only `name` and `value` count.
        parameters: [Parameter; PARAMETERS],
    }
}

/// A request older than this is not acted upon, ns.
pub const REQUEST_LIFE_NS: u64 = 500_000_000;

/// A controller that was asked to stand aside, and is not asked again, takes its place again after this time, ns.
pub const ASIDE_NS: u64 = 500_000_000;

message! { "kort.Reply",
    /// The answer to a request.
    Reply {
        /// Sequence, stamp, session of the answering process.
        header: Header,
        /// Session of the asker.
        to_session: u64,
        /// Id of the request.
        id: u64,
        /// [`Process`] that answers.
        from: u32,
        /// [`Outcome`]
        outcome: u32,
        /// Words for the operator: why not, and what to do.
        message: Text<240>,
    }
}

impl Reply {
    /// An answer to a request; the words are cut at 240 bytes. Allocates nothing.
    pub fn to(request: &Request, from: Process, outcome: Outcome, words: std::fmt::Arguments) -> Self {
        let mut reply = Self {
            to_session: request.header.session,
            id: request.id,
            from: from as u32,
            outcome: outcome as u32,
            ..Self::default()
        };
        let _ = std::fmt::Write::write_fmt(&mut reply.message, words);
        reply
    }
}

/// A message with its header in front.
pub trait Message: Copy + Default + std::fmt::Debug + 'static {
    /// Its header.
    fn header(&self) -> &Header;
    /// Its header, to be stamped by the sender.
    fn header_mut(&mut self) -> &mut Header;
}

macro_rules! messages {
    ($($name:ident),*) => {
        $(impl Message for $name {
            fn header(&self) -> &Header {
                &self.header
            }
            fn header_mut(&mut self) -> &mut Header {
                &mut self.header
            }
        })*
    };
}

messages!(Setpoint, Command, Telemetry, ControllerState, Request, Reply);
