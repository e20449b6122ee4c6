//! A brushless motor without a load: a current amplifier, 1 kHz, a fine encoder.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen.
pub fn specimen(dice: &mut Dice) -> Machine {
    Machine {
        class: "dry brushless motor, no load",
        build: Build::Direct,
        blades: None,
        load: Load::None,
        inertia_kg_m2: dice.log_between(3e-6, 1.2e-5),
        viscous_nm_s: dice.log_between(8e-5, 2e-4),
        torque_constant_nm_a: dice.between(0.018, 0.035),
        winding_resistance_ohm: 0.9,
        drive: DriveKind::Current,
        drive_lag_s: 0.001,
        current_limit_a: 0.9,
        supply_v: 24.0,
        cogging_orders: &[12.0, 18.0, 24.0, 36.0],
        sensors: bench_sensors(0.001, dice.pick(&[1, 2, 5]), 20_000.0, 0.002),
    }
}
