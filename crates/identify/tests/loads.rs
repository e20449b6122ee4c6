//! What hangs on a dry shaft is found within what the rig states of it.

use kort_identify::data::Series;
use kort_identify::hypothesis::Target;
use kort_identify::identify::{Options, identify};
use kort_identify::noise::Criterion;
use kort_identify::setup::Setup;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::plant::{Plant, Stimulus, Tick, simulate};
use kort_thruster::rig::Rig;

const CRITERION: Criterion =
    Criterion { form_error: 0.01, own_form_error: 0.1, facts_a_band: 100.0, timing_s: 0.001 };
const TICK_S: f64 = 0.002;

/// A geared servo under a voltage, with a load.
fn rig(load: &str) -> Rig {
    let text = format!(
        r#"
[rig]
name = "servo"
class = "geared servo"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = {{ value = 0.0015, tol = 0.1 }}
torque_constant_nm_a = 0.354
winding_resistance_ohm = 3.4
[amplifier]
kind = "voltage"
supply_v = 7.3
[sensors]
log_rate_hz = 100
[load]
{load}
"#
    );
    Rig::from_toml(&text).unwrap()
}

/// 20 s of voltage steps both ways, with these numbers for the load.
fn recording(rig: &Rig, truth: &[(P, f64)]) -> Series {
    let mut parameters = Parameters::stated(rig);
    truth.iter().for_each(|(parameter, value)| parameters.set(*parameter, *value));
    let levels = [0.0, 3.0, -2.0, 5.0, -5.0, 1.0, 4.0, -3.0];
    let ticks: Vec<Tick> = (0..10_000)
        .map(|k| {
            let time_s = f64::from(k) * TICK_S;
            Tick { time_s, command: levels[(time_s / 1.3) as usize % levels.len()], ..Tick::default() }
        })
        .collect();
    let logs: Vec<(usize, f64)> = (0..2000).map(|k| (5 * k, 0.0)).collect();
    let commands: Vec<f64> = logs.iter().map(|(tick, _)| ticks[*tick].command).collect();
    let time_s = logs.iter().map(|(tick, _)| *tick as f64 * TICK_S).collect();
    let mut plant = Plant::new(ModelName::Model2, rig, &parameters, &[], TICK_S);
    let rows = simulate(&mut plant, &Stimulus { ticks, logs }).rows;
    let column = |of: fn(&kort_thruster::plant::Sensed) -> f64| rows.iter().map(of).collect::<Vec<f64>>();
    Series {
        name: "steps".into(),
        time_s,
        columns: vec![
            ("voltage_cmd_v".into(), commands),
            ("shaft_speed_rad_s".into(), column(|s| s.shaft_speed_rad_s)),
            ("shaft_angle_rad".into(), column(|s| s.shaft_angle_rad)),
        ],
    }
}

/// The stated rig's fit of a recording of the true one: each number's value.
fn fitted(stated: &Rig, truth: &[(P, f64)], wanted: P) -> f64 {
    let options = Options {
        model: ModelName::Model2,
        seed: 1,
        starts: 1,
        open_friction: false,
        with: Vec::new(),
        criterion: CRITERION,
    };
    let report = identify(&[recording(stated, truth)], stated, &options, &|_| ()).unwrap();
    report.parameters.iter().find(|p| p.name == wanted.name()).unwrap().value
}

#[test]
fn a_pendulum_weighed_wrong_is_put_right_within_its_tolerance() {
    let stated = rig(r#"kind = "pendulum"
mass_kg = { value = 0.49, tol = 0.3 }
length_m = 0.10"#);
    let mass_kg = fitted(&stated, &[(P::LoadMassKg, 0.57)], P::LoadMassKg);
    assert!((mass_kg / 0.57 - 1.0).abs() < 0.02, "{mass_kg}");
}

#[test]
fn a_fan_and_a_second_inertia_are_too() {
    let stated = rig(r#"kind = "fan"
fan_coefficient_nm_s2 = { value = 0.0008, tol = 0.5 }"#);
    let fan = fitted(&stated, &[(P::FanCoefficientNmS2, 0.0011)], P::FanCoefficientNmS2);
    assert!((fan / 0.0011 - 1.0).abs() < 0.02, "{fan}");
    let stated = rig(r#"kind = "two_mass"
inertia_kg_m2 = { value = 0.004, tol = 0.4 }
stiffness_nm_rad = 2.0
damping_nm_s = 0.004"#);
    let inertia = fitted(&stated, &[(P::LoadInertiaKgM2, 0.005)], P::LoadInertiaKgM2);
    assert!((inertia / 0.005 - 1.0).abs() < 0.05, "{inertia}");
}

/// A servo whose drive and filter are stated roughly: largest current, its lag, filter of the speed.
fn rough_drive(tol: &str) -> Rig {
    let text = format!(
        "[propeller]\nkind = \"none\"\n[motor]\ninertia_kg_m2 = 0.0015\ntorque_constant_nm_a = 0.354\n\
         winding_resistance_ohm = 3.4\n[amplifier]\nkind = \"voltage\"\nsupply_v = 7.3\n\
         current_limit_a = {{ value = 1.2{tol} }}\ntime_constant_s = {{ value = 0.01{tol} }}\n\
         [sensors]\nlog_rate_hz = 100\nspeed_filter_time_constant_s = {{ value = 0.02{tol} }}\n"
    );
    Rig::from_toml(&text).unwrap()
}

#[test]
fn what_a_drive_and_its_speed_signal_are_stated_roughly_to_be_is_found() {
    let rough = rough_drive(", tol = 0.6");
    let truth = [(P::CurrentLimitA, 0.9), (P::TimeConstantS, 0.013), (P::SpeedFilterTimeConstantS, 0.03)];
    for (parameter, value) in truth {
        let found = fitted(&rough, &truth, parameter);
        assert!((found / value - 1.0).abs() < 0.1, "{}: {found}", parameter.name());
    }
}

#[test]
fn a_drive_stated_without_tolerance_is_taken_as_stated() {
    let exact = rough_drive("");
    let setup = Setup::new(&[recording(&exact, &[])], &exact, ModelName::Model2, CRITERION).unwrap();
    let free = |p: P| setup.baseline.free.iter().any(|f| f.target == Target::Base(p));
    assert!(![P::CurrentLimitA, P::TimeConstantS, P::SpeedFilterTimeConstantS].into_iter().any(free));
}

#[test]
fn a_load_stated_without_tolerance_is_taken_as_stated() {
    let exact = rig(r#"kind = "pendulum"
mass_kg = 0.49
length_m = { value = 0.10, tol = 0.02 }"#);
    let series = [recording(&exact, &[])];
    let setup = Setup::new(&series, &exact, ModelName::Model2, CRITERION).unwrap();
    let free = |p: P| setup.baseline.free.iter().find(|f| f.target == Target::Base(p));
    assert!(free(P::LoadMassKg).is_none());
    let length = free(P::LoadLengthM).unwrap();
    assert!((length.mean - 0.10).abs() < 1e-12 && (length.sigma - 0.001).abs() < 1e-12, "{length:?}");
}
