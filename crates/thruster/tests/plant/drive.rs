//! A released drive, and the back-EMF within a tick.

use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;

use crate::plant;

/// A dry shaft on a voltage drive that its back-EMF brakes with a time constant of 0.05 s.
fn voltage(lag_s: f64) -> Rig {
    Rig::from_toml(&format!(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
         winding_resistance_ohm = 5.0\n[amplifier]\nkind = \"voltage\"\ntime_constant_s = {lag_s}\n"
    ))
    .unwrap()
}

fn speed_after(plant: &mut Plant, ticks: usize, tick: Tick) -> f64 {
    (0..ticks).for_each(|_| plant.step(&tick));
    plant.truth().shaft_speed_rad_s
}

#[test]
fn a_released_drive_coasts_and_one_at_zero_volts_brakes() {
    for released in [true, false] {
        let mut plant = plant(&voltage(0.0), &[], 0.002);
        plant.start(0.0, 10.0, 0.0, 0.0, 0.0);
        let left = speed_after(&mut plant, 100, Tick { released, command: 0.0, ..Tick::default() });
        let wanted = if released { 10.0 } else { 10.0 * (-0.2_f64 / 0.05).exp() };
        assert!((left - wanted).abs() < 1e-4, "{released}: {left}");
        assert_eq!(plant.sensed().current_a == 0.0, released);
    }
}

/// The current follows the back-EMF within the tick, so that a long tick is as good as a short one.
#[test]
fn the_back_emf_is_not_late_by_a_tick() {
    for lag_s in [0.0, 0.01] {
        let after = |tick_s: f64| {
            let mut plant = plant(&voltage(lag_s), &[], tick_s);
            let ticks = (0.06 / tick_s).round() as usize;
            speed_after(&mut plant, ticks, Tick { command: 5.0, ..Tick::default() })
        };
        let (coarse, fine) = (after(0.004), after(0.00004));
        assert!((coarse - fine).abs() < 0.005 * fine, "{lag_s}: {coarse} {fine}");
    }
}

/// What is shown before the first tick is the stated supply, and a log that begins with no voltage leaves numbers.
#[test]
fn the_supply_is_there_before_the_first_tick() {
    let rig = Rig::from_toml(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.01\ntorque_constant_nm_a = 1.0\n\
         winding_resistance_ohm = 5.0\n[amplifier]\nkind = \"voltage\"\nsupply_v = 24.0\n",
    )
    .unwrap();
    let sag: (&str, &[f64]) = ("supply_sag", &[0.5, 0.01, 1.0]);
    for effects in [&[][..], &[sag]] {
        let mut plant = plant(&rig, effects, 0.002);
        assert_eq!(plant.sensed().supply_v, 24.0);
        plant.step(&Tick { command: 6.0, supply_v: Some(0.0), ..Tick::default() });
        plant.step(&Tick { time_s: 0.002, command: 6.0, supply_v: Some(24.0), ..Tick::default() });
        let seen = plant.sensed();
        assert!(seen.shaft_speed_rad_s.is_finite() && seen.current_a > 0.0, "{seen:?}");
    }
}

/// A step down and a release are answered by friction alone, a step up and a reversal as by any drive.
#[test]
fn a_drive_that_freewheels_drives_and_does_not_brake() {
    let after = |share: f64, from_rad_s: f64, command: f64| {
        let effects: &[(&str, &[f64])] = &[("drive_freewheels", &[share])];
        let mut plant = plant(&voltage(0.0), effects, 0.002);
        plant.start(0.0, from_rad_s, 0.0, 0.0, 0.0);
        speed_after(&mut plant, 100, Tick { command, ..Tick::default() })
    };
    let brakes = 10.0 * (-0.2_f64 / 0.05).exp();
    assert!((after(0.0, 10.0, 0.0) - brakes).abs() < 1e-3);
    assert_eq!(after(1.0, 10.0, 0.0), 10.0, "released");
    assert_eq!(after(1.0, 10.0, 4.0), 10.0, "stepped down");
    assert_eq!(after(1.0, 2.0, 8.0), after(0.0, 2.0, 8.0), "stepped up");
    assert!(after(1.0, 10.0, -4.0) < 8.0, "reversed");
    let half = after(0.5, 10.0, 0.0);
    assert!(brakes < half && half < 10.0, "{half}");
}
