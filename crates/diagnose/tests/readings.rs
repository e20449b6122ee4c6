//! Two readings of a stand that are no physics of the thruster: thrust that a hull takes or a force sensor's gain makes, which
//! look alike, and a flow meter that holds its reading over rows with noise of their own.

mod common;

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::{Report, Verdict};
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{Flow, Rig};

use common::Draws;

const STAND: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
const TICK_S: f64 = 0.002;
const TICKS_A_ROW: u32 = 10;

/// The stand under levels of its current, logged at 50 Hz; of the thrust so much is shown, and the flow is read every so many
/// rows and held in between.
fn diagnosed(shown_of_thrust: f64, rows_a_reading: Option<u32>) -> Report {
    let mut rig = Rig::from_toml(STAND).unwrap();
    // Known blades in known water: rough ones take up what the thrust is short of.
    for known in rig.propeller.iter_mut().flat_map(|p| [&mut p.lift_max, &mut p.drag_max]) {
        known.tol = Some(0.01);
    }
    let Flow { density_kg_m3, flux_coefficient, added_mass_coefficient } = &mut rig.flow;
    for known in
        [density_kg_m3, flux_coefficient, added_mass_coefficient, &mut rig.motor.torque_constant_nm_a]
    {
        known.tol = None;
    }
    rig.sensors.flow_rate_hz = rows_a_reading.map(|rows| 50.0 / f64::from(rows));
    let mut plant = Plant::new(ModelName::Model2, &rig, &Parameters::stated(&rig), &[], TICK_S);
    let levels = [0.0, 4.0, -3.0, 6.0, 2.0, -5.0, 3.0];
    let (mut draws, mut held) = (Draws(5), 0.0);
    let mut rows: Vec<[f64; 5]> = Vec::new();
    for k in 0..20_000_u32 {
        let t = f64::from(k) * TICK_S;
        let command = levels[(t / 1.9) as usize % levels.len()];
        if k % TICKS_A_ROW == 0 {
            let shown = plant.sensed();
            if (k / TICKS_A_ROW).is_multiple_of(rows_a_reading.unwrap_or(1)) {
                held = plant.truth().axial_m_s;
            }
            let speed = shown.shaft_speed_rad_s + 0.05 * draws.next();
            let thrust = shown_of_thrust * shown.thrust_n + 0.3 * draws.next();
            rows.push([t, command, speed, thrust, held + 0.01 * draws.next()]);
        }
        plant.step(&Tick { time_s: t, command, ..Tick::default() });
    }
    let column = |i: usize| rows.iter().map(|row| row[i]).collect::<Vec<f64>>();
    let mut columns = vec![
        ("current_cmd_a".into(), column(1)),
        ("shaft_speed_rad_s".into(), column(2)),
        ("thrust_n".into(), column(3)),
    ];
    if rows_a_reading.is_some() {
        columns.push(("flow_m_s".into(), column(4)));
    }
    let log = Series { name: "stand".into(), time_s: column(0), columns };
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    diagnose(&[log], &rig, &options, &|_| ()).unwrap().report
}

#[test]
fn what_a_hull_takes_and_a_force_sensor_s_gain_are_rivals() {
    let report = diagnosed(0.85, None);
    let mut names: Vec<&str> = report.findings.iter().map(|f| f.effect.as_str()).collect();
    names.sort_unstable();
    assert_eq!(names, ["thrust_bias_gain_hysteresis", "thrust_deduction_interaction"], "{}", report.summary);
    assert_eq!(report.verdict, Verdict::Ambiguous, "{}", report.summary);
}

#[test]
fn a_meter_that_holds_its_reading_has_no_late_clock() {
    let report = diagnosed(1.0, Some(10));
    assert!(report.findings.is_empty(), "{}", report.summary);
    assert!(report.notes.iter().any(|note| note.contains("flow_m_s has a value in every row")));
}
