//! What the plant shows to its effects, and what they may change.

/// Inputs of one control tick. Quantities that vary within the tick run straight from the first
/// to the second number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Tick {
    /// Start of the tick, s.
    pub time_s: f64,
    /// Command held over the tick: A, V or rad/s after the amplifier's kind.
    pub command: f64,
    /// A recorded signal that takes the command's place.
    pub driven: Driven,
    /// Ambient axial flow at start and end, m/s; positive when it feeds the propeller ahead.
    pub ambient_m_s: (f64, f64),
    /// Recorded supply, V.
    pub supply_v: Option<f64>,
    /// Recorded shaft angle at start and end, rad: keeps effects that follow the angle in phase.
    pub shaft_angle_rad: Option<(f64, f64)>,
    /// Depth, m.
    pub depth_m: Option<f64>,
    /// Temperature, deg C.
    pub temperature_c: Option<f64>,
    /// Another recorded signal (a neighbour's speed, an unknown column), standardised.
    pub extra: f64,
    /// Nothing jumps or moves fast about this tick: the rates at its ends and those a tick before tell its
    /// course. Known beforehand, and not found on the way, so that a response stays smooth in the
    /// parameters. False costs time only.
    pub smooth: bool,
}

/// A recorded signal that drives the model instead of the command, at start and end of the tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Driven {
    /// The command drives.
    #[default]
    Command,
    /// Measured motor current, A.
    Current(f64, f64),
    /// Measured shaft speed, rad/s.
    Speed(f64, f64),
}

impl Tick {
    pub(super) fn driven_speed(&self) -> Option<(f64, f64)> {
        match self.driven {
            Driven::Speed(a, b) => Some((a, b)),
            _ => None,
        }
    }

    pub(super) fn ambient_at(&self, part: f64) -> f64 {
        self.ambient_m_s.0 + (self.ambient_m_s.1 - self.ambient_m_s.0) * part
    }

    pub(super) fn angle_at(&self, part: f64) -> Option<f64> {
        self.shaft_angle_rad.map(|(a, b)| a + (b - a) * part)
    }
}

/// The drive during one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive {
    /// Command as it reaches the amplifier.
    pub command: f64,
    /// Largest current, A.
    pub current_limit_a: f64,
    /// First-order lag, s.
    pub time_constant_s: f64,
    /// Supply at the amplifier, V.
    pub supply_v: f64,
    /// Winding resistance, ohm.
    pub resistance_ohm: f64,
    /// Back-EMF at the start of the tick, V.
    pub back_emf_v: f64,
    /// Shaft speed at the start of the tick, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Motor current at the start of the tick, A.
    pub current_a: f64,
    /// Whether the supply limits the current against the back-EMF.
    pub voltage_limited: bool,
}

/// State of the plant at one instant inside a tick.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Local {
    /// Time, s.
    pub time_s: f64,
    /// Shaft speed, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Shaft angle, rad (the recorded one where there is one).
    pub shaft_angle_rad: f64,
    /// Axial flow at the propeller, m/s.
    pub axial_m_s: f64,
    /// Swirl of the rotational-flow model, m/s.
    pub swirl_m_s: f64,
    /// Motor current, A.
    pub current_a: f64,
    /// Ambient axial flow, m/s.
    pub ambient_m_s: f64,
    /// Depth, m, if known.
    pub depth_m: Option<f64>,
    /// Temperature, deg C, if known.
    pub temperature_c: Option<f64>,
    /// Thrust on the water (only in [`super::Plant::truth`]), N.
    pub thrust_n: f64,
    /// Blade torque (only in [`super::Plant::truth`]), N m.
    pub blade_torque_n_m: f64,
}

impl Local {
    /// Whether nothing that acts on the rates jumps from `before` to here; the end of one tick and
    /// the start of the next may differ in rounding. Without effects (`HOOKED` false) depth
    /// and temperature do not act.
    #[inline(always)]
    pub(super) fn continues<const HOOKED: bool>(&self, before: &Self) -> bool {
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * (a.abs() + b.abs());
        near(self.current_a, before.current_a)
            && near(self.ambient_m_s, before.ambient_m_s)
            && near(self.shaft_speed_rad_s, before.shaft_speed_rad_s)
            && (!HOOKED
                || near(self.shaft_angle_rad, before.shaft_angle_rad)
                    && self.depth_m == before.depth_m
                    && self.temperature_c == before.temperature_c)
    }
}

/// The blade section at work.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Foil {
    /// Resultant speed `V`, m/s.
    pub speed_m_s: f64,
    /// Speed normal to the chord, m/s.
    pub normal_m_s: f64,
    /// Speed along the chord, m/s.
    pub chordwise_m_s: f64,
    /// `sin 2 alpha`
    pub sin_2a: f64,
    /// `1 - cos 2 alpha`
    pub one_minus_cos_2a: f64,
    /// Lift coefficient.
    pub lift: f64,
    /// Drag coefficient.
    pub drag: f64,
    /// Density of the water, kg/m^3.
    pub density_kg_m3: f64,
}

impl Foil {
    /// Angle of attack in (-pi/2, pi/2], rad.
    pub fn attack_rad(&self) -> f64 {
        if self.chordwise_m_s < 0.0 {
            (-self.normal_m_s).atan2(-self.chordwise_m_s)
        } else {
            self.normal_m_s.atan2(self.chordwise_m_s)
        }
    }
}

/// Torques on the shaft and forces on the water at one instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Balance {
    /// Motor torque, N m.
    pub motor_torque_n_m: f64,
    /// Other torque on the shaft, N m; positive accelerates ahead.
    pub shaft_torque_n_m: f64,
    /// Blade torque, N m; positive opposes positive speed.
    pub blade_torque_n_m: f64,
    /// Inertia of the shaft, kg m^2.
    pub inertia_kg_m2: f64,
    /// Thrust of the blades, N.
    pub thrust_n: f64,
    /// Other force on the axial flow, N.
    pub momentum_n: f64,
    /// Accelerated mass `m = rho a l gamma`, kg.
    pub added_mass_kg: f64,
    /// `dbeta rho a`, kg/m.
    pub flux_kg_m: f64,
    /// Ambient axial flow, m/s.
    pub ambient_m_s: f64,
    /// Force on the stand beyond the blades' thrust, N: seen by the force sensor, not by the water.
    pub stand_n: f64,
    /// The blade section these loads come from; all zero where the model has none or nothing moves.
    pub foil: Foil,
}

/// What the sensors show, without noise; names are the recording's columns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sensed {
    /// Motor current, A.
    pub current_a: f64,
    /// Shaft angle, rad.
    pub shaft_angle_rad: f64,
    /// Shaft speed after differencing and filter, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Thrust after the sensor's filter, N.
    pub thrust_n: f64,
    /// Propeller-side torque after its filter, N m.
    pub torque_n_m: f64,
    /// Axial flow, m/s.
    pub flow_m_s: f64,
    /// Shaft speed itself, rad/s, for effects on the sensors.
    pub true_speed_rad_s: f64,
    /// Thrust before the sensor, N, for effects on the sensors.
    pub true_thrust_n: f64,
    /// Supply, V.
    pub supply_v: f64,
}

impl Sensed {
    /// What the sensors show between this instant and a later one, `part` of the way.
    pub fn between(&self, later: &Self, part: f64) -> Self {
        let mix = |a: f64, b: f64| a + (b - a) * part;
        Self {
            current_a: mix(self.current_a, later.current_a),
            shaft_angle_rad: mix(self.shaft_angle_rad, later.shaft_angle_rad),
            shaft_speed_rad_s: mix(self.shaft_speed_rad_s, later.shaft_speed_rad_s),
            thrust_n: mix(self.thrust_n, later.thrust_n),
            torque_n_m: mix(self.torque_n_m, later.torque_n_m),
            flow_m_s: mix(self.flow_m_s, later.flow_m_s),
            true_speed_rad_s: mix(self.true_speed_rad_s, later.true_speed_rad_s),
            true_thrust_n: mix(self.true_thrust_n, later.true_thrust_n),
            supply_v: mix(self.supply_v, later.supply_v),
        }
    }
}
