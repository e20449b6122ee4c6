//! Limits in force: no faults, they say what holds the thruster back now and which setting does.

/// A limit and the setting that holds it. The discriminant is the bit in a bitset.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum Limit {
    /// The servo clips the drive at the continuous or peak limit.
    Current = 0,
    /// The servo slows the change of the drive.
    Slew = 1,
    /// The servo takes drive away near the largest shaft speed.
    Speed = 2,
    /// The servo folds back to the continuous current: the thermal budget is used up.
    Thermal = 3,
    /// The drive itself saturates (supply against back-EMF).
    Supply = 4,
    /// The controller clips the setpoint or its output.
    Magnitude = 16,
    /// The controller slows the change of its output.
    Rate = 17,
    /// The controller ramps to zero because the lease ended.
    LeaseRamp = 18,
}

impl Limit {
    /// Every limit.
    pub const ALL: [Self; 8] = [
        Self::Current,
        Self::Slew,
        Self::Speed,
        Self::Thermal,
        Self::Supply,
        Self::Magnitude,
        Self::Rate,
        Self::LeaseRamp,
    ];

    /// Its bit.
    pub const fn bit(self) -> u64 {
        1 << self as u32
    }

    /// Name in the JSON state and as a metric's label.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Current => "current",
            Self::Slew => "slew",
            Self::Speed => "speed",
            Self::Thermal => "thermal",
            Self::Supply => "supply",
            Self::Magnitude => "magnitude",
            Self::Rate => "rate",
            Self::LeaseRamp => "lease_ramp",
        }
    }

    /// What it does.
    pub const fn meaning(self) -> &'static str {
        match self {
            Self::Current => "the servo clips the drive",
            Self::Slew => "the servo slows the change of the drive",
            Self::Speed => "the servo takes drive away near the largest shaft speed",
            Self::Thermal => "the I2t budget is used up: the servo folds back to the continuous current",
            Self::Supply => "the drive saturates: the supply cannot push more against the back-EMF",
            Self::Magnitude => "the controller clips the setpoint or its output",
            Self::Rate => "the controller slows the change of its output",
            Self::LeaseRamp => "the lease ended: the controller ramps to zero",
        }
    }

    /// Setting of `kort.toml` that holds it, or words.
    pub const fn setting(self) -> &'static str {
        match self {
            Self::Current => "limits.current_a",
            Self::Slew => "limits.slew_a_s",
            Self::Speed => "limits.speed_rad_s",
            Self::Thermal => "limits.continuous_current_a, limits.thermal_time_constant_s",
            Self::Supply => "amplifier.supply_v of the rig",
            Self::Magnitude => "limits.thrust_n, limits.speed_rad_s, limits.current_a",
            Self::Rate => "limits.thrust_rate_n_s and the control law's file",
            Self::LeaseRamp => "ttl_ms of the lease",
        }
    }

    /// The limits in a bitset, in order.
    pub fn in_set(set: u64) -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(move |limit| set & limit.bit() != 0)
    }
}
