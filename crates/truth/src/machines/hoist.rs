//! A carriage on a ball screw that climbs an incline: a current amplifier, 1 kHz.

use super::bench_sensors;
use crate::dice::Dice;
use crate::load::Load;
use crate::machine::{Build, DriveKind, Machine};

/// A specimen: the weight takes a tenth to a third of the torque.
pub fn specimen(dice: &mut Dice) -> Machine {
    let torque_constant_nm_a = dice.between(0.3, 0.6);
    let (current_limit_a, lead_m_rev, incline_rad) = (6.0, dice.between(0.005, 0.04), dice.between(0.1, 1.2));
    let weight_n_m = dice.between(0.1, 0.35) * torque_constant_nm_a * current_limit_a;
    let mass_kg = weight_n_m * std::f64::consts::TAU / (9.81 * incline_rad.sin() * lead_m_rev);
    let load = Load::Carriage { mass_kg: mass_kg.min(60.0), lead_m_rev, incline_rad };
    Machine {
        class: "dry axis, carriage on an incline",
        build: Build::Direct,
        blades: None,
        load,
        inertia_kg_m2: load.inertia_kg_m2() + dice.log_between(0.0012, 0.006),
        viscous_nm_s: dice.between(0.012, 0.03),
        torque_constant_nm_a,
        winding_resistance_ohm: 1.8,
        drive: DriveKind::Current,
        drive_lag_s: 0.001,
        current_limit_a,
        supply_v: 150.0,
        cogging_orders: &[6.0, 12.0, 36.0],
        sensors: bench_sensors(0.001, dice.pick(&[2, 4, 10]), 10_000.0, dice.pick(&[0.002, 0.005, 0.01])),
    }
}
