//! Development: time of one simulation, in CPU-bound repetitions.
use kort_thruster::{effects, models::ModelName, parameters::Parameters, plant::*, rig::Rig};
fn main() {
    let rig = Rig::from_toml(&std::fs::read_to_string(std::env::args().nth(1).unwrap()).unwrap()).unwrap();
    let p = Parameters::stated(&rig);
    let ticks: Vec<Tick> = (0..32500)
        .map(|i| Tick {
            time_s: i as f64 * 0.002,
            command: if i / 500 % 2 == 0 { 5.0 } else { -3.0 },
            ..Tick::default()
        })
        .collect();
    let s = Stimulus { logs: (0..6500).map(|k| (k * 5, 0.0)).collect(), ticks };
    let c = effects::find("coulomb_friction").unwrap();
    let v = [0.01, 0.3, 5.0];
    for e in [vec![], vec![(c, &v[..])]] {
        let t = cpu();
        for _ in 0..100 {
            let mut plant = Plant::new(ModelName::Model2, &rig, &p, &e, 0.002);
            plant.start(0.0, 0.0, 0.0, 0.0, 0.0);
            std::hint::black_box(simulate(&mut plant, &s));
        }
        println!("{} effects: {:.2} ms", e.len(), (cpu() - t) * 1000.0 / 100.0);
    }
}
fn cpu() -> f64 {
    // user time of this process from /proc, in clock ticks of 10 ms
    let s = std::fs::read_to_string("/proc/self/stat").unwrap();
    s.rsplit(')').next().unwrap().split_whitespace().nth(11).unwrap().parse::<f64>().unwrap() / 100.0
}
