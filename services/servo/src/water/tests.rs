//! What the rules say of single numbers; `tests/agreement.rs` has whole thrusters.

use super::*;
use crate::guard::tests::limits;

const RIG: &str = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");

fn of_the_stand() -> Limits {
    let rig = Rig::from_toml(RIG).unwrap();
    Limits { winding: (f64::NAN, 1.23), water: Water::of(&rig, 9.0, f64::INFINITY, None), ..limits() }
}

#[test]
fn full_speed_is_known_without_a_limit() {
    let rig = Rig::from_toml(RIG).unwrap();
    let full = full_speed_rad_s(&rig, rig.amplifier.current_limit_a);
    // 11 N m on the blades; 120 V over 1.23 V s are 97.6 rad/s.
    assert!((60.0..97.6).contains(&full), "{full}");
    assert_eq!(full_speed_rad_s(&rig, 1e9), 120.0 / 1.23, "the supply ends it");
}

#[test]
fn a_shaft_with_a_seventh_of_its_speed_is_slow_after_a_second_and_one_in_a_crash_stop_is_not() {
    let l = of_the_stand();
    let trips_at = |speed: f64, current: f64| {
        let mut agreement = Agreement::default();
        (1..5000).find(|_| agreement.is_slow(&l, speed, current, 1e-3))
    };
    let full = l.water.speed_full_rad_s;
    assert!(trips_at(full / 7.0, 9.0).is_some_and(|ms| (1000..1500).contains(&ms)));
    assert_eq!(trips_at(full, 9.0), None);
    assert_eq!(trips_at(full / 7.0, 1.0), None, "a stream holds it so");
    assert_eq!(trips_at(-full / 7.0, 9.0), None, "it turns round");
    assert!(!Agreement::default().is_slow(&limits(), 1.0, 9.0, 60.0), "no propeller");
}

#[test]
fn a_thrust_is_held_against_torque_and_speed_together() {
    let l = of_the_stand();
    let w = l.water;
    let at = |share: f64| {
        let speed = share.sqrt() * w.speed_full_rad_s;
        (speed, w.torque_n_m_s2 * speed * speed / 1.23, w.thrust_n_s2 * speed * speed)
    };
    let trips_at = |speed: f64, current: f64, thrust: &dyn Fn(u32) -> f64| {
        let mut agreement = Agreement::default();
        (1..9000).find(|ms| {
            // A reading every twentieth tick.
            let thrust = if ms % 20 == 0 { thrust(*ms) } else { f64::NAN };
            agreement.is_implausible(&l, speed, current, thrust, 1e-3)
        })
    };
    let (speed, current, thrust) = at(0.25);
    for factor in [-1.0, 0.0, 0.3, 3.1] {
        let tripped = trips_at(speed, current, &|ms| factor * thrust + f64::from(ms) * 1e-6);
        assert!(tripped.is_some_and(|ms| (2000..3500).contains(&ms)), "{factor}: {tripped:?}");
    }
    for factor in [0.4, 1.0, 2.5] {
        assert_eq!(trips_at(speed, current, &|_| factor * thrust), None, "{factor}");
    }
    // Towed: it turns with little torque, and may push either way. One that brakes likewise.
    assert_eq!(trips_at(speed, 0.6 * current, &|_| -thrust), None);
    assert_eq!(trips_at(speed, -current, &|_| -thrust), None);
    // Pole pairs that are wrong are no fault of the cell's.
    assert_eq!(trips_at(speed / 7.0, current, &|_| thrust), None);
    let (speed, current, thrust) = at(0.08);
    assert_eq!(trips_at(speed, current, &|_| -thrust), None, "its zero may be off by that");
}

/// What a cell said before it fell silent is not held against the shaft for ever: it can be cleared.
#[test]
fn silence_says_nothing() {
    let l = of_the_stand();
    let mut agreement = Agreement::default();
    let (speed, current) = (l.water.speed_full_rad_s, 9.0);
    for _ in 0..4000 {
        agreement.is_implausible(&l, speed, current, -170.0, 1e-3);
    }
    assert!(agreement.is_implausible(&l, speed, current, f64::NAN, 1e-3));
    for _ in 0..600 {
        agreement.is_implausible(&l, 0.0, 0.0, f64::NAN, 1e-3);
    }
    assert!(!agreement.is_implausible(&l, 0.0, 0.0, f64::NAN, 1e-3));
}
