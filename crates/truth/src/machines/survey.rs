//! A thruster of a survey vehicle: 0.15 m duct, 20 A at 48 V, a current amplifier.

use super::{ducted, stand_sensors};
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    Machine {
        class: "ducted survey-class",
        build: Build::Propeller,
        blades: Some(ducted(0.075, 0.08, (0.62, 0.88), (0.75, 1.0), dice)),
        load: Load::None,
        inertia_kg_m2: dice.between(7e-4, 9.5e-4),
        viscous_nm_s: 0.0,
        torque_constant_nm_a: dice.between(0.17, 0.21),
        winding_resistance_ohm: 0.45,
        drive: DriveKind::Current,
        drive_lag_s: 0.002,
        current_limit_a: 20.0,
        supply_v: 48.0,
        cogging_orders: &[7.0, 14.0, 42.0],
        sensors: stand_sensors(400.0),
    }
}
