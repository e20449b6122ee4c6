//! Sensors that lie: the simulated drive's own faults, from some seconds after the start on.

use std::cell::Cell;
use std::time::Duration;

use kort_proto::faults::Fault;

use crate::common::{Site, Stack, at_zero};
use crate::table::Table;

/// Frozen, spiking and silent sensors trip within their bound; a reversed one stays within the drive's limits.
pub fn lying(table: &mut Table) {
    for (kind, fault, bound_ms) in [
        ("not_a_number", Some(Fault::SensorNotFinite), 20),
        ("spikes", Some(Fault::SensorSpike), 300),
        ("frozen", Some(Fault::SensorFrozen), 600),
        ("reversed", None, 0),
    ] {
        let site = Site::new();
        site.add(
            "[thrusters.t1]",
            &format!("simulation = {{ sensor_fault = \"{kind}\", sensor_fault_after_s = 6.0 }}"),
        );
        let mut stack = Stack::start_at(site);
        let mut watch = stack.watch();
        stack.thrust(80.0, 60_000);
        let began_ns = stack.watch().next().time_ns;
        let Some(fault) = fault else {
            let end_ns = began_ns + 8_000_000_000;
            let mut worst = 0.0f64;
            loop {
                let t = watch.next();
                worst = worst.max(t.signals.current_a.abs());
                if t.time_ns > end_ns || at_zero(&t) && t.time_ns > began_ns {
                    break;
                }
            }
            // 9 A is the rig's limit, and a quarter more trips.
            let what = "motor current stays below its trip level, or it trips";
            table.quantity("shaft sensor: reversed", what, "A", 11.25, worst);
            continue;
        };
        let last_angle_rad = Cell::new(f64::NAN);
        // The first sample that lies is the fault's begin.
        let first = watch.until("the sensor to lie", |t| {
            t.time_ns > began_ns
                && match fault {
                    Fault::SensorNotFinite => t.signals.shaft_speed_rad_s.is_nan(),
                    Fault::SensorSpike => t.signals.shaft_speed_rad_s.abs() > 150.0,
                    _ => last_angle_rad.replace(t.signals.shaft_angle_rad) == t.signals.shaft_angle_rad,
                }
        });
        let zero = watch.until("zero", at_zero);
        assert_ne!(zero.faults & fault.bit(), 0, "{kind}: {zero:?}");
        table.row(
            format!("shaft sensor: {}", kind.replace('_', " ")),
            "zero torque, fault latched",
            Duration::from_millis(bound_ms),
            &[Duration::from_nanos(zero.time_ns - first.time_ns)],
        );
    }
}
