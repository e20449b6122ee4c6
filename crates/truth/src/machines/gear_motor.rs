//! A geared motor, all values at its output shaft: a voltage drive, an encoder of some hundred to
//! thousand counts.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    let counts = dice.pick(&[1024.0, 4096.0, 12_800.0]);
    Machine {
        class: "dry gear motor",
        build: Build::Geared,
        blades: None,
        load: Load::None,
        inertia_kg_m2: dice.log_between(0.002, 0.012),
        viscous_nm_s: dice.log_between(0.004, 0.02),
        torque_constant_nm_a: dice.between(0.35, 0.7),
        winding_resistance_ohm: dice.between(2.0, 4.0),
        drive: DriveKind::Voltage,
        drive_lag_s: 0.0006,
        current_limit_a: 12.0,
        supply_v: dice.pick(&[7.4, 12.0, 24.0]),
        cogging_orders: &[2.0, 3.0, 5.0],
        sensors: bench_sensors(0.002, dice.pick(&[1, 2, 5]), counts, dice.pick(&[0.005, 0.01, 0.02])),
    }
}
