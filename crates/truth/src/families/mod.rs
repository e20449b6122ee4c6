//! The effects that a case may hide, a family of forms each. To add one: a file with its `FAMILY`,
//! and a line in [`ALL`].

use crate::dice::Dice;
use crate::machine::{Build, DriveKind, Machine, Scale};
use crate::physics::{Path, Physics};
use crate::statement::Quantity;

macro_rules! families {
    ($($name:ident),* $(,)?) => {
        $(mod $name;)*
        /// Every family.
        pub const ALL: &[&Family] = &[$(&$name::FAMILY),*];
    };
}

families!(
    air_ingestion,
    ambient_axial_flow,
    ambient_flow_unsteady,
    amplifier_lag,
    blade_stall,
    cavitation,
    clock_skew,
    command_curve,
    command_dead_band,
    coulomb_friction,
    cross_flow,
    current_saturation,
    direction_dependent_friction,
    drive_freewheels,
    duct_loss,
    encoder_eccentricity,
    encoder_filter_lag,
    entrained_water_inertia,
    flexible_coupling,
    flowmeter_offset_lag_location,
    forward_reverse_asymmetry,
    friction_warm_up,
    gear_backlash,
    gear_load_friction,
    inertia_added_mass_error,
    nonsinusoidal_lift_drag,
    position_dependent_friction,
    rotational_flow,
    rotor_inertia_error,
    stand_resonance,
    supply_sag,
    tank_recirculation,
    thermal_drift_kt,
    thrust_bias_gain_hysteresis,
    thrust_deduction_interaction,
    thrust_sensor_lag,
    torque_channel_bias,
    torque_constant_saturation,
    torque_ripple_cogging,
    transport_delay,
    unsigned_speed_sensor,
    unsteady_lift_lag,
    ventilation,
    viscous_friction,
    voltage_limit_backemf,
    water_density,
    windage_drag,
);

/// An effect of the catalogue, and the forms in which a case may hide it.
pub struct Family {
    /// Catalogue id.
    pub id: &'static str,
    /// Where it acts.
    pub path: Path,
    /// Its forms; [`Self::draw`] takes the place in this list.
    pub forms: &'static [&'static str],
    /// Other ids that name the same physics.
    pub same_physics: &'static [&'static str],
    /// Sets of ids that together do the same.
    pub same_sets: &'static [&'static [&'static str]],
    /// What the rig must state closely, or a re-fit within tolerances explains it away.
    pub anchors: &'static [Quantity],
    /// A strength makes it small; otherwise it is there or not.
    pub sized: bool,
    /// Whether a machine may have it.
    pub fits: fn(&Machine) -> bool,
    /// Draws the shape of a form.
    pub draw: fn(usize, &Machine, &Scale, &mut Dice) -> Box<dyn Physics>,
}

impl Family {
    /// Defaults of a family of this id; path, forms, machines and draw are to be given.
    const fn new(id: &'static str) -> Self {
        Family {
            id,
            path: Path::Shaft,
            forms: &[],
            same_physics: &[],
            same_sets: &[],
            anchors: &[],
            sized: true,
            fits: any,
            draw: |_, _, _, _| Box::new(Nothing),
        }
    }
}

/// The family of an id.
pub fn find(id: &str) -> Option<&'static Family> {
    ALL.iter().copied().find(|family| family.id == id)
}

struct Nothing;

impl Physics for Nothing {
    fn set(&mut self, _: f64) {}
}

const fn any(_: &Machine) -> bool {
    true
}

fn wet(machine: &Machine) -> bool {
    machine.wet()
}

fn geared(machine: &Machine) -> bool {
    machine.build == Build::Geared
}

fn belt(machine: &Machine) -> bool {
    matches!(machine.build, Build::Belt | Build::Direct) && machine.inertia_kg_m2 > 1e-4
}

fn current_driven(machine: &Machine) -> bool {
    machine.drive == DriveKind::Current
}

fn voltage_driven(machine: &Machine) -> bool {
    machine.drive == DriveKind::Voltage
}

fn encoder(machine: &Machine) -> bool {
    machine.sensors.tachometer_noise == 0.0 && turns_round(machine)
}

/// What comes again with every turn is known by turns.
fn turns_round(machine: &Machine) -> bool {
    !machine.load.swings()
}

/// A bus that sags is seen where the voltage drives, or in water where the current needs most of it.
fn sags(machine: &Machine) -> bool {
    machine.drive == DriveKind::Voltage || machine.wet()
}
