//! Torque, shaft speed and thrust that no water brings together trip on every shipped rig with a propeller, and honest
//! ones do not: not on hard reversals, not in a stream from either side, not on fouled or aired blades, not with an inertia far
//! from the stated one.

mod common;

use common::{LOADS, Stand, Trial, dry, stands};
use kort_proto::faults::Fault;
use kort_proto::signals::Signals;
use kort_servo::water::Water;
use kort_thruster::rig::AmplifierKind;

const BOTH: [Fault; 2] = [Fault::SensorImplausible, Fault::ShaftSlow];
const STILL: Trial = Trial {
    wish: &|_| 0.6,
    inflow: 0.0,
    inertia: 1.0,
    shown: &|_, s| s,
    fault: Fault::SensorImplausible,
    until_s: 20.0,
    density: 1.0,
};

/// Rigs in water on a drive of this kind.
fn of_kind(kinds: &[AmplifierKind]) -> impl Iterator<Item = Stand> {
    stands().into_iter().filter(|s| s.rig.propeller.is_some() && kinds.contains(&s.rig.amplifier.kind))
}

#[test]
fn honest_sensors_trip_nothing() {
    for stand in stands().into_iter().chain(LOADS.map(dry)) {
        for fault in BOTH {
            for (inertia, density) in [(0.5, 1.0), (1.0, 1.4), (2.5, 1.0), (1.0, 0.05)] {
                for inflow in [-0.7, -0.4, 0.0, 0.4, 0.7] {
                    for half_period_s in [0.4, 1.5, 4.0] {
                        let level = |t: f64| {
                            if ((t / half_period_s) as u64).is_multiple_of(2) { 1.0 } else { -1.0 }
                        };
                        let trial =
                            Trial { wish: &level, inflow, inertia, density, fault, until_s: 9.0, ..STILL };
                        let who = format!(
                            "{}: every {half_period_s} s, {inflow}, {inertia}, {density}",
                            stand.name
                        );
                        assert_eq!(stand.trips_at(&trial), None, "{fault:?}, {who}");
                    }
                    let staircase = |t: f64| ((t / 3.0).floor() - 5.0).clamp(-5.0, 5.0) / 5.0;
                    let trial =
                        Trial { wish: &staircase, inflow, inertia, density, fault, until_s: 33.0, ..STILL };
                    let who = format!("{}: staircase, {inflow}, {inertia}, {density}", stand.name);
                    assert_eq!(stand.trips_at(&trial), None, "{fault:?}, {who}");
                }
            }
        }
    }
}

/// Reversed, in a wrong unit either way, or printing the same for ever while the thrust changes.
#[test]
fn a_thrust_that_contradicts_the_shaft_trips() {
    let changes = |t: f64| if t < 4.0 { 0.3 } else { 0.7 };
    let told = of_kind(&[AmplifierKind::Current, AmplifierKind::Voltage]);
    for stand in told.filter(|stand| stand.rig.sensors.thrust_sensor) {
        for (what, factor) in [("reversed", -1.0), ("kgf for N", 1.0 / 9.806_65), ("N for kgf", 9.806_65)] {
            let shown = move |_: f64, read: Signals| Signals { thrust_n: factor * read.thrust_n, ..read };
            let tripped = stand.trips_at(&Trial { shown: &shown, ..STILL });
            println!("{}, {what}: {tripped:?}", stand.name);
            assert!(tripped.is_some_and(|at| at > 2.0), "{}, {what}", stand.name);
        }
        let stuck_n = 0.3 * stand.limits.water.thrust_full_n();
        let frozen = move |t: f64, read: Signals| Signals {
            thrust_n: if t < 4.0 { read.thrust_n } else { stuck_n },
            ..read
        };
        let tripped = stand.trips_at(&Trial { wish: &changes, shown: &frozen, ..STILL });
        println!("{}, frozen: {tripped:?}", stand.name);
        assert!(tripped.is_some_and(|at| at > 6.0), "{}, frozen", stand.name);
    }
}

/// A speed that is told seven or three times too low, as with wrong pole pairs, where the stream is known to be a fifth of the
/// slipstream. Volts are held back by the current limit, which reckons with the speed: there it costs no thrust.
#[test]
fn a_shaft_that_is_too_slow_for_its_torque_trips() {
    for mut stand in of_kind(&[AmplifierKind::Current]) {
        let (current_a, speed_rad_s) = (stand.limits.current_a, stand.limits.speed_rad_s);
        let inflow_m_s = Some(0.2 * stand.slipstream_m_s);
        stand.limits.water = Water::of(&stand.rig, current_a, speed_rad_s, inflow_m_s);
        for factor in [1.0 / 7.0, 1.0 / 3.0] {
            let shown = move |_: f64, read: Signals| Signals {
                shaft_speed_rad_s: factor * read.shaft_speed_rad_s,
                shaft_angle_rad: factor * read.shaft_angle_rad,
                ..read
            };
            let fault = Fault::ShaftSlow;
            let tripped = stand.trips_at(&Trial { wish: &|_| 1.0, shown: &shown, fault, ..STILL });
            println!("{}, {factor}: {tripped:?}", stand.name);
            assert!(tripped.is_some_and(|at| at >= 1.0), "{}, {factor}", stand.name);
        }
    }
}
