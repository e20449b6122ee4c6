//! Model 2 steps per second on one core, beside the `ode_solvers` crate's classic Runge-Kutta at
//! the same step and so the same accuracy (the difference of both end states is printed).
//!
//! `cargo bench -p kort-thruster --bench steps`

use std::hint::black_box;
use std::time::Instant;

use kort_thruster::models::{DriveInput, Model, Model2, ShaftFlowState};
use kort_thruster::parameters::Parameters;
use kort_thruster::rig::Rig;
use ode_solvers::{Rk4, SVector, System};

const STEP_S: f64 = 1e-3;
const STEPS: usize = 100_000;
/// Trajectories side by side in the ensemble, as starts of a fit are.
const SIDE_BY_SIDE: usize = 8;

struct Theirs(Model2, DriveInput);

impl System<f64, SVector<f64, 2>> for Theirs {
    fn system(&self, _: f64, x: &SVector<f64, 2>, dx: &mut SVector<f64, 2>) {
        let [speed, flow] = self.0.rates(&[x[0], x[1]], &self.1);
        dx[0] = speed;
        dx[1] = flow;
    }
}

/// Best of several runs, steps per second: what the core can do when nothing else asks for it.
fn best(steps: usize, mut run: impl FnMut()) -> f64 {
    (0..15)
        .map(|_| {
            let start = Instant::now();
            run();
            steps as f64 / start.elapsed().as_secs_f64()
        })
        .fold(0.0, f64::max)
}

fn main() {
    let rig = Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml"))
        .expect("the shipped rig");
    let model = Model2::new(&Parameters::stated(&rig));
    let input = DriveInput::torque(9.2);

    let mut end = ShaftFlowState::default();
    let ours = best(STEPS, || {
        let model = black_box(model);
        end = (0..STEPS).fold(ShaftFlowState::default(), |x, _| model.step(x, &input, STEP_S));
        black_box(end);
    });
    let ensemble = best(STEPS * SIDE_BY_SIDE, || {
        let model = black_box(model);
        let mut x = [ShaftFlowState::default(); SIDE_BY_SIDE];
        for _ in 0..STEPS {
            for x in &mut x {
                *x = model.step(*x, &input, STEP_S);
            }
        }
        black_box(x);
    });
    let mut their_end = SVector::<f64, 2>::zeros();
    let theirs = best(STEPS, || {
        let start = SVector::<f64, 2>::zeros();
        let mut solver = Rk4::new(Theirs(model, input), 0.0, start, STEPS as f64 * STEP_S, STEP_S);
        solver.integrate().expect("a fixed step does not fail");
        their_end = *solver.y_out().last().expect("at least the start");
    });

    println!("model 2, Runge-Kutta of order 4, step {STEP_S} s, one core");
    println!("  one trajectory      {:8.2} million steps/s", ours / 1e6);
    println!("  {SIDE_BY_SIDE} side by side      {:8.2} million steps/s", ensemble / 1e6);
    println!("  ode_solvers Rk4     {:8.2} million steps/s", theirs / 1e6);
    println!("  ratio               {:8.2}  ({:.2} side by side)", ours / theirs, ensemble / theirs);
    println!(
        "  end states differ by {:.1e} rad/s, {:.1e} m/s",
        (end.shaft_speed_rad_s - their_end[0]).abs(),
        (end.axial_m_s - their_end[1]).abs()
    );
}
