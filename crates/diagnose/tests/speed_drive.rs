//! A drive that holds a commanded speed hides what brakes its shaft; the current that it needs for it does not.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::Report;
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = r#"
[rig]
name = "fan on a speed drive"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 0.02, tol = 0.2 }
torque_constant_nm_a = { value = 1.0, tol = 0.1 }
[load]
kind = "fan"
fan_coefficient_nm_s2 = { value = 2.0e-3, tol = 0.2 }
[amplifier]
kind = "speed"
time_constant_s = { value = 0.03, tol = 0.5 }
[sensors]
log_rate_hz = 100
control_rate_hz = 100
"#;

/// A fan that takes 15 N m at 90 rad/s under a speed loop (proportional and integral), with so much dry friction; its own
/// integrator, at 0.1 ms.
fn recording(friction_n_m: f64) -> Series {
    const STEP_S: f64 = 1e-4;
    let levels = [0.0, 60.0, -40.0, 85.0, 25.0, -75.0, 45.0, -15.0, 70.0];
    let (mut speed, mut integral, mut asked, mut current) = (0.0_f64, 0.0_f64, 0.0_f64, 0.0);
    let mut rows: Vec<[f64; 4]> = Vec::new();
    for k in 0..200_000_usize {
        if k % 100 == 0 {
            asked = levels[(k as f64 * STEP_S / 1.7) as usize % levels.len()];
            let noise = |a: usize| ((k * k % 9973 + a) as f64 * 0.37).sin();
            rows.push([k as f64 * STEP_S, asked, speed + 0.05 * noise(0), current + 0.05 * noise(5)]);
        }
        let error = asked - speed;
        integral += 2.0 * error * STEP_S;
        current = 0.6 * error + integral;
        let rubs = friction_n_m * (speed / 0.05).tanh();
        speed += (current - 1.9e-3 * speed * speed.abs() - rubs) / 0.021 * STEP_S;
    }
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let columns = [(1, "speed_cmd_rad_s"), (2, "shaft_speed_rad_s"), (3, "current_a")]
        .map(|(i, name)| (name.to_owned(), column(i)));
    Series { name: "log".into(), time_s: column(0), columns: columns.into() }
}

fn report(log: Series) -> Report {
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    diagnose(&[log], &Rig::from_toml(RIG).unwrap(), &options, &|_| ()).unwrap().report
}

fn named(report: &Report, effect: &str) -> f64 {
    report.findings.iter().find(|f| f.effect == effect).map_or(0.0, |f| f.probability)
}

#[test]
fn dry_friction_behind_a_speed_loop_shows_in_its_current() {
    let found = report(recording(0.8));
    assert!(named(&found, "coulomb_friction") > 0.5, "{}", found.summary);
    let friction = found.findings.iter().find(|f| f.effect == "coulomb_friction").unwrap();
    let torque = friction.parameters.iter().find(|p| p.name == "coulomb_torque_n_m").unwrap().value;
    assert!((torque / 0.8 - 1.0).abs() < 0.2, "{torque}");
    assert_eq!(found.recordings, ["log"], "a recording is one though it is read twice");
    assert!((found.seconds - 20.0).abs() < 0.1, "{}", found.seconds);
    assert!(found.notes.iter().any(|note| note.contains("own current is recorded")), "{:?}", found.notes);
}

#[test]
fn a_healthy_shaft_behind_a_speed_loop_rubs_nothing() {
    let found = report(recording(0.0));
    assert!(named(&found, "coulomb_friction") < 0.5, "{}", found.summary);
}
