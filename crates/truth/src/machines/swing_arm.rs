//! A geared servo that swings a weight on an arm, all values at its output shaft: a voltage drive, an encoder on
//! the output.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen: the weight takes a third to nearly all of the stalled torque.
pub fn specimen(dice: &mut Dice) -> Machine {
    let torque_constant_nm_a = dice.between(0.3, 1.2);
    let winding_resistance_ohm = dice.between(2.0, 5.0);
    let supply_v = dice.pick(&[7.4, 12.0]);
    let stalled_n_m = torque_constant_nm_a * supply_v / winding_resistance_ohm;
    let length_m = dice.between(0.08, 0.25);
    let mass_kg = dice.between(0.3, 0.85) * stalled_n_m / (9.81 * length_m);
    let load = Load::Arm { mass_kg, length_m };
    Machine {
        class: "dry servo, weight on an arm",
        build: Build::Geared,
        blades: None,
        load,
        inertia_kg_m2: load.inertia_kg_m2() * dice.between(1.1, 1.6),
        viscous_nm_s: dice.between(0.005, 0.03) * stalled_n_m,
        torque_constant_nm_a,
        winding_resistance_ohm,
        drive: DriveKind::Voltage,
        drive_lag_s: 0.0006,
        current_limit_a: 12.0,
        supply_v,
        cogging_orders: &[2.0, 3.0, 5.0],
        sensors: bench_sensors(0.001, dice.pick(&[2, 5, 10]), 4096.0, dice.pick(&[0.005, 0.01, 0.02])),
    }
}
