//! The metrics of a live stack: what an operator of months needs is there, and power and energy are what was measured.

mod common;

use std::collections::BTreeMap;

use common::{Stack, wait};
use kort_thruster::rig::Rig;

/// Samples by name and labels.
fn scrape(stack: &Stack) -> Option<BTreeMap<String, f64>> {
    let text = stack.text("/metrics")?;
    let samples = text.lines().filter(|line| !line.starts_with('#'));
    Some(
        samples
            .filter_map(|line| {
                line.rsplit_once(' ').and_then(|(name, value)| Some((name.into(), value.parse().ok()?)))
            })
            .collect(),
    )
}

/// What was missed before, one by one.
#[test]
fn every_metric_that_an_operator_of_months_needs_is_there() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(40.0, 60_000);
        let wanted = [
            r#"kort_process_restarts_total{thruster="t1",process="servo"}"#,
            r#"kort_process_cpu_seconds_total{thruster="t1",process="controller"}"#,
            r#"kort_process_resident_bytes{thruster="",process="gateway"}"#,
            r#"kort_http_request_duration_seconds_count{route="/v1/thrusters/{id}/setpoint"}"#,
            "kort_streams_open",
            "kort_events_unwritten",
            r#"kort_setpoint_age_seconds{thruster="t1"}"#,
            r#"kort_disk_free_bytes{disk="recordings"}"#,
            r#"kort_motor_power_watts{thruster="t1"}"#,
            r#"kort_motor_power_watts_max{thruster="t1"}"#,
            r#"kort_motor_energy_joules_total{thruster="t1",direction="taken"}"#,
            r#"kort_loop_busy_seconds{thruster="t1",process="servo"}"#,
            r#"kort_loop_busy_seconds{thruster="t1",process="controller"}"#,
            r#"kort_loop_busy_seconds{thruster="t1",process="gateway"}"#,
            r#"kort_recording_rows_total{thruster="t1"}"#,
            r#"kort_thrust_newtons_min{thruster="t1"}"#,
        ];
        let missing = || {
            let samples = scrape(&stack)?;
            let missing: Vec<&str> = wanted.into_iter().filter(|name| !samples.contains_key(*name)).collect();
            if missing.is_empty() {
                Some(())
            } else {
                println!("missing: {missing:?}");
                None
            }
        };
        wait("every metric", missing);
    });
}

/// Steady thrust: power is `kt i Om` of the shown current and speed, and energy grows by it.
#[test]
fn power_and_energy_are_those_of_current_and_speed() {
    common::in_real_time(|| {
        let mut stack = Stack::start();
        stack.thrust(60.0, 60_000);
        std::thread::sleep(std::time::Duration::from_secs(4));
        let rig = include_str!("../config/thrusters/whitcomb-yoerger-1999.toml");
        let motor = Rig::from_toml(rig).unwrap().motor;
        let samples = scrape(&stack).unwrap();
        let of = |name: &str| samples[&format!("kort_{name}{{thruster=\"t1\"}}")];
        let (current, speed) = (of("current_amperes"), of("shaft_speed_radians_per_second"));
        let loss_w = motor.winding_resistance_ohm.map_or(0.0, |r| r.value) * current * current;
        let power_w = motor.torque_constant_nm_a.value * current * speed + loss_w;
        let shown_w = of("motor_power_watts");
        assert!(
            power_w > 20.0 && (shown_w / power_w - 1.0).abs() < 0.1,
            "{shown_w} W shown, {power_w} W by {current} A, {speed} rad/s"
        );
        let taken = |samples: &BTreeMap<String, f64>| samples[r#"kort_motor_energy_joules_total{thruster="t1",direction="taken"}"#];
        let before_j = taken(&samples);
        let later_j = wait("energy to grow", || {
            let now_j = taken(&scrape(&stack)?);
            (now_j > before_j + 2.0 * power_w).then_some(now_j)
        });
        assert!(later_j > before_j);
    });
}
