//! Model 2 steps per second on one core, beside the `ode_solvers` crate's classic Runge-Kutta at
//! the same step and so the same accuracy (the difference of both end states is printed).
//!
//! One trajectory is bound by the time a root and a product take one after the other; several, as
//! the starts of a fit or the runs of an ensemble, integrated as one state, fill the core.
//!
//! `cargo bench -p kort-thruster --bench steps`

use std::hint::black_box;
use std::time::Instant;

use kort_thruster::integrate::rk4;
use kort_thruster::models::{DriveInput, Model, Model2};
use kort_thruster::parameters::Parameters;
use kort_thruster::rig::Rig;
use ode_solvers::{Rk4, SVector, System};

const STEP_S: f64 = 1e-3;
const STEPS: usize = 100_000;
const ROUNDS: usize = 15;
/// Trajectories integrated as one state.
const SIDE_BY_SIDE: usize = 8;

/// Rates of `N / 2` trajectories: the shaft speeds first, then the axial flows.
#[inline(always)]
fn rates<const N: usize>(model: &Model2, input: &DriveInput, x: &[f64; N]) -> [f64; N] {
    let mut rates = [0.0; N];
    for i in 0..N / 2 {
        [rates[i], rates[N / 2 + i]] = model.rates(&[x[i], x[N / 2 + i]], input);
    }
    rates
}

fn ours<const N: usize>(model: &Model2, input: &DriveInput) -> [f64; N] {
    (0..STEPS).fold([0.0; N], |x, _| rk4(x, 0.0, STEP_S, |_, x| rates(model, input, x)))
}

struct Theirs(Model2, DriveInput);

impl<const N: usize> System<f64, SVector<f64, N>> for Theirs {
    fn system(&self, _: f64, x: &SVector<f64, N>, dx: &mut SVector<f64, N>) {
        *dx = rates(&self.0, &self.1, &x.data.0[0]).into();
    }
}

fn theirs<const N: usize>(model: &Model2, input: &DriveInput) -> [f64; N] {
    let end_s = STEPS as f64 * STEP_S;
    let mut solver = Rk4::new(Theirs(*model, *input), 0.0, SVector::<f64, N>::zeros(), end_s, STEP_S);
    solver.integrate().expect("a fixed step does not fail");
    (*solver.y_out().last().expect("at least the start")).into()
}

/// Best rate of several runs, million steps/s: what the core can do when nothing else asks for it.
fn best<const N: usize>(run: impl Fn() -> [f64; N]) -> (f64, [f64; N]) {
    let mut end = [0.0; N];
    let rate = (0..ROUNDS)
        .map(|_| {
            let start = Instant::now();
            end = black_box(run());
            (STEPS * N / 2) as f64 / start.elapsed().as_secs_f64()
        })
        .fold(0.0, f64::max);
    (rate / 1e6, end)
}

fn compare<const N: usize>(model: &Model2, input: &DriveInput) {
    let (ours, our_end) = best(|| ours::<N>(black_box(model), input));
    let (theirs, their_end) = best(|| theirs::<N>(black_box(model), input));
    let apart = our_end.iter().zip(their_end).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!(
        "  {} at once   kort {ours:7.2}   ode_solvers {theirs:7.2}   ratio {:5.2}   end states {apart:.1e} apart",
        N / 2,
        ours / theirs
    );
}

fn main() {
    let rig = Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml"))
        .expect("the shipped rig");
    let model = Model2::new(&Parameters::stated(&rig));
    let input = DriveInput::torque(9.2);
    println!("model 2, Runge-Kutta of order 4, step {STEP_S} s, one core, million steps/s");
    compare::<2>(&model, &input);
    compare::<{ 2 * SIDE_BY_SIDE }>(&model, &input);
}
