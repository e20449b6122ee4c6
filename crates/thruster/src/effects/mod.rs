//! Physics a model may leave out: one effect, one file, registered in one list.
//!
//! The same code serves the simulated truth and the fit, on plain numbers and on numbers that carry
//! their derivatives ([`Real`](crate::real::Real)): an effect reads its parameters and acts at hooks of
//! the [plant](crate::plant). Each file says what the effect is, its equation, what
//! the residual looks like, what it is confused with, and what separates it; `kort explain`
//! prints just that.

use crate::blade::{Foil, Inflow};
use crate::dual::Dual;
use crate::models::ModelName;
use crate::parameters::Parameters;
use crate::plant::{Balance, Drive, Local, Sensed, Tick};
use crate::rig::Rig;

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

/// What lies between the shaft's motion and what is logged of it, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Sensing {
    /// Which part of the shaft the encoder turns with.
    Mounting,
    /// The encoder's own disc.
    Disc,
    /// Pulses without a direction.
    Counting,
    /// Filters, clocks and scales behind it, and all other instruments.
    Reading,
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
    /// Whether its states are slow beside a tick, so that a look ahead is as good as the end. Others may settle within a
    /// tick, and no faster.
    fn slow(&self) -> bool {
        self.states() == 0
    }
    /// Whether what it does may change within a few ticks where the stated machine is calm: with the angle within a turn,
    /// or since a step of the command comes late.
    fn brisk(&self) -> bool {
        false
    }
    /// Smallest share of the shaft's inertia that its states let move by itself.
    fn lightest_share(&self) -> f64 {
        1.0
    }
    /// Where [`Effect::sense`] stands on the way from the shaft to the log: a sign that is lost there is lost of all that
    /// the encoder turns with, whichever of two effects was named first.
    fn sensing(&self) -> Sensing {
        Sensing::Reading
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
    /// Once a control tick, after the step and before [`Effect::sense`]: the state that was reached.
    fn arrive(&mut self, _at: &Local<T>, _own: &[T]) {}
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
    /// Prior odds of its presence against an average effect: above 1 what most drives have, below what few do.
    pub commonness: f64,
    /// It moves signals in time: a delay, a skewed clock.
    pub shifts_time: bool,
    /// It changes freely with time (knots), and so can stand in for almost anything.
    pub nonparametric: bool,
    /// Sets of effects that do together exactly what this one does, under any excitation, at all of its sizes or where they
    /// are alike: no recording parts them.
    pub same_as: &'static [&'static [&'static str]],
    /// Plainer effects that this one becomes at some of its values: friction that hardly differs by direction is dry friction.
    pub holds: &'static [&'static str],
    /// Which of its parameters make sense without the others, by their places; none listed: all together.
    /// Those left out of a form stay at their prior means. See [`Descriptor::forms`].
    pub forms: &'static [&'static [usize]],
    /// Its parameters at a rig's scale.
    pub parameters: fn(&Scale) -> Vec<Spec>,
    /// Further starting points for a fit, beyond the one in the parameters; may be empty.
    pub starts: fn(&Scale) -> Vec<Vec<f64>>,
    /// Why it cannot be fitted from this recording, if so.
    pub needs: fn(&Rig, &Available) -> Result<(), &'static str>,
    /// Builds the effect with values for its parameters.
    pub build: Build,
}

impl Descriptor {
    /// The sets of parameters that a fit may free, by their places, smallest first where the entry lists
    /// them so; at least one, the whole effect. A shape that a fit holds is in none; a strength that it holds is
    /// free in the forms that list it.
    pub fn forms(&self, specs: &[Spec]) -> Vec<Vec<usize>> {
        if self.forms.is_empty() {
            return vec![(0..specs.len()).filter(|k| !specs[*k].held).collect()];
        }
        let free = |k: &usize| specs.get(*k).is_some_and(|s| !s.held || !s.shape);
        self.forms.iter().map(|form| form.iter().copied().filter(free).collect()).collect()
    }
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

/// No further starting points.
pub fn one_start(_: &Scale) -> Vec<Vec<f64>> {
    Vec::new()
}

pub mod knots;
mod memory;
mod needs;
mod spec;

pub(crate) use memory::FirstOrder;
pub use needs::{
    ANGLE_KNOWN, Available, EXTRA, always, angle_known, commanded, flow_measured, free_shaft, geared,
    speaks_of_a_gear, speed_measured, thrust_measured, turns_round, wet,
};
pub use spec::{OF_THE_COMMAND, Scale, Spec, Stretch};

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
    direction_dependent_friction,
    gear_load_friction,
    position_dependent_friction,
    friction_warm_up,
    viscous_friction,
    windage_drag,
    rotor_inertia_error,
    entrained_water_inertia,
    flexible_coupling,
    // drive and motor
    amplifier_lag,
    transport_delay,
    current_saturation,
    torque_constant_saturation,
    thermal_drift_kt,
    voltage_limit_backemf,
    supply_sag,
    drive_freewheels,
    torque_ripple_cogging,
    command_dead_band,
    command_curve,
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
    unsigned_speed_sensor,
    clock_skew,
    log_gaps,
}

/// The effect with this identifier.
pub fn find(id: &str) -> Option<&'static Descriptor> {
    ALL.iter().copied().find(|d| d.id == id)
}
