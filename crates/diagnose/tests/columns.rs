//! A column that the model has no use for is told by its name where it truly drives the shaft; a neighbour's jet is physics.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::Rig;

const TICK_S: f64 = 0.002;
const RIG: &str = r#"
[rig]
name = "brushed motor"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 0.002, tol = 0.1 }
torque_constant_nm_a = { value = 0.3, tol = 0.1 }
winding_resistance_ohm = { value = 2.0, tol = 0.1 }
[amplifier]
kind = "voltage"
supply_v = 24.0
[sensors]
log_rate_hz = 50
"#;

/// A valve of a hydraulic load opens and shuts by itself: 0.4 N m astern at full opening.
fn valve(t: f64) -> f64 {
    let opening = [0.0, 0.6, 0.2, 1.0, 0.0, 0.9, 0.4, 0.0, 0.7];
    opening[(t / 2.3) as usize % opening.len()]
}

/// Something that moves too and drives nothing.
fn humidity(t: f64) -> f64 {
    45.0 + 3.0 * (0.21 * t).sin()
}

fn recording() -> Series {
    let rig = Rig::from_toml(RIG).unwrap();
    let mut plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], TICK_S);
    let levels = [0.0, 12.0, -8.0, 18.0, 5.0, -15.0, 9.0];
    let mut rows: Vec<[f64; 5]> = Vec::new();
    for k in 0..20_000_u32 {
        let t = f64::from(k) * TICK_S;
        let command = levels[(t / 1.9) as usize % levels.len()];
        if k % 10 == 0 {
            rows.push([t, command, valve(t), humidity(t), plant.truth().shaft_speed_rad_s]);
        }
        // A voltage that makes the load's torque, through the stated winding.
        let load_v = -0.4 * valve(t) * 2.0 / 0.3;
        plant.step(&Tick { time_s: t, command: command + load_v, ..Tick::default() });
    }
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let columns = vec![
        ("voltage_cmd_v".into(), column(1)),
        ("valve_opening".into(), column(2)),
        ("humidity_percent".into(), column(3)),
        ("shaft_speed_rad_s".into(), column(4)),
    ];
    Series { name: "valve".into(), time_s: column(0), columns }
}

#[test]
fn a_column_that_drives_the_shaft_is_told_by_its_name() {
    let rig = Rig::from_toml(RIG).unwrap();
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    let report = diagnose(&[recording()], &rig, &options, &|_| ()).unwrap().report;
    let term = report.empirical_term.unwrap_or_else(|| panic!("{}", report.summary));
    assert_eq!(term.variables, ["valve_opening"], "{}", report.summary);
    assert_eq!(term.path, "shaft");
    assert!(report.summary.contains("valve_opening"), "{}", report.summary);
    // 0.4 N m at full opening, by standard deviation of the opening.
    let gain = term.parameters.iter().find(|p| p.name == "gain").unwrap().value;
    assert!((gain / (-0.4 * 0.375) - 1.0).abs() < 0.15, "{gain}");
}

/// A neighbour that mostly thrusts ahead, and rests in between; its current, A.
fn neighbour(t: f64) -> f64 {
    [0.0, 6.0, -3.0, 8.0, 0.0, 5.0][(t / 6.7) as usize % 6]
}

#[test]
fn the_jet_of_a_neighbour_is_named_and_is_none_where_the_neighbour_rests() {
    let rig = Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
    let mut plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], TICK_S);
    let levels = [0.0, 4.0, -3.0, 6.0, 2.0, -5.0, 3.0];
    let mut rows: Vec<[f64; 5]> = Vec::new();
    for k in 0..20_000_u32 {
        let t = f64::from(k) * TICK_S;
        let command = levels[(t / 1.9) as usize % levels.len()];
        if k % 10 == 0 {
            let shown = plant.sensed();
            rows.push([t, command, neighbour(t), shown.shaft_speed_rad_s, shown.thrust_n]);
        }
        let jet_m_s = 0.03 * neighbour(t);
        plant.step(&Tick { time_s: t, command, ambient_m_s: (jet_m_s, jet_m_s), ..Tick::default() });
    }
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let columns = vec![
        ("current_cmd_a".into(), column(1)),
        ("neighbour_current".into(), column(2)),
        ("shaft_speed_rad_s".into(), column(3)),
        ("thrust_n".into(), column(4)),
    ];
    let log = Series { name: "jet".into(), time_s: column(0), columns };
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    let report = diagnose(&[log], &rig, &options, &|_| ()).unwrap().report;
    let names: Vec<&str> = report.findings.iter().map(|f| f.effect.as_str()).collect();
    assert_eq!(names, ["thrust_deduction_interaction"], "{}", report.summary);
    // 0.03 m/s an ampere, by standard deviation of the current.
    let flow = &report.findings[0].parameters[0];
    assert!((flow.value / (0.03 * 4.0) - 1.0).abs() < 0.15, "{flow:?}");
}
