//! How soon the monitor of mismatch finds each effect of the catalogue, and on which path.

mod common;

use common::watched::{DT, Watched, learnt_on, plant_of, rig, stand};
use kort_control::mismatch::Path;
use kort_thruster::effects::{ALL, Available, Descriptor};
use kort_thruster::plant::{Sensed, Tick};
use kort_thruster::rig::Rig;

/// Size of an effect: root mean square of the change it makes to the channel that shows it best, over full scale.
const SIZE: f64 = 0.03;
/// Of commands that the effects are sized under, s.
const SIZED_S: f64 = 60.0;
/// Longest wait for an alarm, s.
const WITHIN_S: f64 = 300.0;

/// Current, shaft speed, thrust and flow as the sensors show them.
fn shown(sensed: &Sensed) -> [f64; 4] {
    [sensed.current_a, sensed.shaft_speed_rad_s, sensed.thrust_n, sensed.flow_m_s]
}

/// What the healthy loop commands.
fn commands(mut watched: Watched) -> Vec<f64> {
    (0..(SIZED_S / DT) as usize)
        .map(|_| {
            let output = watched.l.tick_with(&watched.l.measured(), watched.reference());
            watched.time_s += DT;
            output.command.current_a
        })
        .collect()
}

/// What the sensors show under commands.
fn replay(rig: &Rig, commands: &[f64], effects: &[(&Descriptor, &[f64])]) -> Vec<[f64; 4]> {
    let mut plant = plant_of(rig, effects, &[]);
    let step = |(k, command): (usize, &f64)| {
        plant.step(&Tick { time_s: k as f64 * DT, command: *command, ..Tick::default() });
        shown(&plant.sensed())
    };
    commands.iter().enumerate().map(step).collect()
}

/// Change of the channel that changes most, over its full scale, root mean square.
fn change(clean: &[[f64; 4]], other: &[[f64; 4]]) -> f64 {
    let of = |channel: usize| {
        let full = clean.iter().fold(1e-9_f64, |full, row| full.max(row[channel].abs()));
        let sum: f64 = clean.iter().zip(other).map(|(a, b)| (a[channel] - b[channel]).powi(2)).sum();
        (sum / clean.len() as f64).sqrt() / full
    };
    (0..4).map(of).fold(0.0, f64::max)
}

/// Values at which an effect makes the wanted change, as near as its limits allow, and the change.
fn sized(effect: &Descriptor, rig: &Rig, commands: &[f64], clean: &[[f64; 4]]) -> (Vec<f64>, f64) {
    let watched = Watched::on(rig, None);
    let specs = (effect.parameters)(&watched.l.controller.nominal().scale(rig, 600.0));
    let mut times = 1.0_f64;
    let mut best = (Vec::new(), 0.0_f64);
    for _ in 0..8 {
        let of = |spec: &kort_thruster::effects::Spec| {
            if spec.shape { spec.start } else { (times * spec.start).clamp(spec.low, spec.high) }
        };
        let values: Vec<f64> = specs.iter().map(of).collect();
        let makes = change(clean, &replay(rig, commands, &[(effect, &values)]));
        if !makes.is_finite() {
            times *= 0.3;
            continue;
        }
        if best.0.is_empty() || (makes - SIZE).abs() < (best.1 - SIZE).abs() {
            best = (values, makes);
        }
        times *= (SIZE / makes.max(1e-9)).clamp(0.1, 10.0);
    }
    best
}

/// Prints the table of docs/control.md.
#[test]
#[ignore = "two minutes; cargo test --release -p kort-control --test mismatch_catalogue -- --ignored --nocapture"]
fn every_effect_of_the_catalogue() {
    let [right, other, silent] = told(&stand(), None);
    assert!(right > 4 * other && silent == 0, "{right} {other} {silent}");
}

/// The same on the runs that the monitor was made on: levels drawn by a seed.
#[test]
#[ignore = "five minutes"]
fn every_effect_on_the_runs_it_was_made_on() {
    for (rig, seed) in [(stand(), 13), (rig("ducted-small-vessel"), 11), (rig("tunnel-10kw"), 12)] {
        println!("{}", rig.name);
        let [.., silent] = told(&rig, Some(seed));
        assert_eq!(silent, 0, "{}", rig.name);
    }
}

/// Prints what is told of each effect; how many are named on the right path, on another and not at all.
fn told(rig: &Rig, seed: Option<u64>) -> [u32; 3] {
    let columns =
        ["current_cmd_a", "current_a", "shaft_speed_rad_s", "shaft_angle_rad", "thrust_n", "flow_m_s"];
    let available = Available {
        columns: columns.map(str::to_owned).to_vec(),
        axial_flow_modelled: true,
        turned_rad: Some(1000.0),
        ..Available::default()
    };
    let commands = commands(Watched::on(rig, seed));
    let clean = replay(rig, &commands, &[]);
    let (mut right, mut other, mut silent) = (0, 0, 0);
    println!("| effect | path | size | alarm | after |\n| --- | --- | --- | --- | --- |");
    for effect in ALL.iter().filter(|e| !e.nonparametric && (e.needs)(rig, &available).is_ok()) {
        let (values, makes) = sized(effect, rig, &commands, &clean);
        let path = effect.path.name();
        if makes < 0.5 * SIZE {
            println!("| `{}` | {path} | {:.1} % at most | - | - |", effect.id, 100.0 * makes);
            continue;
        }
        let mut watched = learnt_on(rig, seed);
        let before = watched.time_s;
        watched.switch_to(&[(effect, &values)], &[]);
        let alarm = watched.run(WITHIN_S).map(Path::name);
        let after_s = watched.time_s - before;
        let (named, after) = match alarm {
            Some(named) => (named, format!("{after_s:.0} s")),
            None => ("none", format!("> {WITHIN_S:.0} s")),
        };
        match alarm {
            Some(named) if named == path => right += 1,
            Some(_) => other += 1,
            None => silent += 1,
        }
        println!("| `{}` | {path} | {:.1} % | {named} | {after} |", effect.id, 100.0 * makes);
    }
    println!(
        "{right} on the right path, {other} on another, {silent} without an alarm within {WITHIN_S:.0} s"
    );
    [right, other, silent]
}
