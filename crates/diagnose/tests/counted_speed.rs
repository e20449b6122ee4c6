//! A speed that the drive counts over its control period, in a log whose stamps scatter: nothing is late.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::Verdict;
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = r#"
[rig]
name = "geared motor, 100 Hz"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 8.6e-4, tol = 0.5 }
torque_constant_nm_a = { value = 0.26, tol = 0.1 }
viscous_friction_nm_s = { value = 1.1e-3, tol = 0.6 }
winding_resistance_ohm = { value = 2.4, tol = 0.3 }
[amplifier]
kind = "voltage"
current_limit_a = 8
supply_v = 12
[sensors]
log_rate_hz = 100
control_rate_hz = 100
encoder_counts_per_rev = 1200
"#;

const PERIODS: usize = 2000;
const PERIOD_S: f64 = 0.01;
const FINE: usize = 100;
const COUNT_RAD: f64 = std::f64::consts::TAU / 1200.0;

/// The motor under levels of voltage; its drive shows counts over each period, and a logger stamps them up to 2 ms late.
fn recording() -> Series {
    let mut seed = 7_u64;
    let mut draw = || {
        seed = seed.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (seed >> 33) as f64 / f64::from(1_u32 << 31)
    };
    let (mut speed, mut angle, mut counted) = (0.0_f64, 0.0_f64, 0.0_f64);
    let (mut volt, mut held) = (0.0, 0);
    let (mut time_s, mut command, mut shown) = (Vec::new(), Vec::new(), Vec::new());
    for period in 0..PERIODS {
        if held == 0 {
            volt = 22.0 * draw() - 11.0;
            held = [20, 40, 80, 160][(4.0 * draw()) as usize];
        }
        held -= 1;
        let counts = (angle / COUNT_RAD).floor();
        time_s.push(period as f64 * PERIOD_S + 0.002 * draw());
        command.push(volt);
        shown.push((counts - counted) * COUNT_RAD / PERIOD_S);
        counted = counts;
        for _ in 0..FINE {
            let dt = PERIOD_S / FINE as f64;
            let current = ((volt - 0.25 * speed) / 2.2).clamp(-8.0, 8.0);
            speed += (0.25 * current - 8e-4 * speed) / 8e-4 * dt;
            angle += speed * dt;
        }
    }
    let columns = vec![("voltage_cmd_v".into(), command), ("shaft_speed_rad_s".into(), shown)];
    Series { name: "counted".into(), time_s, columns }
}

/// A control period is several steps of the simulation here: counted over one of them only, the model's speed was 4 ms ahead
/// of the drive's, which passed for a delay, a lag or a filter.
#[test]
fn a_speed_counted_over_the_control_period_is_not_late() {
    let rig = Rig::from_toml(RIG).unwrap();
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    let report = diagnose(&[recording()], &rig, &options, &|_| ()).unwrap().report;
    assert!(report.findings.is_empty(), "{}", report.summary);
    assert_eq!(report.verdict, Verdict::NoMismatch, "{}", report.summary);
}
