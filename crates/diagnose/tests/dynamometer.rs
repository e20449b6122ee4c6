//! A motor on a dynamometer: what the load takes is measured between the two, and goes its own way.

mod common;

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::Report;
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

use common::Draws;

const RIG: &str = r#"
[rig]
name = "servo motor on a dynamometer"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 7e-4, tol = 0.4 }
torque_constant_nm_a = { value = 0.125, tol = 0.1 }
viscous_friction_nm_s = { value = 8e-4, tol = 0.6 }
[amplifier]
kind = "current"
current_limit_a = 10
[sensors]
log_rate_hz = 500
control_rate_hz = 500
"#;

const ROWS: usize = 4000;
const ROW_S: f64 = 0.002;
const FINE: usize = 20;
const TORQUE_CONSTANT_NM_A: f64 = 0.12;

/// What stands in the column `torque_n_m`.
#[derive(Clone, Copy)]
enum Torque {
    /// A transducer between motor and load, with this sign.
    Transducer(f64),
    /// The drive's own estimate, from its current; there is no load.
    OfTheDrive,
}

/// A motor with dry friction that nobody stated, under steps of its current and of a brake that knows nothing of them.
fn recording(column: Torque) -> Series {
    let mut draws = Draws(3);
    let (mut speed, mut amperes, mut brake_n_m) = (0.0_f64, 0.0, 0.0);
    let names = ["current_cmd_a", "shaft_speed_rad_s", "torque_n_m"];
    let mut columns: Vec<(String, Vec<f64>)> = names.iter().map(|n| (n.to_string(), Vec::new())).collect();
    for row in 0..ROWS {
        if row % 130 == 0 {
            amperes = 5.0 * draws.next();
        }
        if row % 170 == 60 {
            brake_n_m = 0.2 * draws.next();
        }
        let load_n_m = |speed: f64| match column {
            Torque::Transducer(_) => brake_n_m + 0.004 * speed,
            Torque::OfTheDrive => 0.0,
        };
        columns[0].1.push(amperes);
        columns[1].1.push(speed + 0.1 * draws.next());
        columns[2].1.push(match column {
            Torque::Transducer(sign) => sign * (load_n_m(speed) + 0.005 * draws.next()),
            Torque::OfTheDrive => TORQUE_CONSTANT_NM_A * amperes,
        });
        for _ in 0..FINE {
            let dt = ROW_S / FINE as f64;
            let pushed = TORQUE_CONSTANT_NM_A * amperes - 1e-3 * speed - load_n_m(speed);
            let by = 0.04 / 6e-4 * dt;
            let free = speed + pushed / 6e-4 * dt;
            speed = if free.abs() <= by { 0.0 } else { free - by * free.signum() };
        }
    }
    Series { name: "dyno".into(), time_s: (0..ROWS).map(|k| k as f64 * ROW_S).collect(), columns }
}

fn report(column: Torque) -> Report {
    let rig = Rig::from_toml(RIG).unwrap();
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    diagnose(&[recording(column)], &rig, &options, &|_| ()).unwrap().report
}

#[test]
fn friction_is_found_behind_a_measured_load() {
    for (sign, turned) in [(1.0, false), (-1.0, true)] {
        let report = report(Torque::Transducer(sign));
        let first = report.findings.first().unwrap_or_else(|| panic!("{}", report.summary));
        assert_eq!(first.effect, "coulomb_friction", "{}", report.summary);
        let size = first.parameters.iter().find(|p| p.name == "coulomb_torque_n_m").unwrap();
        assert!((size.value - 0.04).abs() < 0.01, "{} N m of 0.04", size.value);
        let notes = report.notes.join("\n");
        assert!(notes.contains("torque_n_m is taken for what a load takes"), "{notes}");
        assert_eq!(notes.contains("its sign turned"), turned, "{notes}");
    }
}

#[test]
fn what_a_drive_calls_its_torque_is_no_load() {
    let report = report(Torque::OfTheDrive);
    let notes = report.notes.join("\n");
    assert!(notes.contains("columns not used: torque_n_m"), "{notes}");
    assert_eq!(
        report.findings.first().map(|f| f.effect.as_str()),
        Some("coulomb_friction"),
        "{}",
        report.summary
    );
}
