//! What a session stops for.

use thiserror::Error;

/// Something unexpected. The session is over, the drive at zero.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum Stop {
    /// A signal that is needed never came.
    #[error(
        "nothing shows `{signal}`: its sensor is dead or not connected\nhint: look at its cable and at `{signal}` of `GET /v1/thrusters/ID`; docs/hardware.md says which instrument gives which signal"
    )]
    Silent {
        /// The signal.
        signal: &'static str,
    },
    /// The shaft turns although nothing drives it.
    #[error(
        "the shaft turned by {angle_rad:.2} rad while nothing drove it\nhint: still water and nobody at the propeller; or the drive has a master of its own"
    )]
    TurnsByItself {
        /// How far, rad.
        angle_rad: f64,
    },
    /// No motion is seen, whatever is commanded, and nothing else answers either.
    #[error(
        "the shaft shows no motion at {drive:.3} {unit}: it is blocked, or its sensor is dead{seen}\nhint: switch the supply off and turn the shaft by hand: it must turn freely, and `shaft_angle_rad` must follow; `full_drive_s` in [thrusters.ID.limits] longer than 0.05 keeps a short pulse from its drive"
    )]
    NoMotion {
        /// The largest drive tried.
        drive: f64,
        /// Its unit.
        unit: &'static str,
        /// What else was seen.
        seen: &'static str,
    },
    /// It moves the same way under both signs.
    #[error(
        "the shaft moves the same way whichever way it is driven\nhint: a speed or angle without its sign, or a stream that turns the propeller"
    )]
    OneWay,
    /// Command and shaft sensor disagree; what pushes says that the motor is right.
    #[error(
        "the shaft sensor is reversed: driven ahead it shows astern, while {witness}\nhint: swap the encoder's A and B, or its sign in the drive's own tool"
    )]
    EncoderReversed {
        /// What says so.
        witness: String,
    },
    /// Command and shaft sensor disagree; what pushes says that the sensor is right.
    #[error(
        "the motor is reversed: driven ahead the shaft turns astern, as {witness}\nhint: swap two of the motor's three wires, or its direction in the drive's own tool"
    )]
    MotorReversed {
        /// What says so.
        witness: String,
    },
    /// Command and shaft sensor disagree, and nothing else tells which of them is wrong.
    #[error(
        "motor or shaft sensor is reversed: driven ahead the sensor shows astern, and no thrust or flow says which\nhint: look at the shaft: if it turns ahead swap the encoder's A and B, else two of the motor's wires"
    )]
    MotorOrEncoderReversed,
    /// An instrument has the wrong sign.
    #[error(
        "`{signal}` has the wrong sign: {witness}\nhint: `scale = -1.0` for it in [thrusters.ID.sensors.…], or turn the instrument round"
    )]
    SignalReversed {
        /// The signal.
        signal: &'static str,
        /// What says so.
        witness: String,
    },
    /// Motor and encoder agree, all that pushes says astern.
    #[error(
        "the thruster pushes astern when it is driven ahead: {witness}\nhint: `reversed = true` in [thrusters.ID.drive] turns command, current, speed and angle together"
    )]
    PushesAstern {
        /// What says so.
        witness: String,
    },
    /// Motor and encoder agree, the only instrument that shows a push says astern.
    #[error(
        "`{signal}` or the thruster is reversed: driven ahead the shaft turns ahead and {witness}, and nothing else says which\nhint: look which way the water goes: if ahead, `scale = -1.0` for `{signal}` in [thrusters.ID.sensors.…]; if astern, `reversed = true` in [thrusters.ID.drive], which turns command, current, speed and angle together"
    )]
    SignalOrThrusterReversed {
        /// The signal.
        signal: &'static str,
        /// What it says.
        witness: String,
    },
    /// The shaft ran further than it was to.
    #[error(
        "the shaft ran on: {angle_rad:.2} rad where {allowed_rad:.2} rad was the bound\nhint: the stated inertia may be far too large; see motor.inertia_kg_m2 of the rig"
    )]
    RanOn {
        /// How far, rad.
        angle_rad: f64,
        /// How far it was to turn at most, rad.
        allowed_rad: f64,
    },
}
