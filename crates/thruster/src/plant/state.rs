//! What the plant shows to its effects, and what they may change.

use crate::blade::Foil;
use crate::real::Real;

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
    /// Recorded torque that a load takes from a dry shaft at start and end, N m; positive brakes a shaft that turns ahead.
    pub load_n_m: (f64, f64),
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
    /// What [`Self::extra`] is where that signal is zero: a neighbour at rest.
    pub extra_at_zero: f64,
    /// The drive is released: its terminals are open, no current flows, whatever the command.
    pub released: bool,
    /// Recorded shaft angle at the tick's end, rad, for the observer ([`super::Plant::with_observer`]).
    pub observed_angle_rad: Option<f64>,
    /// Recorded shaft speed at the tick's end, rad/s, for the observer; used where no angle is.
    pub observed_speed_rad_s: Option<f64>,
    /// The same of a sensor that does not know the direction, rad/s, never negative; used where neither is.
    pub observed_size_rad_s: Option<f64>,
    /// What is known beforehand of the tick's course.
    pub course: Course,
}

/// What is known of a tick's course: beforehand, and not found on the way, so that a response stays smooth
/// in the parameters. `Any` is always right and costs time only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Course {
    /// Nothing.
    #[default]
    Any,
    /// Nothing jumps or moves fast about it: the rates at its ends and a tick before tell it.
    Smooth,
    /// Smooth, and what is disturbed takes many ticks to die out: the rates at a look ahead are the end's.
    Calm,
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
    /// Measured electrical power into the motor, W; negative where it drives astern.
    Power(f64, f64),
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

    pub(super) fn load_at(&self, part: f64) -> f64 {
        self.load_n_m.0 + (self.load_n_m.1 - self.load_n_m.0) * part
    }

    pub(super) fn angle_at(&self, part: f64) -> Option<f64> {
        self.shaft_angle_rad.map(|(a, b)| a + (b - a) * part)
    }
}

/// The drive during one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drive<T = f64> {
    /// Command as it reaches the amplifier.
    pub command: T,
    /// Largest current, A.
    pub current_limit_a: T,
    /// First-order lag, s.
    pub time_constant_s: T,
    /// Supply at the amplifier, V.
    pub supply_v: T,
    /// Winding resistance, ohm.
    pub resistance_ohm: T,
    /// Back-EMF at the start of the tick, V.
    pub back_emf_v: T,
    /// Share of a braking current that a voltage drive does not let flow.
    pub freewheels: T,
    /// Shaft speed at the start of the tick, rad/s.
    pub shaft_speed_rad_s: T,
    /// Motor current at the start of the tick, A.
    pub current_a: T,
    /// Whether the supply limits the current against the back-EMF.
    pub voltage_limited: bool,
}

/// State of the plant at one instant inside a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local<T = f64> {
    /// Time, s.
    pub time_s: f64,
    /// Shaft speed, rad/s.
    pub shaft_speed_rad_s: T,
    /// Shaft angle, rad (the recorded one where there is one).
    pub shaft_angle_rad: T,
    /// Axial flow at the propeller, m/s.
    pub axial_m_s: T,
    /// Swirl of the rotational-flow model, m/s.
    pub swirl_m_s: T,
    /// Motor current, A.
    pub current_a: T,
    /// Ambient axial flow, m/s.
    pub ambient_m_s: f64,
    /// Measured torque that a load takes from a dry shaft, N m.
    pub load_n_m: f64,
    /// Depth, m, if known.
    pub depth_m: Option<f64>,
    /// Temperature, deg C, if known.
    pub temperature_c: Option<f64>,
    /// Thrust on the water (only in [`super::Plant::truth`]), N.
    pub thrust_n: T,
    /// Blade torque (only in [`super::Plant::truth`]), N m.
    pub blade_torque_n_m: T,
}

/// Below this a state of the plant, whatever its unit, is one that has died away.
const DIED_AWAY: f64 = 1e-30;

/// A state, or zero once it has died away: what decays would else go on halving until it is the smallest number there is, which is
/// no speed and no current, and which processors are slow with.
#[inline(always)]
pub(super) fn died_away<T: Real>(state: T) -> T {
    if state.re().abs() < DIED_AWAY { state.with(0.0) } else { state }
}

impl<T: Real> Local<T> {
    /// With zero for what has died away.
    #[inline(always)]
    pub(super) fn settled(mut self) -> Self {
        for state in
            [&mut self.shaft_speed_rad_s, &mut self.axial_m_s, &mut self.swirl_m_s, &mut self.current_a]
        {
            *state = died_away(*state);
        }
        self
    }

    /// Whether nothing that acts on the rates jumps from `before` to here; the end of one tick and
    /// the start of the next may differ in rounding. Without effects (`HOOKED` false) depth
    /// and temperature do not act.
    #[inline(always)]
    pub(super) fn continues<const HOOKED: bool>(&self, before: &Self) -> bool {
        let near =
            |a: T, b: T| (a.re() - b.re()).abs() <= 1e-12 * (a.re().abs() + b.re().abs()) && a.same_slopes(b);
        near(self.current_a, before.current_a)
            && near(T::from(self.ambient_m_s), T::from(before.ambient_m_s))
            && near(T::from(self.load_n_m), T::from(before.load_n_m))
            && near(self.shaft_speed_rad_s, before.shaft_speed_rad_s)
            && (!HOOKED
                || near(self.shaft_angle_rad, before.shaft_angle_rad)
                    && self.depth_m == before.depth_m
                    && self.temperature_c == before.temperature_c)
    }
}

/// Torques on the shaft and forces on the water at one instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Balance<T = f64> {
    /// Motor torque, N m.
    pub motor_torque_n_m: T,
    /// Other torque on the shaft, N m; positive accelerates ahead.
    pub shaft_torque_n_m: T,
    /// Torque of what else hangs on the shaft (the rig's load), N m; positive accelerates ahead.
    pub load_torque_n_m: T,
    /// Size of the dry friction against turning ahead, N m, zero or above: it slows and holds the shaft,
    /// and never drives it. See [`Balance::rub`].
    pub friction_ahead_n_m: T,
    /// The same against turning astern, N m.
    pub friction_astern_n_m: T,
    /// Blade torque, N m; positive opposes positive speed.
    pub blade_torque_n_m: T,
    /// Inertia of the shaft, kg m^2.
    pub inertia_kg_m2: T,
    /// Thrust of the blades, N.
    pub thrust_n: T,
    /// Other force on the axial flow, N.
    pub momentum_n: T,
    /// Accelerated mass `m = rho a l gamma`, kg.
    pub added_mass_kg: T,
    /// `dbeta rho a`, kg/m.
    pub flux_kg_m: T,
    /// Ambient axial flow, m/s.
    pub ambient_m_s: T,
    /// Force on the stand beyond the blades' thrust, N: seen by the force sensor, not by the water.
    pub stand_n: T,
    /// The blade section these loads come from; all zero where the model has none, nothing moves, or no
    /// effect has a hook at the blade ([`crate::effects::Hooks::inflow`] or `foil`).
    pub foil: Foil<T>,
}

impl<T: Real> Balance<T> {
    /// Adds dry friction: its size against turning ahead and against turning astern, N m. The plant lets it
    /// shrink the shaft's speed after the step that all else makes, so that it sticks exactly.
    #[inline(always)]
    pub fn rub(&mut self, ahead_n_m: T, astern_n_m: T) {
        self.friction_ahead_n_m += ahead_n_m.max(T::ZERO);
        self.friction_astern_n_m += astern_n_m.max(T::ZERO);
    }
}

/// What the sensors show, without noise; names are the recording's columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sensed<T = f64> {
    /// Motor current, A.
    pub current_a: T,
    /// Shaft angle, rad.
    pub shaft_angle_rad: T,
    /// How far an observer had pulled that angle, rad: no motion of the shaft.
    pub pulled_rad: T,
    /// Shaft speed after differencing and filter, rad/s.
    pub shaft_speed_rad_s: T,
    /// Thrust after the sensor's filter, N.
    pub thrust_n: T,
    /// Propeller-side torque after its filter, N m.
    pub torque_n_m: T,
    /// Axial flow, m/s.
    pub flow_m_s: T,
    /// Shaft speed itself, rad/s, for effects on the sensors.
    pub true_speed_rad_s: T,
    /// Thrust before the sensor, N, for effects on the sensors.
    pub true_thrust_n: T,
    /// Supply, V.
    pub supply_v: T,
    /// Where the shown speed is a bare difference of the encoder's angle over a control period, so the speed's mean over it:
    /// how fast the speed itself left that mean since the middle of the period, rad/s^2.
    pub since_mean_rad_s2: Option<T>,
}

impl<T: Real> Sensed<T> {
    /// What the sensors show between this instant and a later one, `part` of the way.
    pub fn between(&self, later: &Self, part: f64) -> Self {
        let mix = |a: T, b: T| a + (b - a) * part;
        Self {
            current_a: mix(self.current_a, later.current_a),
            shaft_angle_rad: mix(self.shaft_angle_rad, later.shaft_angle_rad),
            pulled_rad: mix(self.pulled_rad, later.pulled_rad),
            shaft_speed_rad_s: mix(self.shaft_speed_rad_s, later.shaft_speed_rad_s),
            thrust_n: mix(self.thrust_n, later.thrust_n),
            torque_n_m: mix(self.torque_n_m, later.torque_n_m),
            flow_m_s: mix(self.flow_m_s, later.flow_m_s),
            true_speed_rad_s: mix(self.true_speed_rad_s, later.true_speed_rad_s),
            true_thrust_n: mix(self.true_thrust_n, later.true_thrust_n),
            supply_v: mix(self.supply_v, later.supply_v),
            since_mean_rad_s2: self.since_mean_rad_s2.zip(later.since_mean_rad_s2).map(|(a, b)| mix(a, b)),
        }
    }
}

/// All zero: at rest.
macro_rules! at_rest {
    ($($name:ident { $($field:ident)* $(, $($other:ident)*)? })*) => {
        $(impl<T: Real> Default for $name<T> {
            #[inline(always)]
            fn default() -> Self {
                Self { $($field: T::ZERO,)* $($($other: Default::default()),*)? }
            }
        })*
    };
}

at_rest! {
    Local {
        shaft_speed_rad_s shaft_angle_rad axial_m_s swirl_m_s current_a thrust_n blade_torque_n_m,
        time_s ambient_m_s load_n_m depth_m temperature_c
    }
    Foil { speed_m_s normal_m_s chordwise_m_s sin_2a one_minus_cos_2a lift drag density_kg_m3 }
    Balance {
        motor_torque_n_m shaft_torque_n_m load_torque_n_m friction_ahead_n_m friction_astern_n_m blade_torque_n_m inertia_kg_m2 thrust_n momentum_n added_mass_kg
        flux_kg_m ambient_m_s stand_n,
        foil
    }
    Sensed {
        current_a shaft_angle_rad pulled_rad shaft_speed_rad_s thrust_n torque_n_m flow_m_s true_speed_rad_s true_thrust_n
        supply_v,
        since_mean_rad_s2
    }
}

/// An array of what a function gives for each place. The standard library's `array::from_fn` is left as
/// calls where numbers carry derivatives.
#[inline(always)]
pub(super) fn each<T: Real, const N: usize>(of: impl Fn(usize) -> T) -> [T; N] {
    let mut all = [T::ZERO; N];
    for (i, one) in all.iter_mut().enumerate() {
        *one = of(i);
    }
    all
}
