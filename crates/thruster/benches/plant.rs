//! What a simulation costs: 65 s at 500 Hz of the composed plant, plain, with four derivatives carried along,
//! and with effects at work.
//!
//! `cargo bench -p kort-thruster --bench plant`

use std::hint::black_box;
use std::time::Instant;

use kort_thruster::dual::Dual;
use kort_thruster::effects::{self, Descriptor};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter, Parameters};
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::real::Real;
use kort_thruster::rig::Rig;

const TICK_S: f64 = 0.002;
const TICKS: usize = 32_500;
const ROUNDS: usize = 7;

/// Best of several runs, ms.
fn best<T: Real>(rig: &Rig, parameters: &Parameters<T>, effects: &[(&Descriptor, &[T])], top: f64) -> f64 {
    let levels = [0.0, 0.37, -0.41, 0.9, -0.93, 0.21];
    (0..ROUNDS)
        .map(|_| {
            let mut plant = Plant::new(ModelName::Model2, rig, parameters, effects, TICK_S);
            plant.start(0.0, 0.0, 0.0, 0.0, 0.0);
            let start = Instant::now();
            for k in 0..TICKS {
                let command = top * levels[k / 1000 % 6];
                plant.step(&Tick { time_s: k as f64 * TICK_S, command, ..Tick::default() });
            }
            black_box(plant.sensed());
            start.elapsed().as_secs_f64() * 1e3
        })
        .fold(f64::INFINITY, f64::min)
}

fn compare(what: &str, rig: &Rig, effects: &[(&str, &[f64])], top: f64) {
    let plain = Parameters::stated(rig);
    let mut dual = Parameters::<Dual>::lift(&plain);
    dual.set(Parameter::LiftMax, Dual::parameter(plain.get(Parameter::LiftMax), 0));
    let found = |id: &str| effects::find(id).expect("an effect of the catalogue");
    let hooked: Vec<(&Descriptor, &[f64])> = effects.iter().map(|(id, v)| (found(id), *v)).collect();
    let lifted: Vec<Vec<Dual>> =
        effects.iter().map(|(_, v)| v.iter().map(|x| Dual::from(*x)).collect()).collect();
    let lifted: Vec<(&Descriptor, &[Dual])> =
        hooked.iter().zip(&lifted).map(|((d, _), v)| (*d, v.as_slice())).collect();
    println!(
        "  {what:28} plain {:6.2} ms   with derivatives {:6.2} ms",
        best(rig, &plain, &hooked, top),
        best(rig, &dual, &lifted, top)
    );
}

fn main() {
    let text = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
    let rig = Rig::from_toml(text).expect("the shipped rig");
    println!("65 s at 500 Hz, model 2");
    compare("nothing added", &rig, &[], 9.0);
    compare("dry friction", &rig, &[("coulomb_friction", &[0.3, 0.3, 2.0])], 9.0);
    compare("swirl", &rig, &[("rotational_flow", &[0.3, 0.3])], 9.0);
    let air = text
        .replace("density_kg_m3 = ", "density_kg_m3 = 1.2 #")
        .replace("duct_length_m = ", "duct_length_m = 0.006 #")
        .replace("inertia_kg_m2 = ", "inertia_kg_m2 = 0.001 #");
    compare("in air, stiff flow", &Rig::from_toml(&air).expect("a rig in air"), &[], 0.4);
}
