//! Faults with stable codes; each has a page in `docs/faults/`. A fault of servo or controller is latched: the output is
//! zero and disarmed until the cause is gone and someone clears it. One of the gateway stops nothing and keeps nobody
//! from arming; it is shown until someone clears it.

/// A fault. The discriminant is its code and its bit in a bitset; codes never change meaning.
/// 1 to 31 are raised by the servo, 33 to 47 by the controller, from 49 on by
/// the gateway.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Fault {
    /// Measured current beyond the trip level.
    OverCurrent = 1,
    /// Measured shaft speed beyond the trip level.
    OverSpeed = 2,
    /// Heating beyond what the I2t foldback could hold.
    ThermalOverload = 3,
    /// No new command from the controller within its time-out.
    CommandTimeout = 4,
    /// A command that is not a number, out of range or of the wrong kind.
    CommandInvalid = 5,
    /// A needed sensor gave NaN or infinity.
    SensorNotFinite = 6,
    /// The shaft sensor shows the same value while the motor pulls.
    SensorFrozen = 7,
    /// A sensor jumps faster than the thruster can move.
    SensorSpike = 8,
    /// The drive reports a fault of its own.
    AmplifierFault = 9,
    /// The supply is outside its band.
    SupplyOutOfRange = 10,
    /// The motor is too hot.
    OverTemperature = 11,
    /// The servo's loop stood still longer than the command time-out.
    LoopStalled = 12,
    /// The controller ended, or another process began to command, while armed; or one that had faults latched was replaced by
    /// one that knows nothing of them.
    ControllerRestarted = 13,
    /// The servo ended while armed: latched by itself where it was told to end, at its start by the successor of one that was
    /// killed.
    ServoRestarted = 14,
    /// The drive does not answer: unplugged, without power, or its answers are unreadable.
    DriveLost = 15,
    /// The drive was reset: what it had been told at its start is gone.
    DriveRestarted = 16,
    /// The drive's own time-out for a silent host is not confirmed.
    DriveUnguarded = 17,
    /// A sensor source that is required gives no readings.
    SensorLost = 18,
    /// The shaft sensor counts against the way the motor turns.
    SensorReversed = 19,
    /// The measured thrust contradicts torque and speed of the shaft.
    SensorImplausible = 20,
    /// The shaft is far too slow for the torque that it gets.
    ShaftSlow = 21,
    /// No word from the gateway within its time-out while armed.
    GatewayLost = 33,
    /// No telemetry from the servo within its time-out while armed.
    ServoLost = 34,
    /// The control law's output or the observer's state was not finite.
    ControlNotFinite = 35,
    /// Another gateway process took over while armed.
    GatewayRestarted = 36,
    /// The disk refused a recording, or has too little space for it.
    RecordingFailed = 49,
}

impl Fault {
    /// Every fault, in the order of codes.
    pub const ALL: [Self; 26] = [
        Self::OverCurrent,
        Self::OverSpeed,
        Self::ThermalOverload,
        Self::CommandTimeout,
        Self::CommandInvalid,
        Self::SensorNotFinite,
        Self::SensorFrozen,
        Self::SensorSpike,
        Self::AmplifierFault,
        Self::SupplyOutOfRange,
        Self::OverTemperature,
        Self::LoopStalled,
        Self::ControllerRestarted,
        Self::ServoRestarted,
        Self::DriveLost,
        Self::DriveRestarted,
        Self::DriveUnguarded,
        Self::SensorLost,
        Self::SensorReversed,
        Self::SensorImplausible,
        Self::ShaftSlow,
        Self::GatewayLost,
        Self::ServoLost,
        Self::ControlNotFinite,
        Self::GatewayRestarted,
        Self::RecordingFailed,
    ];

    /// Stable code.
    pub const fn code(self) -> u32 {
        self as u32
    }

    /// Its bit in a bitset.
    pub const fn bit(self) -> u64 {
        1 << self as u32
    }

    /// Name in the JSON state and as a metric's label; the page is `docs/faults/<name>.md`.
    pub const fn name(self) -> &'static str {
        match self {
            Self::OverCurrent => "over_current",
            Self::OverSpeed => "over_speed",
            Self::ThermalOverload => "thermal_overload",
            Self::CommandTimeout => "command_timeout",
            Self::CommandInvalid => "command_invalid",
            Self::SensorNotFinite => "sensor_not_finite",
            Self::SensorFrozen => "sensor_frozen",
            Self::SensorSpike => "sensor_spike",
            Self::AmplifierFault => "amplifier_fault",
            Self::SupplyOutOfRange => "supply_out_of_range",
            Self::OverTemperature => "over_temperature",
            Self::LoopStalled => "loop_stalled",
            Self::ControllerRestarted => "controller_restarted",
            Self::ServoRestarted => "servo_restarted",
            Self::DriveLost => "drive_lost",
            Self::DriveRestarted => "drive_restarted",
            Self::DriveUnguarded => "drive_unguarded",
            Self::SensorLost => "sensor_lost",
            Self::SensorReversed => "sensor_reversed",
            Self::SensorImplausible => "sensor_implausible",
            Self::ShaftSlow => "shaft_slow",
            Self::GatewayLost => "gateway_lost",
            Self::ServoLost => "servo_lost",
            Self::ControlNotFinite => "control_not_finite",
            Self::GatewayRestarted => "gateway_restarted",
            Self::RecordingFailed => "recording_failed",
        }
    }

    /// One line for the operator.
    pub const fn help(self) -> &'static str {
        match self {
            Self::OverCurrent => {
                "the motor drew more current than allowed: look for a short, a jam or a wrong limit"
            }
            Self::OverSpeed => {
                "the shaft ran faster than allowed: look for a lost propeller, air, or a wrong limit"
            }
            Self::ThermalOverload => "the motor has taken more heat than its I2t budget: let it cool",
            Self::CommandTimeout => {
                "the controller stopped sending commands: see its log, then clear and arm again"
            }
            Self::CommandInvalid => "a command was not a number or out of range: see the controller's log",
            Self::SensorNotFinite => "a sensor gave no number: check its cable and supply",
            Self::SensorFrozen => {
                "the shaft sensor stands still while the motor pulls: jammed shaft or dead sensor"
            }
            Self::SensorSpike => "a sensor jumped more than the thruster can move: check cable and shielding",
            Self::AmplifierFault => {
                "the drive reports a fault of its own: see its display or the servo's log"
            }
            Self::SupplyOutOfRange => "the supply voltage left its band: check battery, cable and charger",
            Self::OverTemperature => "the motor is too hot: let it cool, check cooling and load",
            Self::LoopStalled => "the servo's loop stood still: the machine is overloaded or was suspended",
            Self::ControllerRestarted => {
                "the controller ended or was replaced: see the event log, then clear and arm again"
            }
            Self::ServoRestarted => {
                "the servo ended while armed (told to end, killed, hung, or the whole service died): see the event log, then clear and arm again"
            }
            Self::DriveLost => {
                "the drive does not answer: check its cable, its power and `drive.port`; the servo's log says what was seen"
            }
            Self::DriveRestarted => {
                "the drive was reset while in use: look for a supply that dips, then clear and arm"
            }
            Self::DriveUnguarded => {
                "the drive's own time-out is not confirmed: the servo's log says why, docs/hardware.md how to set it"
            }
            Self::SensorLost => {
                "a required sensor gives no readings: check its cable, its power and its `port` or `path`"
            }
            Self::SensorReversed => {
                "the shaft sensor counts against the way the motor turns: check its phases and its sign"
            }
            Self::SensorImplausible => {
                "the measured thrust contradicts the shaft: check the cell's sign, its unit, and whether it moves at all"
            }
            Self::ShaftSlow => {
                "the shaft is far too slow for its torque: blocked or fouled, or its speed is told in a wrong unit (pole pairs)"
            }
            Self::GatewayLost => "the gateway stopped while armed: take the lease and arm again",
            Self::ServoLost => "the servo stopped sending telemetry: see its log",
            Self::ControlNotFinite => "the control law gave no number: check its parameters",
            Self::GatewayRestarted => "the gateway was replaced while armed: take the lease and arm again",
            Self::RecordingFailed => {
                "a recording ended by itself, thrust is untouched: GET /v1/recordings says why; make space, clear, record again"
            }
        }
    }

    /// The faults in a bitset, in the order of codes.
    pub fn in_set(set: u64) -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(move |fault| set & fault.bit() != 0)
    }
}

/// The names of the faults in a bitset, with their codes, for people; allocates nothing.
#[derive(Clone, Copy, Debug)]
pub struct Names(pub u64);

impl std::fmt::Display for Names {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (i, fault) in Fault::in_set(self.0).enumerate() {
            let comma = if i == 0 { "" } else { ", " };
            write!(f, "{comma}{} (code {})", fault.name(), fault.code())?;
        }
        Ok(())
    }
}

impl Fault {
    /// Is thrust ramped down before it is latched? The stop begins with the ramp then.
    pub const fn is_ramped(self) -> bool {
        matches!(self, Self::GatewayLost | Self::GatewayRestarted)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_in_order_and_every_fault_has_its_page() {
        assert!(Fault::ALL.windows(2).all(|w| w[0].code() < w[1].code()));
        for fault in Fault::ALL {
            let page = format!("{}/../docs/faults/{}.md", env!("CARGO_MANIFEST_DIR"), fault.name());
            let text = std::fs::read_to_string(&page).unwrap_or_else(|e| panic!("{page}: {e}"));
            assert!(text.contains(&format!("code {}", fault.code())), "{page} does not name its code");
            for part in ["## Cause", "## What kort did", "## What to do"] {
                assert!(text.contains(part), "{page} lacks \"{part}\"");
            }
        }
    }
}
