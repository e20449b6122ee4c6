//! A servo axis: motor and inertia on one shaft, a current amplifier, 1 kHz.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    let rows = dice.pick(&[2, 4, 10]);
    Machine {
        class: "dry servo axis",
        build: Build::Direct,
        blades: None,
        load: Load::None,
        inertia_kg_m2: dice.log_between(0.0012, 0.006),
        viscous_nm_s: dice.between(0.012, 0.03),
        torque_constant_nm_a: dice.between(0.4, 0.65),
        winding_resistance_ohm: 1.8,
        drive: DriveKind::Current,
        drive_lag_s: 0.001,
        current_limit_a: 5.0,
        supply_v: 150.0,
        cogging_orders: &[6.0, 12.0, 36.0],
        sensors: bench_sensors(0.001, rows, 10_000.0, dice.pick(&[0.002, 0.005, 0.01])),
    }
}
