//! Healthy motors in logs that are slower than what they log, or faster: neither is physics.

use kort_diagnose::diagnose::{Options, diagnose};
use kort_diagnose::report::Verdict;
use kort_identify::data::Series;
use kort_thruster::models::ModelName;
use kort_thruster::rig::Rig;

const RIG: &str = r#"
[rig]
name = "motor under current"
[propeller]
kind = "none"
[motor]
inertia_kg_m2 = { value = 2.2e-3, tol = 0.2 }
torque_constant_nm_a = { value = 0.48, tol = 0.1 }
viscous_friction_nm_s = { value = 0.022, tol = 0.3 }
[amplifier]
kind = "current"
current_limit_a = 8
[sensors]
log_rate_hz = 100
control_rate_hz = 1000
"#;

const ROWS: usize = 2500;
const TICKS: usize = 10;
const TICK_S: f64 = 0.001;
const FINE: usize = 10;
const LIMIT_A: f64 = 8.0;

struct Draws(u64);

impl Draws {
    fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
    }
}

/// The motor at a log of 100 Hz under what its drive does at 1 kHz, from the speed and a level that changes on any tick:
/// current and speed by row.
fn run(drive: impl Fn(f64, f64) -> f64) -> (Vec<f64>, Vec<f64>) {
    let mut draws = Draws(11);
    let (mut speed, mut level, mut ticks_left) = (0.0_f64, 0.0, 0);
    let (mut currents, mut speeds) = (Vec::new(), Vec::new());
    for tick in 0..ROWS * TICKS {
        if ticks_left == 0 {
            level = 2.0 * draws.next() - 1.0;
            ticks_left = 150 + (600.0 * draws.next()) as usize;
        }
        ticks_left -= 1;
        let current = drive(level, speed).clamp(-LIMIT_A, LIMIT_A);
        if tick.is_multiple_of(TICKS) {
            currents.push(current + 0.02 * (draws.next() - 0.5));
            speeds.push(speed + 0.2 * (draws.next() - 0.5));
        }
        for _ in 0..FINE {
            speed += (0.5 * current - 0.02 * speed) / 2e-3 * (TICK_S / FINE as f64);
        }
    }
    (currents, speeds)
}

fn assert_nothing_is_missed(column: &str, current: Vec<f64>, speed: Vec<f64>) {
    let time_s = (0..ROWS).map(|row| (row * TICKS) as f64 * TICK_S).collect();
    let columns = vec![(column.into(), current), ("shaft_speed_rad_s".into(), speed)];
    let series = Series { name: "log".into(), time_s, columns };
    let options = Options { model: ModelName::Model2, seed: 1, with: Vec::new() };
    let report = diagnose(&[series], &Rig::from_toml(RIG).unwrap(), &options, &|_| ()).unwrap().report;
    assert!(report.findings.is_empty(), "{}", report.summary);
    assert_eq!(report.verdict, Verdict::NoMismatch, "{}", report.summary);
    let error = report.baseline.channels["shaft_speed_rad_s"].nrmse_train;
    assert!(error < 0.01, "{error}");
}

/// At a step of its set-point the loop's current jumps to the limit between two rows, and is on its way back when the next
/// shows it.
#[test]
fn a_speed_loop_faster_than_its_log_hides_nothing() {
    let (current, speed) = run(|level, speed| 0.25 * (60.0 * level - speed));
    assert_nothing_is_missed("current_a", current, speed);
}

/// A tachometer read at 20 Hz, whose last sample a logger writes again at every row.
#[test]
fn samples_that_a_logger_repeats_are_no_lag() {
    let (current, speed) = run(|level, _| 2.0 * level);
    let repeated = (0..ROWS).map(|row| speed[row / 5 * 5]).collect();
    assert_nothing_is_missed("current_cmd_a", current, repeated);
}
