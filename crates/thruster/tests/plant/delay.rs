//! A delay moves the response smoothly, so that a fit finds it from any side.

use kort_thruster::dual::Dual;
use kort_thruster::effects::{Descriptor, find};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::Parameters;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::real::Real;

use crate::dry;

const TICK_S: f64 = 0.005;

/// Shaft speed after each tick of a command that jumps on ticks, delayed; or shown late by a skewed clock.
fn run<T: Real>(effect: &Descriptor, values: &[T]) -> Vec<T> {
    let rig = dry();
    let parameters = Parameters::<T>::lift(&Parameters::stated(&rig));
    let friction = [T::from(0.05)];
    let viscous = find("viscous_friction").unwrap();
    let effects: [(&Descriptor, &[T]); 2] = [(effect, values), (viscous, &friction)];
    let mut plant = Plant::new(ModelName::Model2, &rig, &parameters, &effects, TICK_S);
    (0..400)
        .map(|k| {
            let command = [0.0, 1.0, -0.6, 0.8][k / 100];
            plant.step(&Tick { time_s: k as f64 * TICK_S, command, ..Tick::default() });
            plant.sensed().shaft_speed_rad_s
        })
        .collect()
}

/// The effect with a delay at the place that acts on shaft speed.
fn with<T: Real>(id: &str, delay_s: T) -> (&'static Descriptor, Vec<T>) {
    let effect = find(id).unwrap();
    match id {
        "clock_skew" => (effect, vec![T::ZERO, delay_s, T::ZERO, T::ZERO, T::ZERO]),
        _ => (effect, vec![delay_s]),
    }
}

fn speeds(id: &str, delay_s: f64) -> Vec<f64> {
    let (effect, values) = with(id, delay_s);
    run(effect, &values)
}

fn distance(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn the_derivative_exists_within_ticks_and_hardly_turns_between_them() {
    for id in ["transport_delay", "clock_skew"] {
        for ticks in [3.0, 3.4, 4.0, 7.5] {
            let delay_s = ticks * TICK_S;
            let (effect, values) = with(id, Dual::parameter(delay_s, 0));
            let slope: Vec<f64> = run(effect, &values).iter().map(|d| d.slopes()[0]).collect();
            let h = 1e-6;
            let (here, up, down) = (speeds(id, delay_s), speeds(id, delay_s + h), speeds(id, delay_s - h));
            for (side, step) in [(&up, h), (&down, -h)] {
                let difference: Vec<f64> = here.iter().zip(side).map(|(a, b)| (b - a) / step).collect();
                let share = distance(&slope, &difference) / distance(&difference, &vec![0.0; 400]);
                // What turns is the one tick of each jump.
                assert!(share < 0.3, "{id} at {ticks} ticks: {share}");
            }
        }
    }
}

#[test]
fn the_misfit_falls_all_the_way_to_the_true_delay() {
    for id in ["transport_delay", "clock_skew"] {
        let truth = speeds(id, 6.3 * TICK_S);
        let misfit = |ticks: f64| distance(&speeds(id, ticks * TICK_S), &truth);
        let mut last = misfit(0.0);
        for k in 1..=63 {
            let now = misfit(0.1 * f64::from(k));
            assert!(now < last, "{id} at {} ticks", 0.1 * f64::from(k));
            last = now;
        }
        assert!(last < 1e-9 && misfit(6.4) > last);
    }
}
