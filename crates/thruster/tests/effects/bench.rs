//! Rigs of both classes with a programme that uses all of them.

use std::f64::consts::TAU;

use kort_thruster::effects::{Descriptor, Scale};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::plant::{Local, Plant, Response, Sensed, Stimulus, Tick, simulate};
use kort_thruster::rig::Rig;

pub const TICK_S: f64 = 0.002;
pub const DURATION_S: f64 = 14.0;

pub const WORK: &str = r#"
[rig]
class = "ducted work-class, geared"
[propeller]
radius_m = 0.13
duct_length_m = 0.1271
pitch_rad = 0.39
lift_max = 0.542
drag_max = 1.25
[flow]
density_kg_m3 = 998.0
flux_coefficient = 1.86
added_mass_coefficient = 2.0
[motor]
inertia_kg_m2 = 0.01
torque_constant_nm_a = 1.25
winding_resistance_ohm = 2.2
[amplifier]
kind = "current"
time_constant_s = 0.002
current_limit_a = 9.0
supply_v = 120.0
[sensors]
speed_filter_time_constant_s = 0.010
thrust_filter_hz = 163.0
torque_filter_hz = 99.5
torque = "propeller-side transducer"
"#;

const SMALL: &str = r#"
[rig]
class = "small brushless, geared"
[propeller]
radius_m = 0.038
duct_length_m = 0.04
pitch_rad = 0.4379
lift_max = 0.8331
drag_max = 0.93677
[flow]
density_kg_m3 = 998.0
flux_coefficient = 1.95783
added_mass_coefficient = 2.21715
[motor]
inertia_kg_m2 = 6.414e-5
torque_constant_nm_a = 0.01986
winding_resistance_ohm = 0.11
[amplifier]
kind = "current"
time_constant_s = 0.002
current_limit_a = 34.0
supply_v = 14.8
[sensors]
speed_filter_time_constant_s = 0.010
thrust_filter_hz = 163.0
torque_filter_hz = 99.5
torque = "propeller-side transducer"
"#;

/// Length of one of the programme's levels, s.
pub const LEVEL_S: f64 = 1.0;

/// A rig with a programme that uses all of it: steps both ways, a ramp through zero, reversals.
pub struct Bench {
    pub name: &'static str,
    pub rig: Rig,
    pub parameters: Parameters,
    pub stimulus: Stimulus,
    pub scale: Scale,
    pub base: Vec<Sensed>,
    pub base_truth: Vec<Local>,
}

pub fn bench(name: &'static str, text: &str) -> Bench {
    let rig = Rig::from_toml(text).unwrap();
    let parameters = Parameters::stated(&rig);
    let top = 0.9 * rig.amplifier.current_limit_a;
    let levels = [0.0, 0.3, -0.3, 1.0, -1.0, 0.6, 0.0, 0.15, -0.6, 0.9];
    let ticks: Vec<Tick> = (0..(DURATION_S / TICK_S) as usize)
        .map(|k| {
            let time_s = k as f64 * TICK_S;
            let share = if time_s < 10.0 {
                levels[(time_s / LEVEL_S) as usize]
            } else {
                ((time_s - 10.0) / 2.0 - 1.0).clamp(-1.0, 1.0)
            };
            Tick { time_s, command: top * share, extra: (TAU * 0.2 * time_s).sin(), ..Tick::default() }
        })
        .collect();
    let logs = (0..ticks.len()).step_by(5).map(|k| (k, 0.0)).collect();
    let stimulus = Stimulus { ticks, logs };
    let mut bench = Bench {
        name,
        scale: Scale {
            shaft_speed_rad_s: 1.0,
            torque_n_m: parameters.get(P::TorqueConstantNmA) * top,
            thrust_n: 1.0,
            flow_m_s: 1.0,
            current_a: top,
            command: top,
            supply_v: rig.amplifier.supply_v.unwrap_or(0.0),
            current_limit_a: 9.0,
            winding_resistance_ohm: rig.motor.winding_resistance_ohm.map_or(0.0, |r| r.value),
            inertia_kg_m2: parameters.get(P::InertiaKgM2),
            tick_s: TICK_S,
            duration_s: DURATION_S,
            clock_s: [0.0, DURATION_S],
            angle_known: true,
            turned_rad: f64::INFINITY,
            angle_rad: [0.0; 2],
            reverses: true,
        },
        rig,
        parameters,
        stimulus,
        base: Vec::new(),
        base_truth: Vec::new(),
    };
    // The recorded angle keeps what follows the angle in phase, as in a fit.
    let mut angle_rad = 0.0;
    for (k, at) in bench.truth(&[]).iter().enumerate() {
        bench.stimulus.ticks[k].shaft_angle_rad = Some((angle_rad, at.shaft_angle_rad));
        angle_rad = at.shaft_angle_rad;
    }
    bench.base = bench.respond(&[]).rows;
    bench.base_truth = bench.truth(&[]);
    let largest = |f: fn(&Sensed) -> f64| bench.base.iter().map(|s| f(s).abs()).fold(0.0, f64::max);
    bench.scale.shaft_speed_rad_s = largest(|s| s.shaft_speed_rad_s);
    bench.scale.thrust_n = largest(|s| s.thrust_n);
    bench.scale.flow_m_s = largest(|s| s.flow_m_s);
    bench
}

pub fn benches() -> [Bench; 2] {
    [bench("work class", WORK), bench("small brushless", SMALL)]
}

impl Bench {
    pub fn plant(&self, effects: &[(&Descriptor, &[f64])]) -> Plant {
        let mut plant = Plant::new(ModelName::Model2, &self.rig, &self.parameters, effects, TICK_S);
        plant.start(0.0, 0.0, 0.0, 0.0, 0.0);
        plant
    }

    pub fn respond(&self, effects: &[(&Descriptor, &[f64])]) -> Response {
        simulate(&mut self.plant(effects), &self.stimulus)
    }

    /// The true motion, whatever the sensors show.
    pub fn truth(&self, effects: &[(&Descriptor, &[f64])]) -> Vec<Local> {
        let mut plant = self.plant(effects);
        self.stimulus
            .ticks
            .iter()
            .map(|tick| {
                plant.step(tick);
                *plant.truth()
            })
            .collect()
    }

    /// Largest difference (RMS of a channel over its full scale) between two responses.
    pub fn difference(&self, a: &[Sensed], b: &[Sensed]) -> f64 {
        let channels: [fn(&Sensed) -> f64; 5] =
            [|s| s.thrust_n, |s| s.shaft_speed_rad_s, |s| s.flow_m_s, |s| s.torque_n_m, |s| s.current_a];
        channels
            .iter()
            .map(|f| {
                let full = self.base.iter().map(|s| f(s).abs()).fold(0.0, f64::max);
                let sum: f64 = a.iter().zip(b).map(|(x, y)| (f(x) - f(y)).powi(2)).sum();
                (sum / a.len() as f64).sqrt() / full
            })
            .fold(0.0, f64::max)
    }
}
