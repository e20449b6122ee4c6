//! Physics a model may leave out: one effect, one file, registered in one list.
//!
//! The same code serves the simulated truth and the fit, on plain numbers and on numbers that carry
//! their derivatives ([`Real`](crate::real::Real)): an effect reads its parameters and acts at hooks of
//! the [plant](crate::plant). Each file says what the effect is, its equation, what
//! the residual looks like, what it is confused with, and what separates it; `kort explain`
//! prints just that.

use crate::blade::Inflow;
use crate::dual::Dual;
use crate::models::ModelName;
use crate::parameters::Parameters;
use crate::plant::{Balance, Drive, Foil, Local, Sensed, Tick};
use crate::rig::{AmplifierKind, Rig};

/// Where an effect enters.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Path {
    /// Between command and motor current or torque.
    Drive,
    /// The shaft's torque balance.
    Shaft,
    /// Lift and drag of the blades.
    Blade,
    /// The axial-flow balance, or the water coming in.
    Flow,
    /// Only what is measured, never the motion.
    Sensor,
}

impl Path {
    /// Name as in the report.
    pub const fn name(self) -> &'static str {
        match self {
            Path::Drive => "drive",
            Path::Shaft => "shaft",
            Path::Blade => "blade",
            Path::Flow => "flow",
            Path::Sensor => "sensor",
        }
    }
}

/// Sizes of a rig in use, from which an effect takes the scale of its parameters.
#[derive(Clone, Copy, Debug)]
pub struct Scale {
    /// Largest shaft speed seen, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Largest motor torque, N m.
    pub torque_n_m: f64,
    /// Largest thrust, N.
    pub thrust_n: f64,
    /// Largest axial flow, m/s.
    pub flow_m_s: f64,
    /// Largest current, A.
    pub current_a: f64,
    /// Largest command, in the unit of the command.
    pub command: f64,
    /// Nominal supply, V (zero if not stated).
    pub supply_v: f64,
    /// Stated winding resistance, ohm (zero if not stated).
    pub winding_resistance_ohm: f64,
    /// Stated inertia, kg m^2.
    pub inertia_kg_m2: f64,
    /// Control period, s.
    pub tick_s: f64,
    /// Length of the recording, s.
    pub duration_s: f64,
}

/// One parameter of an effect.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spec {
    /// Name, unit last.
    pub name: &'static str,
    /// Unit for reports.
    pub unit: &'static str,
    /// Where a fit starts: a value at which the effect is small but visible.
    pub start: f64,
    /// Smallest allowed value.
    pub low: f64,
    /// Largest allowed value.
    pub high: f64,
    /// A shape parameter does nothing alone; the effect vanishes when all its strength
    /// parameters are zero.
    pub shape: bool,
    /// Not to be fitted: a whole number or a grid. The starts try its values, a fit holds them.
    pub held: bool,
    /// For a strength that acts only for a while: when.
    pub acts: Option<Stretch>,
}

/// A stretch of time that comes again after a period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// Its beginning, s.
    pub from_s: f64,
    /// Its length, s.
    pub length_s: f64,
    /// Time to its next beginning, s.
    pub period_s: f64,
}

impl Spec {
    /// A strength: the effect vanishes at zero.
    pub const fn strength(name: &'static str, unit: &'static str, start: f64, low: f64, high: f64) -> Self {
        Self { name, unit, start, low, high, shape: false, held: false, acts: None }
    }

    /// A shape: where, how fast, how sharp.
    pub const fn shape(name: &'static str, unit: &'static str, start: f64, low: f64, high: f64) -> Self {
        Self { name, unit, start, low, high, shape: true, held: false, acts: None }
    }

    /// A shape that a fit holds at its start.
    pub const fn held(name: &'static str, unit: &'static str, start: f64, low: f64, high: f64) -> Self {
        Self { name, unit, start, low, high, shape: true, held: true, acts: None }
    }
}

/// What an effect does at the hooks of the plant. All default to nothing.
///
/// `own` holds the effect's continuous states (as many as [`Effect::states`] says), integrated
/// with the plant; their rates go to `rates` in [`Effect::balance`].
pub trait Effect<T = f64>: Send {
    /// Number of continuous states.
    fn states(&self) -> usize {
        0
    }
    /// Whether its states are slow beside a tick, so that the rates of two ticks foretell the next.
    fn slow(&self) -> bool {
        self.states() == 0
    }
    /// Once, before the run: other equations or other values of their parameters.
    fn amend(&self, _model: &mut ModelName, _parameters: &mut Parameters<T>) {}
    /// Which hooks are used; the others are never called.
    fn hooks(&self) -> Hooks;
    /// Once a control tick, before the drive acts: command, limits, lag, supply.
    fn drive(&mut self, _tick: &Tick, _drive: &mut Drive<T>) {}
    /// The water that meets the blade.
    fn inflow(&self, _at: &Local<T>, _own: &[T], _inflow: &mut Inflow<T>) {}
    /// Lift and drag coefficients, density.
    fn foil(&self, _at: &Local<T>, _own: &[T], _foil: &mut Foil<T>) {}
    /// Torques on the shaft and forces on the water.
    fn balance(&self, _at: &Local<T>, _own: &[T], _balance: &mut Balance<T>, _rates: &mut [T]) {}
    /// Once a control tick, after the step: what the sensors see.
    fn sense(&mut self, _tick: &Tick, _sensed: &mut Sensed<T>) {}
}

/// Hooks an effect uses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Hooks {
    /// [`Effect::drive`]
    pub drive: bool,
    /// [`Effect::inflow`]
    pub inflow: bool,
    /// [`Effect::foil`]
    pub foil: bool,
    /// [`Effect::balance`]
    pub balance: bool,
    /// [`Effect::sense`]
    pub sense: bool,
}

impl Hooks {
    /// No hook.
    pub const NONE: Self = Self { drive: false, inflow: false, foil: false, balance: false, sense: false };
    /// Drive only.
    pub const DRIVE: Self = Self { drive: true, ..Self::NONE };
    /// Inflow only.
    pub const INFLOW: Self = Self { inflow: true, ..Self::NONE };
    /// Foil only.
    pub const FOIL: Self = Self { foil: true, ..Self::NONE };
    /// Balance only.
    pub const BALANCE: Self = Self { balance: true, ..Self::NONE };
    /// Sense only.
    pub const SENSE: Self = Self { sense: true, ..Self::NONE };
}

/// Which signals a recording (or a run) offers to an effect as drivers and to a fit as responses.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Available {
    /// Columns with data, by their contract names.
    pub columns: Vec<String>,
    /// The shaft speed is prescribed (a recorded speed drives the model).
    pub shaft_prescribed: bool,
    /// The current is prescribed (a recorded current drives the model).
    pub current_prescribed: bool,
    /// The baseline model has the axial flow as a state.
    pub axial_flow_modelled: bool,
    /// Share of the supply lost at the largest load, where every recording holds the supply.
    pub supply_sag_share: Option<f64>,
}

impl Available {
    /// Is this column there?
    pub fn has(&self, name: &str) -> bool {
        self.columns.iter().any(|c| c == name)
    }
}

/// One entry of the catalogue.
pub struct Descriptor {
    /// Identifier as in the report.
    pub id: &'static str,
    /// Where it enters.
    pub path: Path,
    /// One line: what it is, in an engineer's words.
    pub what: &'static str,
    /// The equation, with symbols and units.
    pub equation: &'static str,
    /// When it shows and what the residual looks like.
    pub signature: &'static str,
    /// Effects it is confused with, by identifier.
    pub confused_with: &'static [&'static str],
    /// The excitation or instrument that separates it.
    pub separated_by: &'static str,
    /// Where the equation and the ranges come from.
    pub reference: &'static str,
    /// Its parameters at a rig's scale.
    pub parameters: fn(&Scale) -> Vec<Spec>,
    /// Further starting points for a fit, beyond the one in the parameters; may be empty.
    pub starts: fn(&Scale) -> Vec<Vec<f64>>,
    /// Why it cannot be fitted from this recording, if so.
    pub needs: fn(&Rig, &Available) -> Result<(), &'static str>,
    /// Builds the effect with values for its parameters.
    pub build: Build,
}

/// Builds an effect on plain numbers, and on numbers with derivatives. [`both`](crate::both) makes it.
pub struct Build {
    /// For a simulation.
    pub plain: Builder<f64>,
    /// For a simulation with derivatives.
    pub dual: Builder<Dual>,
}

type Builder<T> = fn(&[T], &Context<T>) -> Box<dyn Effect<T>>;

/// A [`Build`] from one function of values and context, compiled for both kinds of number.
#[macro_export]
macro_rules! both {
    ($build:expr) => {
        $crate::effects::Build { plain: $build, dual: $build }
    };
}

/// What an effect may know of the plant when it is built.
#[derive(Clone, Copy, Debug)]
pub struct Context<'a, T = f64> {
    /// The plant's parameters.
    pub parameters: &'a Parameters<T>,
    /// The stated rig.
    pub rig: &'a Rig,
    /// Control period, s.
    pub tick_s: f64,
}

/// Name under which [`Available`] lists a recorded signal laid into [`Tick::extra`].
pub const EXTRA: &str = "extra";

/// No further starting points.
pub fn one_start(_: &Scale) -> Vec<Vec<f64>> {
    Vec::new()
}

/// Can always be fitted.
pub fn always(_: &Rig, _: &Available) -> Result<(), &'static str> {
    Ok(())
}

/// Needs a propeller in water.
pub fn wet(rig: &Rig, _: &Available) -> Result<(), &'static str> {
    if rig.propeller.is_some() { Ok(()) } else { Err("a dry shaft has no blades and no water") }
}

/// Needs the shaft's torque balance: the shaft must be driven by current, voltage or torque.
pub fn free_shaft(rig: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.shaft_prescribed {
        Err("the recorded shaft speed drives the model, so the shaft's torque balance is not seen")
    } else if rig.amplifier.kind == AmplifierKind::Speed && !available.current_prescribed {
        Err(
            "a speed drive holds the shaft and its current is not recorded, so the torque balance is not seen",
        )
    } else {
        Ok(())
    }
}

/// Needs a command: a recorded current or speed that drives the model has the drive behind it.
pub fn commanded(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.current_prescribed || available.shaft_prescribed {
        Err(
            "a recorded response drives the model, so what lies between command and that response is not seen",
        )
    } else {
        Ok(())
    }
}

/// Needs a measured thrust.
pub fn thrust_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has("thrust_n") { Ok(()) } else { Err("thrust is not recorded") }
}

/// Needs a measured axial flow.
pub fn flow_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has("flow_m_s") { Ok(()) } else { Err("axial flow is not recorded") }
}

/// Needs a measured shaft speed as a response.
pub fn speed_measured(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.shaft_prescribed {
        Err("the recorded shaft speed drives the model and is no response")
    } else if !available.has("shaft_speed_rad_s") {
        Err("shaft speed is not recorded")
    } else {
        Ok(())
    }
}

/// Needs the recorded shaft angle: an integrated model speed loses the phase within seconds.
pub fn angle_recorded(_: &Rig, available: &Available) -> Result<(), &'static str> {
    if available.has("shaft_angle_rad") {
        Ok(())
    } else {
        Err("the shaft angle is not recorded, so what follows the angle cannot be kept in phase")
    }
}

mod knots;
mod memory;

macro_rules! catalogue {
    ($($name:ident),* $(,)?) => {
        $(pub mod $name;)*
        /// Every effect: shaft, drive, flow, blade, sensor.
        pub const ALL: &[&Descriptor] = &[$(&$name::DESCRIPTOR),*];
    };
}

catalogue! {
    // shaft friction and load
    coulomb_friction,
    viscous_friction,
    windage_drag,
    rotor_inertia_error,
    entrained_water_inertia,
    // drive and motor
    amplifier_lag,
    transport_delay,
    current_saturation,
    torque_constant_saturation,
    thermal_drift_kt,
    voltage_limit_backemf,
    supply_sag,
    torque_ripple_cogging,
    command_dead_band,
    gear_backlash,
    // axial flow
    axial_flow_dynamics,
    ambient_axial_flow,
    ambient_flow_unsteady,
    tank_recirculation,
    duct_loss,
    thrust_deduction_interaction,
    cross_flow,
    inertia_added_mass_error,
    // blades
    rotational_flow,
    nonsinusoidal_lift_drag,
    blade_stall,
    forward_reverse_asymmetry,
    unsteady_lift_lag,
    ventilation,
    air_ingestion,
    cavitation,
    water_density,
    // sensors and structure
    thrust_bias_gain_hysteresis,
    thrust_sensor_lag,
    stand_resonance,
    flowmeter_offset_lag_location,
    encoder_filter_lag,
    encoder_eccentricity,
    torque_channel_bias,
    clock_skew,
}

/// The effect with this identifier.
pub fn find(id: &str) -> Option<&'static Descriptor> {
    ALL.iter().copied().find(|d| d.id == id)
}
