//! A thruster of about 10 N: 50 mm duct, a voltage drive at 12 V, logged at 50 Hz.

use super::{ducted, stand_sensors};
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine, Sensors};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    Machine {
        class: "micro ducted",
        build: Build::Propeller,
        blades: Some(ducted(0.025, 0.03, (0.6, 0.9), (0.8, 1.1), dice)),
        load: Load::None,
        inertia_kg_m2: dice.between(6e-6, 1.1e-5),
        viscous_nm_s: 0.0,
        torque_constant_nm_a: dice.between(0.0085, 0.0115),
        winding_resistance_ohm: dice.between(0.3, 0.5),
        drive: DriveKind::Voltage,
        drive_lag_s: 0.0006,
        current_limit_a: 20.0,
        supply_v: 12.0,
        cogging_orders: &[6.0, 12.0, 14.0],
        sensors: Sensors { ticks_per_row: 10, encoder_counts: 1024.0, ..stand_sensors(50.0) },
    }
}
