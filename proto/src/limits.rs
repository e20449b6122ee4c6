//! Limits in force: no faults, they say what holds the thruster back now and which setting does.

/// A limit and the setting that holds it. The discriminant is the bit in a bitset: 0 to 15 are
/// the servo's, 16 to 31 the controller's.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Limit {
    /// The servo clips the drive at its range.
    DriveRange = 0,
    /// The servo slows the change of the drive.
    DriveSlew = 1,
    /// The servo takes drive away near the largest shaft speed.
    DriveSpeed = 2,
    /// The servo folds back to the continuous current: the thermal budget is used up.
    Thermal = 3,
    /// The drive itself saturates (supply against back-EMF).
    Supply = 4,
    /// The law's current is clipped.
    Current = 16,
    /// The law's current changes as fast as it may.
    CurrentRate = 17,
    /// The thrust reference is clipped.
    ThrustReference = 18,
    /// The thrust reference changes as fast as it may.
    ThrustReferenceRate = 19,
    /// The shaft speed, asked or measured, is at the law's cap.
    ShaftSpeed = 20,
    /// The law's voltage is at the supply.
    Voltage = 21,
    /// Anti-spin has taken the speed over.
    AntiSpin = 22,
    /// The trim on the force sensor is at its authority.
    Trim = 23,
    /// The setpoint is still on its way: it moves no faster than its rise time says.
    SetpointRise = 30,
    /// The controller ramps to zero because the lease ended.
    LeaseRamp = 31,
}

/// Bit of the first limit of the controller's laws.
pub const FIRST_OF_CONTROL: u32 = Limit::Current as u32;

type Row = (Limit, &'static str, &'static str, &'static str);

const TABLE: [Row; 15] = [
    (Limit::DriveRange, "drive_range", "the servo clips the drive at its range", "limits.current_a"),
    (Limit::DriveSlew, "drive_slew", "the servo slows the change of the drive", "limits.full_drive_s"),
    (
        Limit::DriveSpeed,
        "drive_speed",
        "the servo takes drive away near the largest shaft speed",
        "limits.speed_rad_s",
    ),
    (
        Limit::Thermal,
        "thermal",
        "the I2t budget is used up, the servo folds back to the continuous current",
        "limits.continuous_current_a, limits.thermal_time_constant_s",
    ),
    (
        Limit::Supply,
        "supply",
        "the drive saturates: the supply cannot push more against the back-EMF",
        "amplifier.supply_v of the rig",
    ),
    (
        Limit::Current,
        "current",
        "the control law's current is clipped",
        "amplifier.current_limit_a of the rig",
    ),
    (
        Limit::CurrentRate,
        "current_rate",
        "the control law's current changes as fast as it may",
        "current_rate_per_s of the controller",
    ),
    (
        Limit::ThrustReference,
        "thrust_reference",
        "the thrust asked for is beyond what the thruster can give",
        "amplifier.current_limit_a of the rig",
    ),
    (
        Limit::ThrustReferenceRate,
        "thrust_reference_rate",
        "the thrust asked for changes as fast as it may",
        "thrust_rate_per_s of the controller",
    ),
    (
        Limit::ShaftSpeed,
        "shaft_speed",
        "the shaft speed, asked or measured, is at its cap",
        "overspeed of the controller",
    ),
    (
        Limit::Voltage,
        "voltage",
        "the control law's voltage is at the supply",
        "amplifier.supply_v of the rig",
    ),
    (
        Limit::AntiSpin,
        "anti_spin",
        "anti-spin has taken the speed over",
        "anti_spin_cap_share of the controller",
    ),
    (
        Limit::Trim,
        "trim",
        "the trim on the force sensor is at its authority",
        "trim_authority of the controller",
    ),
    (
        Limit::SetpointRise,
        "setpoint_rise",
        "the setpoint is on its way: it moves no faster than its rise time says",
        "controller.setpoint_rise_s",
    ),
    (Limit::LeaseRamp, "lease_ramp", "the lease ended, the controller ramps to zero", "ttl_ms of the lease"),
];

impl Limit {
    /// Its bit.
    pub const fn bit(self) -> u64 {
        1 << self as u32
    }

    /// Every limit.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.0)
    }

    fn row(self) -> &'static Row {
        TABLE.iter().find(|row| row.0 == self).unwrap_or(&TABLE[0])
    }

    /// Name in the JSON state and as a metric's label.
    pub fn name(self) -> &'static str {
        self.row().1
    }

    /// What it does.
    pub fn meaning(self) -> &'static str {
        self.row().2
    }

    /// The setting that holds it.
    pub fn setting(self) -> &'static str {
        self.row().3
    }

    /// The limits in a bitset, in order.
    pub fn in_set(set: u64) -> impl Iterator<Item = Self> {
        Self::all().filter(move |limit| set & limit.bit() != 0)
    }
}
