//! A small brushless thruster: 76 mm duct; a voltage (duty) drive as an ESC, or a current amplifier.

use super::{ducted, stand_sensors};
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    let voltage = dice.chance(0.6);
    Machine {
        class: "small brushless",
        build: Build::Propeller,
        blades: Some(ducted(0.038, 0.04, (0.62, 0.88), (0.75, 1.0), dice)),
        load: Load::None,
        inertia_kg_m2: dice.between(5.2e-5, 6.8e-5),
        viscous_nm_s: 0.0,
        torque_constant_nm_a: dice.between(0.0158, 0.0195),
        winding_resistance_ohm: dice.between(0.11, 0.2),
        drive: if voltage { DriveKind::Voltage } else { DriveKind::Current },
        drive_lag_s: if voltage { 0.0006 } else { 0.002 },
        current_limit_a: if voltage { 60.0 } else { 30.0 },
        supply_v: if voltage { dice.between(11.0, 16.0) } else { 16.0 },
        cogging_orders: &[7.0, 12.0, 14.0],
        sensors: stand_sensors(200.0),
    }
}
