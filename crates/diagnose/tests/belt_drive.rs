//! A motor that turns a pulley by a belt, with the encoder on the one or on the other.

mod common;

use kort_diagnose::diagnose::{Options, diagnose};
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

use common::Draws;

const ROWS: usize = 700;
const ROW_S: f64 = 0.02;
const FINE: usize = 100;
const TORQUE_CONSTANT_NM_A: f64 = 0.03;
const RESISTANCE_OHM: f64 = 2.0;
const MOTOR_KG_M2: f64 = 4e-5;
const PULLEY_KG_M2: f64 = 6e-5;
const VISCOUS_NM_S: f64 = 3e-5;

/// Steps of voltage both ways at 50 Hz, and the speed of the motor or of the pulley.
fn recording(of_pulley: bool) -> Series {
    let reduced = MOTOR_KG_M2 * PULLEY_KG_M2 / (MOTOR_KG_M2 + PULLEY_KG_M2);
    let swing_rad_s = 2.5 * std::f64::consts::TAU;
    let (stiffness, damping) = (reduced * swing_rad_s * swing_rad_s, 2.0 * 0.15 * swing_rad_s * reduced);
    let mut draws = Draws(11);
    let (mut motor, mut pulley, mut twist, mut volts) = (0.0, 0.0, 0.0, 0.0);
    let mut columns =
        ["voltage_cmd_v", "shaft_speed_rad_s"].map(|name| (name.to_string(), Vec::new())).to_vec();
    for row in 0..ROWS {
        if row % 25 == 0 {
            volts = 2.0 * draws.next();
        }
        columns[0].1.push(volts);
        columns[1].1.push(if of_pulley { pulley } else { motor } + 0.3 * draws.next());
        for _ in 0..FINE {
            let dt = ROW_S / FINE as f64;
            let amperes = (volts - TORQUE_CONSTANT_NM_A * motor) / RESISTANCE_OHM;
            let belt = stiffness * twist + damping * (motor - pulley);
            motor += (TORQUE_CONSTANT_NM_A * amperes - VISCOUS_NM_S * motor - belt) / MOTOR_KG_M2 * dt;
            pulley += belt / PULLEY_KG_M2 * dt;
            twist += (motor - pulley) * dt;
        }
    }
    Series { name: "belt".into(), time_s: (0..ROWS).map(|k| k as f64 * ROW_S).collect(), columns }
}

/// Late and swinging at the pulley, as a drive's own loop would be; at the motor with an antiresonance.
#[test]
fn a_belt_is_found_whichever_end_the_encoder_sits_on() {
    let rig = Rig::from_toml(
        "[rig]\nname = \"motor, belt and pulley\"\n[propeller]\nkind = \"none\"\n[motor]\n\
         inertia_kg_m2 = { value = 8e-5, tol = 1.0 }\ntorque_constant_nm_a = { value = 0.03, tol = 0.3 }\n\
         winding_resistance_ohm = { value = 2.0, tol = 0.5 }\nviscous_friction_nm_s = { value = 2e-5, tol = 1.0 }\n\
         [amplifier]\nkind = \"voltage\"\n[sensors]\nlog_rate_hz = 50\n",
    )
    .unwrap();
    for (of_pulley, at_load) in [(false, 0.0), (true, 1.0)] {
        let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
        let report = diagnose(&[recording(of_pulley)], &rig, &options, &|_| {}).unwrap().report;
        let belt = report.findings.iter().find(|f| f.effect == "flexible_coupling");
        let belt = belt.unwrap_or_else(|| panic!("{of_pulley}: {:?}", report.verdict));
        let value = |name: &str| belt.parameters.iter().find(|p| p.name == name).unwrap().value;
        assert_eq!(value("encoder_at_load"), at_load);
        assert!((value("load_inertia_share") - 0.6).abs() < 0.15, "{}", value("load_inertia_share"));
        // A drive that closes its loop and swings does at the pulley what a belt does: neither is sure there.
        let sure = report.findings.iter().filter(|f| f.probability > 0.9);
        let sure: Vec<&str> = sure.map(|f| f.effect.as_str()).collect();
        assert_eq!(sure, if of_pulley { vec![] } else { vec!["flexible_coupling"] });
    }
}
