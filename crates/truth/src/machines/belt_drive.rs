//! A belt drive: a current amplifier, a larger inertia, a tachometer, a slow log.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine, Sensors};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    let sensors = bench_sensors(0.002, dice.pick(&[5, 10]), 2048.0, 0.01);
    Machine {
        class: "dry belt drive",
        build: Build::Belt,
        blades: None,
        load: Load::None,
        inertia_kg_m2: dice.log_between(0.025, 0.1),
        viscous_nm_s: dice.between(0.15, 0.4),
        torque_constant_nm_a: dice.between(0.8, 1.3),
        winding_resistance_ohm: 1.0,
        drive: DriveKind::Current,
        drive_lag_s: 0.002,
        current_limit_a: 8.0,
        supply_v: 90.0,
        cogging_orders: &[4.0, 12.0],
        sensors: Sensors { tachometer_noise: dice.between(0.001, 0.004), ..sensors },
    }
}
