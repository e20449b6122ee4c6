//! A shaft sensor that counts the wrong way round trips on every shipped rig and on dry ones, and an honest one does not:
//! not on hard reversals, not on a propeller that a stream turns, not with an inertia far from the stated one.

mod common;

use common::{LOADS, Trial, dry, stands};
use kort_proto::faults::Fault;
use kort_proto::signals::Signals;

/// From then on the sensor counts the other way.
fn reversed(from_s: f64) -> impl Fn(f64, Signals) -> Signals {
    move |time_s, read| {
        let sign = if time_s >= from_s { -1.0 } else { 1.0 };
        let (speed, angle) = (sign * read.shaft_speed_rad_s, sign * read.shaft_angle_rad);
        Signals { shaft_speed_rad_s: speed, shaft_angle_rad: angle, ..read }
    }
}

#[test]
fn an_honest_sensor_trips_nothing() {
    for stand in stands().into_iter().chain(LOADS.map(dry)) {
        for inertia in [0.5, 1.0, 2.5] {
            for inflow in [-0.7, -0.4, 0.0, 0.4, 0.7] {
                for half_period_s in [0.1, 0.4, 1.5] {
                    for level in [1.0, 0.5] {
                        let reversals = |t: f64| {
                            if ((t / half_period_s) as u64).is_multiple_of(2) { level } else { -level }
                        };
                        let trial = Trial {
                            wish: &reversals,
                            inflow,
                            inertia,
                            shown: &|_, s| s,
                            fault: Fault::SensorReversed,
                            density: 1.0,
                            until_s: 6.0,
                        };
                        let tripped = stand.trips_at(&trial);
                        assert_eq!(
                            tripped, None,
                            "{}: reversals of {level} every {half_period_s} s, inflow {inflow}, inertia {inertia}",
                            stand.name
                        );
                    }
                }
                // A stream turns the propeller, and the motor brakes or drives it at every level.
                let staircase = |t: f64| ((t / 1.5).floor() - 10.0).clamp(-10.0, 10.0) / 10.0;
                let trial = Trial {
                    wish: &staircase,
                    inflow,
                    inertia,
                    shown: &|_, s| s,
                    fault: Fault::SensorReversed,
                    density: 1.0,
                    until_s: 31.5,
                };
                let tripped = stand.trips_at(&trial);
                assert_eq!(tripped, None, "{}: staircase, inflow {inflow}, inertia {inertia}", stand.name);
            }
        }
    }
}

/// Nothing drives a dry shaft but the motor: a reversed sensor shows at any drive that turns it round.
#[test]
fn a_reversed_sensor_on_a_dry_shaft_trips_at_a_thirtieth_of_full_drive_too() {
    for load in LOADS {
        let stand = dry(load);
        let swings = load.contains("pendulum");
        for level in [1.0, -1.0, 1.0 / 30.0] {
            let trial = Trial {
                wish: &|_| level,
                inflow: 0.0,
                inertia: 1.0,
                shown: &reversed(3.0),
                fault: Fault::SensorReversed,
                density: 1.0,
                until_s: 12.0,
            };
            let tripped = stand.trips_at(&trial);
            println!("{load}, level {level}: {tripped:?}");
            // A weight that the motor only lifts a little does not turn round: it hangs still, and shows nothing.
            assert!(
                tripped.is_some_and(|at| at >= 3.0) || (swings && level.abs() < 0.5),
                "{load}, level {level}"
            );
        }
    }
}

#[test]
fn a_reversed_sensor_trips() {
    for stand in stands() {
        for inflow in [0.0, 0.4] {
            for level in [1.0, -1.0] {
                // From the start, as wired wrongly, and under way.
                for reversed_s in [0.0, 3.0] {
                    let inertia = 1.0;
                    let trial = Trial {
                        wish: &|_| level,
                        inflow,
                        inertia,
                        shown: &reversed(reversed_s),
                        fault: Fault::SensorReversed,
                        density: 1.0,
                        until_s: reversed_s + 6.0,
                    };
                    let tripped = stand.trips_at(&trial);
                    println!(
                        "{}: level {level}, inflow {inflow}, reversed at {reversed_s} s: {tripped:?}",
                        stand.name
                    );
                    assert!(
                        tripped.is_some_and(|at| at >= reversed_s),
                        "{}: level {level}, inflow {inflow}, from {reversed_s} s",
                        stand.name
                    );
                }
            }
        }
    }
}
