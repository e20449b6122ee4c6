//! A lease that is taken again while the ramp of the one before runs.

use kort_proto::limits::Limit;
use kort_proto::messages::SetpointKind;

use super::{Bench, PERIOD};

const THRUST: u32 = SetpointKind::Thrust as u32;

/// Thrusting, with setpoints that take their time; its lease ended, and the ramp is half way.
fn ramping() -> Bench {
    let mut bench = Bench::thrusting();
    bench.setpoint.lease_until_ns = 0;
    // The gateway forgets the setpoint with the lease.
    let given_at_ns = bench.setpoint.given_at_ns;
    bench.give(SetpointKind::Zero as u32, 0.0);
    bench.setpoint.given_at_ns = given_at_ns;
    for _ in 0..50 {
        assert_eq!(bench.step().stop, 0);
    }
    bench
}

fn shown(bench: &Bench) -> (f64, bool) {
    let state = bench.tick.state();
    (state.setpoint_value, state.limits & Limit::LeaseRamp.bit() != 0)
}

#[test]
fn its_setpoint_goes_on_from_where_the_ramp_is_and_nothing_is_disarmed() {
    let mut bench = ramping();
    let rise_s = 1.0;
    bench.tick = std::mem::replace(&mut bench.tick, Bench::new().tick).with_rise(Some(rise_s));
    let (mut last, ramps) = shown(&bench);
    assert!(ramps && (20.0..30.0).contains(&last), "{last}");
    bench.setpoint.lease_until_ns = u64::MAX;
    bench.step();
    assert!(shown(&bench).1, "a lease alone asks for nothing");
    bench.give(THRUST, 40.0);
    (last, _) = shown(&bench);
    let most = bench.tick.controller().model().thrust_max_n / rise_s * PERIOD as f64 * 1e-9;
    for _ in 0..300 {
        assert_eq!(bench.step().stop, 0);
        let (now, ramps) = shown(&bench);
        assert!(!ramps && (now - last).abs() <= most * 1.001, "{last} to {now}");
        last = now;
    }
    assert_eq!(last, 40.0);
}

#[test]
fn without_a_setpoint_yet_the_drive_stays_armed_at_zero_and_the_old_one_does_not_come_back() {
    let mut bench = ramping();
    bench.setpoint.lease_until_ns = u64::MAX;
    for _ in 0..300 {
        assert_eq!(bench.step().stop, 0);
    }
    assert!(bench.armed);
    assert_eq!(shown(&bench), (0.0, false));
    bench.give(THRUST, 30.0);
    for _ in 0..50 {
        assert_eq!(bench.step().stop, 0);
    }
    assert_eq!(shown(&bench), (30.0, false));
}

#[test]
fn the_setpoint_that_ended_comes_back_by_no_renewal() {
    let mut bench = Bench::thrusting();
    bench.setpoint.lease_until_ns = 0;
    for _ in 0..10 {
        bench.step();
    }
    bench.setpoint.lease_until_ns = u64::MAX;
    let stopped = (0..300).any(|_| bench.step().stop != 0);
    assert!(stopped && !bench.armed);
}

#[test]
fn a_lease_that_ends_again_during_the_ramp_stops_in_the_end() {
    let mut bench = ramping();
    bench.setpoint.lease_until_ns = u64::MAX;
    bench.step();
    bench.setpoint.lease_until_ns = 0;
    assert!((0..100).any(|_| bench.step().stop != 0));
}

/// At zero there is no ramp, and the stop has its reason all the same: the gateway tells of it by that.
#[test]
fn at_zero_the_end_of_a_lease_stops_at_once_and_says_why() {
    for asked_zero in [true, false] {
        let mut bench = Bench::new();
        bench.arm();
        if asked_zero {
            bench.give(THRUST, 0.0);
        }
        for _ in 0..50 {
            assert_eq!(bench.step().stop, 0);
        }
        assert_eq!(shown(&bench), (0.0, false));
        bench.setpoint.lease_until_ns = 0;
        assert_ne!(bench.step().stop, 0);
        assert_eq!(shown(&bench), (0.0, true));
    }
}
