//! What a rig is known to have is known within what is stated of it, and no further.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::Report;
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = r#"
[rig]
name = "fan with a seal that rubs"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 0.02, tol = 0.2 }
torque_constant_nm_a = { value = 1.0, tol = 0.02 }
[load]
kind = "fan"
fan_coefficient_nm_s2 = { value = 2.0e-3, tol = 0.2 }
[amplifier]
kind = "current"
[sensors]
log_rate_hz = 100
control_rate_hz = 100
[[effects]]
effect = "coulomb_friction"
coulomb_torque_n_m = { value = 0.40, tol = 0.3 }
"#;

/// A fan that takes some 13 N m at most, with so much dry friction; its own integrator, at 0.1 ms.
fn report(friction_n_m: f64) -> Report {
    const STEP_S: f64 = 1e-4;
    let levels = [0.0, 6.0, -3.0, 12.0, 1.5, -9.0, 4.0, -1.0, 8.0];
    let mut speed = 0.0_f64;
    let mut rows: Vec<[f64; 3]> = Vec::new();
    for k in 0..200_000_usize {
        let current = levels[(k as f64 * STEP_S / 1.7) as usize % levels.len()];
        if k % 100 == 0 {
            let noise = ((k * k % 9973) as f64 * 0.37).sin();
            rows.push([k as f64 * STEP_S, current, speed + 0.05 * noise]);
        }
        let rubs = friction_n_m * (speed / 0.02).tanh();
        speed += (current - 1.9e-3 * speed * speed.abs() - rubs) / 0.021 * STEP_S;
    }
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let columns =
        [(1, "current_cmd_a"), (2, "shaft_speed_rad_s")].map(|(i, name)| (name.to_owned(), column(i)));
    let log = Series { name: "log".into(), time_s: column(0), columns: columns.into() };
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    diagnose(&[log], &Rig::from_toml(RIG).unwrap(), &options, &|_| ()).unwrap().report
}

#[test]
fn friction_within_its_tolerance_is_as_stated() {
    let found = report(0.34);
    assert!(found.findings.is_empty(), "{}", found.summary);
    let friction = found.baseline.parameters.iter().find(|p| p.name == "coulomb_torque_n_m").unwrap();
    assert!((friction.value / 0.34 - 1.0).abs() < 0.1 && friction.stated == Some(0.40), "{friction:?}");
}

#[test]
fn friction_far_beyond_its_tolerance_is_found() {
    let found = report(1.0);
    let friction = found.findings.iter().find(|f| f.effect == "coulomb_friction").expect(&found.summary);
    let torque = friction.parameters.iter().find(|p| p.name == "coulomb_torque_n_m").unwrap().value;
    assert!((torque - 1.0).abs() < 0.1, "{torque} N m of 1");
    assert!(
        found.notes.iter().any(|note| note.contains("to the edge of what is stated")),
        "{:?}",
        found.notes
    );
}
