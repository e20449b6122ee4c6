//! A tunnel thruster of some 8 kW: 0.4 m, 40 A at 400 V, a current amplifier and a slow log.

use super::{ducted, stand_sensors};
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine, Sensors};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    Machine {
        class: "tunnel thruster",
        build: Build::Propeller,
        blades: Some(ducted(0.2, 0.25, (0.5, 0.75), (0.9, 1.2), dice)),
        load: Load::None,
        inertia_kg_m2: dice.between(0.08, 0.14),
        viscous_nm_s: 0.0,
        torque_constant_nm_a: dice.between(2.1, 2.7),
        winding_resistance_ohm: 0.6,
        drive: DriveKind::Current,
        drive_lag_s: 0.004,
        current_limit_a: 40.0,
        supply_v: 400.0,
        cogging_orders: &[4.0, 6.0, 36.0],
        sensors: Sensors { ticks_per_row: 10, thrust_filter_hz: 80.0, ..stand_sensors(4000.0) },
    }
}
