//! The truth's sensors: encoder counts, speed filter, converter, log instants.

use std::f64::consts::TAU;

use kort_truth::chain::{Chain, ENCODER_COUNTS, SPEED_FILTER_S, TICK_S};
use kort_truth::dynamics::{At, Scale, State};
use kort_truth::hidden::Hidden;
use kort_truth::noise::Noise;
use kort_truth::rig::Class;
use kort_truth::stand::{Rows, Stand, TICKS_PER_ROW};
use kort_truth::thruster::Thruster;
use proptest::prelude::*;
use rand::SeedableRng;

const COUNT_RAD: f64 = TAU / ENCODER_COUNTS;
const UNIT: Scale = Scale { speed_rad_s: 1.0, flow_m_s: 1.0, thrust_n: 1.0, torque_n_m: 1.0 };
const FULL_SCALE_N: f64 = 890.0;

fn turned(angle_rad: f64) -> State {
    let mut state = State::rest();
    state.0[At::Angle as usize] = angle_rad;
    state
}

fn work_class() -> Thruster {
    Class::Work.specimen(&mut rand_chacha::ChaCha12Rng::seed_from_u64(1))
}

fn record(command_a: &[f64], noise: Noise, seed: u64) -> Rows {
    let (thruster, hidden) = (work_class(), Hidden::default());
    let stand = Stand {
        thruster: &thruster,
        hidden: &hidden,
        scale: UNIT,
        thrust_full_scale_n: FULL_SCALE_N,
        steps_per_tick: 10,
    };
    stand.record(command_a, noise, seed)
}

fn step_at(tick: usize, ticks: usize) -> Vec<f64> {
    (0..ticks).map(|i| if i < tick { 0.0 } else { 5.0 }).collect()
}

proptest! {
    #[test]
    fn angles_are_whole_counts_at_most_one_below_the_truth(angle in -1e4..1e4_f64) {
        let hidden = Hidden::default();
        let seen = Chain::new(&hidden, true).tick(&turned(angle), 0.0).angle_rad;
        prop_assert!((seen / COUNT_RAD - (seen / COUNT_RAD).round()).abs() < 1e-6);
        prop_assert!(seen <= angle + 1e-9 && angle - seen < COUNT_RAD + 1e-9);
    }

    #[test]
    fn the_speed_filter_is_first_order(speed in -100.0..100.0_f64) {
        let hidden = Hidden::default();
        let mut chain = Chain::new(&hidden, false);
        let mut seen = 0.0;
        for tick in 0..=10 {
            seen = chain.tick(&turned(speed * TICK_S * f64::from(tick)), 0.0).speed_rad_s;
        }
        let expected = speed * (1.0 - (-10.0 * TICK_S / SPEED_FILTER_S).exp());
        prop_assert!((seen - expected).abs() < 1e-9 * speed.abs().max(1.0), "{} of {}", seen, expected);
    }
}

#[test]
fn thrust_comes_in_steps_of_twelve_bits() {
    let rows = record(&step_at(0, 1500), Noise { thrust_n: 0.8, ..Noise::default() }, 3);
    let step = 2.0 * FULL_SCALE_N / 4096.0;
    assert!(rows.thrust_n.iter().all(|t| (t / step - (t / step).round()).abs() < 1e-6));
    assert!(rows.thrust_n.iter().any(|t| *t > 10.0 * step), "the thruster pushes");
}

#[test]
fn a_row_shows_the_command_that_starts_and_the_state_before_it_acts() {
    let edge = 50 * TICKS_PER_ROW;
    let rows = record(&step_at(edge, 600), Noise::default(), 1);
    assert_eq!((rows.command_a[49], rows.command_a[50]), (0.0, 5.0));
    assert!(rows.current_a[50].abs() < 1e-9, "the current has had no time: {}", rows.current_a[50]);
    // 10 ms later a lag of 2 ms has followed to 99.3 %.
    let share = rows.current_a[51] / 5.0;
    assert!((share - (1.0 - (-5.0_f64).exp())).abs() < 2e-3, "{share}");
    // An edge inside a log interval leaves less time: two ticks.
    let rows = record(&step_at(edge - 2, 600), Noise::default(), 1);
    let share = rows.current_a[50] / 5.0;
    assert!((share - (1.0 - (-2.0_f64).exp())).abs() < 5e-3, "{share}");
}

#[test]
fn seeds_change_the_noise_and_nothing_else() {
    let noise = Noise {
        thrust_n: 0.8,
        flow_m_s: 0.02,
        turbulence_m_s: 0.01,
        turbulence_time_s: 0.6,
        ..Noise::default()
    };
    let run = |seed| record(&step_at(100, 1000), noise, seed);
    assert!(run(5) == run(5));
    let (a, b) = (run(5), run(6));
    assert!(a.command_a == b.command_a && a.flow_m_s != b.flow_m_s && a.thrust_n != b.thrust_n);
    let quiet = record(&step_at(100, 1000), Noise::default(), 5);
    let spread = a.flow_m_s.iter().zip(&quiet.flow_m_s).map(|(x, y)| (x - y).powi(2)).sum::<f64>();
    let spread = (spread / a.flow_m_s.len() as f64).sqrt();
    assert!((0.01..0.05).contains(&spread), "{spread} m/s of 0.02 white and 0.01 turbulent");
}
