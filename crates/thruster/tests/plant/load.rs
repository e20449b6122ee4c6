//! What else hangs on the shaft, and the physics a rig is known to have.

use kort_thruster::effects::{Descriptor, find};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{FoundEffect, Quantity, Rig, RigError};

use crate::plant;

const TICK_S: f64 = 0.002;
const DRY: &str =
    "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.0016\ntorque_constant_nm_a = 1.0\n";

fn rig(more: &str) -> Rig {
    Rig::from_toml(&format!("{DRY}{more}")).unwrap()
}

fn refused(more: &str) -> String {
    let error: RigError = Rig::from_toml(&format!("{DRY}{more}")).unwrap_err();
    let words = error.to_string();
    assert!(words.contains("hint: "), "{words}");
    words
}

fn step(plant: &mut Plant, torque_n_m: f64) -> (f64, f64) {
    plant.step(&Tick { command: torque_n_m, ..Tick::default() });
    (plant.truth().shaft_speed_rad_s, plant.truth().shaft_angle_rad)
}

#[test]
fn a_pendulum_swings_at_its_frequency_and_keeps_its_energy() {
    let rig = rig("[load]\nkind = \"pendulum\"\nmass_kg = 0.49\nlength_m = 0.1\n");
    let (mass, length, inertia) = (0.49, 0.1, 0.0016 + 0.49 * 0.01);
    let torque = mass * length * 9.806_65;
    let mut plant = plant(&rig, &[], TICK_S);
    plant.start(0.0, 0.0, 0.0, 0.0, 0.05);
    let (mut crossings, mut last) = (Vec::new(), 0.05);
    for k in 0..2000 {
        let (speed, angle) = step(&mut plant, 0.0);
        let energy = 0.5 * inertia * speed * speed + torque * (1.0 - angle.cos());
        assert!((energy - torque * (1.0 - 0.05_f64.cos())).abs() < 1e-9, "{k}");
        if last < 0.0 && angle >= 0.0 {
            crossings.push(k as f64);
        }
        last = angle;
    }
    let period = (crossings[crossings.len() - 1] - crossings[0]) / (crossings.len() - 1) as f64 * TICK_S;
    let wanted = std::f64::consts::TAU * (inertia / torque).sqrt();
    assert!((period / wanted - 1.0).abs() < 2e-3, "{period} {wanted}");
}

#[test]
fn a_pendulum_is_held_by_the_torque_of_its_weight_and_by_dry_friction() {
    let load = "[load]\nkind = \"pendulum\"\nmass_kg = 0.49\nlength_m = 0.1\n";
    let side = std::f64::consts::FRAC_PI_2;
    let mut free = plant(&rig(load), &[], TICK_S);
    free.start(0.0, 0.0, 0.0, 0.49 * 0.1 * 9.806_65, side);
    for _ in 0..500 {
        step(&mut free, 0.49 * 0.1 * 9.806_65);
    }
    assert!((free.truth().shaft_angle_rad - side).abs() < 1e-9);
    // A gear that rubs by a quarter of what it carries holds with less: t (1 + mu) = w (1 - mu).
    for (share, holds) in [(0.62, true), (0.58, false)] {
        let mut geared = plant(&rig(load), &[("gear_load_friction", &[0.25, 1.0])], TICK_S);
        let torque = share * 0.49 * 0.1 * 9.806_65;
        geared.start(0.0, 0.0, 0.0, torque, side);
        for _ in 0..200 {
            step(&mut geared, torque);
        }
        assert_eq!(geared.truth().shaft_angle_rad == side, holds, "{share}");
    }
}

#[test]
fn a_fan_settles_where_its_square_takes_the_torque() {
    let mut plant = plant(&rig("[load]\nkind = \"fan\"\nfan_coefficient_nm_s2 = 1e-4\n"), &[], TICK_S);
    for _ in 0..2000 {
        step(&mut plant, 0.25);
    }
    assert!((plant.truth().shaft_speed_rad_s - 50.0).abs() < 1e-6);
}

#[test]
fn a_slide_adds_its_mass_by_the_lead_and_its_weight_by_the_incline() {
    let lead = 0.005 / std::f64::consts::TAU;
    let slide = "[load]\nkind = \"slide\"\nmass_kg = 80.0\nlead_m_rev = 0.005\n";
    let mut level = plant(&rig(slide), &[], TICK_S);
    let (speed, _) = step(&mut level, 0.1);
    assert!((speed - 0.1 / (0.0016 + 80.0 * lead * lead) * TICK_S).abs() < 1e-12);
    let mut lifted = plant(&rig(&format!("{slide}incline_rad = 0.5\n")), &[], TICK_S);
    let weight = 80.0 * 9.806_65 * 0.5_f64.sin() * lead;
    assert!(step(&mut lifted, weight).0.abs() < 1e-12);
}

/// The two masses of a rig are the flexible coupling of the catalogue.
#[test]
fn two_masses_are_a_flexible_coupling() {
    let two =
        "[load]\nkind = \"two_mass\"\ninertia_kg_m2 = 0.0024\nstiffness_nm_rad = 2.0\ndamping_nm_s = 0.005\n";
    let mut ours = plant(&rig(two), &[], TICK_S);
    let (both, reduced) = (0.004, 0.0016 * 0.0024 / 0.004);
    let damping = 0.005 / (2.0 * (2.0_f64 * reduced).sqrt());
    let whole = Rig::from_toml(&DRY.replace("0.0016", "0.004")).unwrap();
    let mut same = plant(&whole, &[("flexible_coupling", &[0.5, 0.0024 / both, damping, 0.0])], TICK_S);
    for k in 0..300 {
        let torque = if k < 100 { 0.1 } else { -0.05 };
        step(&mut ours, torque);
        step(&mut same, torque);
        let (a, b) = (ours.sensed().shaft_speed_rad_s, same.sensed().shaft_speed_rad_s);
        assert!((a - b).abs() < 1e-9, "{k}: {a} {b}");
    }
}

const KNOWN: &str = "[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = { value = 0.05, tol = 0.2 } # coast-down\n";

#[test]
fn what_a_rig_is_known_to_have_belongs_to_its_plant() {
    let friction: &[(&str, &[f64])] = &[("coulomb_friction", &[0.05, 0.0, 1.0])];
    let (mut known, mut added) = (plant(&rig(KNOWN), &[], TICK_S), plant(&rig(""), friction, TICK_S));
    // One that is given takes the place of the rig's.
    let twice: &[(&str, &[f64])] = &[("coulomb_friction", &[0.1, 0.0, 1.0])];
    let mut replaced = plant(&rig(KNOWN), twice, TICK_S);
    for _ in 0..50 {
        step(&mut added, 0.2);
        assert_eq!(step(&mut known, 0.2).0, added.truth().shaft_speed_rad_s);
        step(&mut replaced, 0.2);
    }
    let ratio = replaced.truth().shaft_speed_rad_s / known.truth().shaft_speed_rad_s;
    assert!((ratio - 0.1 / 0.15).abs() < 1e-9, "{ratio}");
}

#[test]
fn wrong_loads_and_effects_are_named() {
    let words = refused("[load]\nkind = \"pendulum\"\nmass_kg = 0.5\n");
    assert!(words.contains("load.length_m") && words.contains("metres"), "{words}");
    let words = refused("[load]\nkind = \"pendulam\"\n");
    assert!(words.contains("load.kind") && words.contains("\"pendulum\""), "{words}");
    let words = refused("[load]\nkind = \"fan\"\nfan_coefficient_nm_s2 = 1e-4\nmass_kg = 1.0\n");
    assert!(words.contains("load.mass_kg") && words.contains("fan_coefficient_nm_s2"), "{words}");
    let words = refused("[[effects]]\neffect = \"coulom_friction\"\n");
    assert!(
        words.contains("effects[0].effect") && words.contains("did you mean `coulomb_friction`?"),
        "{words}"
    );
    let words = refused(&KNOWN.replace("coulomb_torque", "coulomb_torqe"));
    assert!(words.contains("did you mean `coulomb_torque_n_m`?"), "{words}");
    let words = refused(&format!("{KNOWN}stribeck_rise = 0.3\n"));
    assert!(words.contains("`effects[0].stribeck_speed_rad_s` is missing"), "{words}");
    let words = refused(&KNOWN.replace("0.05", "-0.05"));
    assert!(words.contains("coulomb_torque_n_m") && words.contains("0 or above"), "{words}");
    let words = refused("[[effects]]\neffect = \"ambient_flow_unsteady\"\n");
    assert!(words.contains("changes freely with time"), "{words}");
    let words = refused(&format!("{KNOWN}{KNOWN}"));
    assert!(words.contains("effects[1].effect") && words.contains("once"), "{words}");
    let words = refused("effects = 3\n");
    assert!(words.contains("motor.effects") || words.contains("`effects`"), "{words}");
}

#[test]
fn what_was_found_is_written_and_read_back() {
    let text = format!("# the bench\n{DRY}\n{KNOWN}");
    let found = [
        FoundEffect {
            effect: "coulomb_friction",
            parameters: vec![
                ("coulomb_torque_n_m", Quantity { value: 0.061_234_567, tol: Some(0.03) }),
                ("stribeck_rise", Quantity::exact(0.25)),
                ("stribeck_speed_rad_s", Quantity::exact(1.5)),
            ],
        },
        FoundEffect {
            effect: "torque_channel_bias",
            parameters: vec![("shaft_torque_bias_n_m", Quantity { value: -0.01, tol: Some(0.5) })],
        },
    ];
    let written = Rig::with_effects_toml(&text, &found, "found by kort diagnose").unwrap();
    assert!(
        written.starts_with("# the bench") && written.contains("effect = \"coulomb_friction\""),
        "{written}"
    );
    // Where a replaced value came from is said of it no more.
    assert!(!written.contains("# coast-down"), "{written}");
    assert_eq!(written.matches(" # found by kort diagnose\n").count(), 4, "{written}");
    assert_eq!(written.matches("[[effects]]").count(), 2, "{written}");
    let read = Rig::from_toml(&written).unwrap();
    assert_eq!(read.effects[0].parameters[0].1, Quantity { value: 0.0612346, tol: Some(0.03) });
    assert_eq!(read.effects[0].value("stribeck_speed_rad_s"), 1.5);
    assert_eq!(read.effects[1].values().collect::<Vec<_>>(), [-0.01, 0.0, 0.0, 0.0]);
    // Written again, it stays.
    assert_eq!(Rig::with_effects_toml(&written, &found, "found by kort diagnose").unwrap(), written);
    let unknown = [FoundEffect { effect: "gremlins", parameters: Vec::new() }];
    assert!(Rig::with_effects_toml(&text, &unknown, "found").unwrap_err().to_string().contains("gremlins"));
}

/// Every effect of the catalogue that has lasting sizes can be stated, and does what it does when given.
#[test]
fn every_lasting_effect_can_be_stated() {
    let wet = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");
    let stated = Rig::from_toml(wet).unwrap();
    let lasting = kort_thruster::effects::ALL.iter().filter(|e| !e.nonparametric && e.id != "log_gaps");
    for effect in lasting {
        let specs = (effect.parameters)(&kort_thruster::effects::Scale::ANY);
        let parameters: Vec<_> = specs.iter().map(|s| (s.name, Quantity::exact(s.start))).collect();
        let found = [FoundEffect { effect: effect.id, parameters }];
        let written = Rig::with_effects_toml(wet, &found, "found").unwrap();
        let with = Rig::from_toml(&written).unwrap();
        let values: Vec<f64> = with.effects[0].values().collect();
        let given: [(&Descriptor, &[f64]); 1] = [(find(effect.id).unwrap(), &values)];
        let run = |rig: &Rig, given: &[(&Descriptor, &[f64])]| {
            let mut plant = Plant::new(ModelName::Model2, rig, &Parameters::stated(rig), given, TICK_S);
            (0..100).for_each(|_| plant.step(&Tick { command: 5.0, ..Tick::default() }));
            plant.sensed()
        };
        assert_eq!(run(&with, &[]), run(&stated, &given), "{}", effect.id);
    }
}
