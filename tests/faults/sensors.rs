//! Sensors that lie: the simulated drive's own faults, from some seconds after the start on.

use std::cell::Cell;
use std::time::Duration;

use kort_proto::faults::Fault;

use crate::common::{Site, Stack, at_zero};
use crate::table::Table;

/// Silent, spiking, frozen and reversed sensors trip within their bound.
pub fn lying(table: &mut Table) {
    for (kind, fault, bound_ms) in [
        ("not_a_number", Fault::SensorNotFinite, 20),
        ("spikes", Fault::SensorSpike, 300),
        ("frozen", Fault::SensorFrozen, 600),
        // The loop runs away first, at the controller's pace.
        ("reversed", Fault::SensorReversed, 1000),
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
        let last_angle_rad = Cell::new(f64::NAN);
        // The first sample that lies is the fault's begin.
        let first = watch.until("the sensor to lie", |t| {
            t.time_ns > began_ns
                && match fault {
                    Fault::SensorNotFinite => t.signals.shaft_speed_rad_s.is_nan(),
                    Fault::SensorSpike => t.signals.shaft_speed_rad_s.abs() > 150.0,
                    Fault::SensorReversed => t.signals.shaft_speed_rad_s < 0.0,
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
