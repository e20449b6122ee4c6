//! The seed paper's stand: 24 cm propeller in a 26 cm duct, about 1 kW, a current amplifier.

use super::{ducted, stand_sensors};
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    Machine {
        class: "ducted work-class",
        build: Build::Propeller,
        blades: Some(ducted(0.13, 0.1271, (0.48, 0.62), (1.05, 1.35), dice)),
        load: Load::None,
        inertia_kg_m2: dice.between(0.0085, 0.0115),
        viscous_nm_s: 0.0,
        torque_constant_nm_a: dice.between(1.12, 1.28),
        winding_resistance_ohm: 2.2,
        drive: DriveKind::Current,
        drive_lag_s: 0.002,
        current_limit_a: 9.0,
        supply_v: 120.0,
        cogging_orders: &[4.0, 6.0, 12.0, 24.0],
        sensors: stand_sensors(890.0),
    }
}
