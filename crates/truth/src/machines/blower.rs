//! A fan on a motor's shaft: a current amplifier, 500 Hz.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen: the fan takes most of the torque at full speed.
pub fn specimen(dice: &mut Dice) -> Machine {
    let torque_constant_nm_a = dice.between(0.02, 0.08);
    let current_limit_a = dice.between(3.0, 10.0);
    let full_n_m = torque_constant_nm_a * current_limit_a;
    let fastest_rad_s = dice.between(80.0, 250.0);
    let share = dice.between(0.6, 0.9);
    Machine {
        class: "dry blower",
        build: Build::Direct,
        blades: None,
        load: Load::Fan { drag_nm_s2: share * full_n_m / fastest_rad_s.powi(2) },
        inertia_kg_m2: dice.between(0.1, 0.3) * full_n_m / fastest_rad_s,
        viscous_nm_s: (1.0 - share) * full_n_m / fastest_rad_s,
        torque_constant_nm_a,
        winding_resistance_ohm: dice.between(0.2, 0.6),
        drive: DriveKind::Current,
        drive_lag_s: 0.001,
        current_limit_a,
        supply_v: 48.0,
        cogging_orders: &[7.0, 14.0],
        sensors: bench_sensors(0.002, dice.pick(&[2, 5]), 4096.0, dice.pick(&[0.005, 0.01])),
    }
}
