//! Dry friction sticks, breaks away and slows as the equation says.

use kort_thruster::dual::Dual;
use kort_thruster::effects::find;
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Course, Plant, Tick};

use crate::{dry, plant};

const TICK_S: f64 = 0.002;
const INERTIA: f64 = 0.01;
/// Without a rise near rest: level, rise, Stribeck speed.
const PLAIN: [f64; 3] = [0.2, 0.0, 1.0];

fn torque(torque_n_m: f64, k: usize, course: Course) -> Tick {
    Tick { time_s: k as f64 * TICK_S, command: torque_n_m, course, ..Tick::default() }
}

/// Shaft speed and angle at every tick's end.
fn run(course: Course, from_rad_s: f64, torque_n_m: impl Fn(usize) -> f64, ticks: usize) -> Vec<(f64, f64)> {
    let mut plant = plant(&dry(), &[("coulomb_friction", &PLAIN)], TICK_S);
    plant.start(0.0, from_rad_s, 0.0, torque_n_m(0), 0.0);
    (0..ticks)
        .map(|k| {
            plant.step(&torque(torque_n_m(k), k, course));
            (plant.truth().shaft_speed_rad_s, plant.truth().shaft_angle_rad)
        })
        .collect()
}

#[test]
fn a_coast_down_is_a_straight_line_to_rest() {
    for course in [Course::Any, Course::Smooth, Course::Calm] {
        let seen = run(course, 10.0, |_| 0.0, 400);
        for (k, (speed, angle)) in seen.iter().enumerate() {
            // 20 rad/s^2 for half a second.
            let t = ((k + 1) as f64 * TICK_S).min(0.5);
            assert!((speed - (10.0 - 20.0 * t)).abs() < 1e-9, "{course:?} {k}: {speed}");
            assert!((angle - (10.0 * t - 10.0 * t * t)).abs() < 0.01, "{course:?} {k}: {angle}");
        }
        assert_eq!(seen[399].0, 0.0);
        assert_eq!(seen[399].1, seen[300].1, "the angle drifts at rest");
    }
}

/// The usual stand-in, a steep tanh, integrated finely: what the exact law goes over into.
fn steep(torque_n_m: impl Fn(f64) -> f64, end_s: f64) -> Vec<f64> {
    let (fine_s, eps) = (2e-6, 1e-3);
    let steps = (TICK_S / fine_s).round() as usize;
    let mut speed = 0.0_f64;
    (0..(end_s / TICK_S).round() as usize)
        .map(|k| {
            for j in 0..steps {
                let t = k as f64 * TICK_S + j as f64 * fine_s;
                speed += fine_s / INERTIA * (torque_n_m(t) - PLAIN[0] * (speed / eps).tanh());
            }
            speed
        })
        .collect()
}

#[test]
fn agrees_with_a_steep_tanh_through_reversals() {
    let wave = |t: f64| 0.5 * (std::f64::consts::TAU * 2.0 * t).sin();
    let fine = steep(wave, 1.5);
    // A command is held over its tick: compare with the middle of it.
    let ours = run(Course::Any, 0.0, |k| wave((k as f64 + 0.5) * TICK_S), 750);
    let top = fine.iter().fold(0.0_f64, |m, v| m.max(v.abs()));
    assert!(top > 2.0, "{top}");
    for (k, (a, (b, _))) in fine.iter().zip(&ours).enumerate() {
        assert!((a - b).abs() < 0.01 * top, "{k}: {a} {b}");
    }
}

#[test]
fn below_the_friction_nothing_moves_and_above_it_all_of_the_rest_does() {
    for sign in [1.0, -1.0] {
        let held = run(Course::Any, 0.0, |_| sign * 0.199, 200);
        assert!(held.iter().all(|s| *s == (0.0, 0.0)), "{:?}", held[199]);
        let free = run(Course::Any, 0.0, |_| sign * 0.25, 200);
        assert!((free[199].0 - sign * 0.05 / INERTIA * 0.4).abs() < 1e-9, "{:?}", free[199]);
    }
}

#[test]
fn a_rise_near_rest_holds_more_than_it_slows() {
    let mut plant = plant(&dry(), &[("coulomb_friction", &[0.2, 0.5, 1.0])], TICK_S);
    let mut speed = |torque_n_m: f64| {
        (0..500).for_each(|k| plant.step(&torque(torque_n_m, k, Course::Any)));
        plant.truth().shaft_speed_rad_s
    };
    assert_eq!(speed(0.29), 0.0);
    assert!(speed(0.31) > 1.0);
    // Once it turns, a torque that could not have started it keeps it going.
    let before = speed(0.21);
    assert!(speed(0.21) > before);
}

#[test]
fn friction_never_adds_energy() {
    let mut plant = plant(&dry(), &[("coulomb_friction", &[0.3, 1.0, 2.0])], TICK_S);
    plant.start(0.0, -7.0, 0.0, 0.0, 0.0);
    let mut last = 7.0;
    for k in 0..400 {
        plant.step(&torque(0.0, k, Course::Any));
        let size = plant.truth().shaft_speed_rad_s.abs();
        assert!(size <= last, "{k}");
        last = size;
    }
    assert_eq!(last, 0.0);
}

#[test]
fn the_slope_by_the_level_is_that_of_the_branch() {
    let run = |torque_n_m: f64| {
        let rig = dry();
        let parameters = Parameters::<Dual>::lift(&Parameters::stated(&rig));
        let values = [Dual::parameter(0.2, 0), Dual::from(0.0), Dual::from(1.0)];
        let friction = find("coulomb_friction").unwrap();
        let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &[(friction, &values)], TICK_S);
        (0..100).for_each(|k| plant.step(&torque(torque_n_m, k, Course::Any)));
        plant.truth().shaft_speed_rad_s.slopes()[0]
    };
    assert_eq!(run(0.1), 0.0, "held");
    assert!((run(0.5) + 0.2 / INERTIA).abs() < 1e-9, "turning: 0.2 s of deceleration");
}
