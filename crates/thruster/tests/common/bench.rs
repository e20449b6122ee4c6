//! A bench on which derivatives that a simulation carries along are held against differences of simulations.

use std::f64::consts::TAU;

use kort_thruster::dual::Dual;
use kort_thruster::effects::{Descriptor, Scale, Spec};
use kort_thruster::models::ModelName;
use kort_thruster::parameters::{Parameter as P, Parameters};
use kort_thruster::plant::{Plant, Sensed, Stimulus, Tick, simulate};
use kort_thruster::real::Real;
use kort_thruster::rig::{AmplifierKind, Quantity, Rig};

const TICK_S: f64 = 0.002;
const DURATION_S: f64 = 6.0;

/// Error of a column as a share of its size, beyond which a derivative is wrong. All but one are within 1e-4:
/// where a dead band opens, the few smallest commands fall into it whole.
const SHARE: f64 = 5e-3;
/// Columns smaller than this share of the response, for a change by the parameter's own size, do not count.
const NOTHING: f64 = 1e-7;

pub type Effects<T> = Vec<(&'static Descriptor, Vec<T>)>;

/// A stand and what is done on it: jumps both ways to the limit and beyond, then slow waves.
pub struct Bench {
    pub rig: Rig,
    stimulus: Stimulus,
    scale: Scale,
}

impl Bench {
    pub fn new(kind: AmplifierKind) -> Self {
        let mut rig =
            Rig::from_toml(include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
        rig.amplifier.kind = kind;
        rig.amplifier.supply_v = Some(120.0);
        rig.motor.winding_resistance_ohm = Some(Quantity { value: 2.2, tol: None });
        let top = match kind {
            AmplifierKind::Current => 9.0,
            AmplifierKind::Voltage => 90.0,
            AmplifierKind::Speed => 60.0,
        };
        let levels = [0.0, 0.37, -0.41, 1.1, -0.93, 0.21];
        let ticks = (0..(DURATION_S / TICK_S) as usize).map(|k| {
            let time_s = k as f64 * TICK_S;
            let wave = (TAU * 0.7 * time_s).sin();
            let level = if time_s < 3.0 { levels[(2.0 * time_s) as usize] } else { 1.2 * wave };
            let ambient = |k: f64| 0.2 * (0.01 * k).cos();
            Tick {
                time_s,
                command: top * level,
                ambient_m_s: (ambient(k as f64), ambient(k as f64 + 1.0)),
                extra: wave,
                depth_m: Some(2.0 + 0.3 * wave),
                ..Tick::default()
            }
        });
        let ticks: Vec<Tick> = ticks.collect();
        let logs = (0..ticks.len() / 5 - 1).map(|k| (5 * k, if k % 2 == 0 { 0.0 } else { 0.4 })).collect();
        let scale = Scale {
            shaft_speed_rad_s: 50.0,
            torque_n_m: 10.0,
            thrust_n: 150.0,
            flow_m_s: 1.2,
            current_a: 9.0,
            command: top,
            supply_v: 120.0,
            current_limit_a: 9.0,
            winding_resistance_ohm: 2.2,
            inertia_kg_m2: 0.01,
            tick_s: TICK_S,
            duration_s: DURATION_S,
            clock_s: [0.0, DURATION_S],
            angle_known: true,
            turned_rad: f64::INFINITY,
            angle_rad: [0.0; 2],
            reverses: true,
        };
        Self { rig, stimulus: Stimulus { ticks, logs }, scale }
    }

    fn run<T: Real>(
        &self,
        model: ModelName,
        parameters: &Parameters<T>,
        effects: &Effects<T>,
    ) -> Vec<[T; 5]> {
        let hooked: Vec<(&Descriptor, &[T])> = effects.iter().map(|(d, v)| (*d, v.as_slice())).collect();
        let mut plant = Plant::new(model, &self.rig, parameters, &hooked, TICK_S);
        plant.start(0.0, 1.0, 0.05, 0.0, 0.0);
        let seen = |s: &Sensed<T>| [s.current_a, s.shaft_speed_rad_s, s.thrust_n, s.torque_n_m, s.flow_m_s];
        simulate(&mut plant, &self.stimulus).rows.iter().map(seen).collect()
    }

    /// Checks the derivative by one number, `set`, of size `size`; on one side only if it must not fall.
    pub fn check(
        &self,
        what: &str,
        model: ModelName,
        at: (&Parameters, &Effects<f64>),
        which: Which,
        (value, size): (f64, f64),
        one_sided: bool,
    ) {
        let lift: Effects<Dual> =
            at.1.iter().map(|(d, v)| (*d, v.iter().map(|x| Dual::from(*x)).collect())).collect();
        let mut dual = (Parameters::lift(at.0), lift);
        which.set(&mut dual.0, &mut dual.1, Dual::parameter(value, 1));
        let derived = self.run(model, &dual.0, &dual.1);
        let plain = |value: f64| {
            let (mut parameters, mut effects) = (*at.0, at.1.clone());
            which.set(&mut parameters, &mut effects, value);
            self.run(model, &parameters, &effects)
        };
        let (h, here) = (1e-6 * size, plain(value));
        let (up, down) =
            (plain(value + h), if one_sided { plain(value + 2.0 * h) } else { plain(value - h) });
        for channel in 0..5 {
            let norm = |f: &dyn Fn(usize) -> f64| (0..here.len()).map(|i| f(i).powi(2)).sum::<f64>().sqrt();
            let difference = |i: usize| {
                let (a, b, c) = (up[i][channel], down[i][channel], here[i][channel]);
                if one_sided { (4.0 * a - b - 3.0 * c) / (2.0 * h) } else { (a - b) / (2.0 * h) }
            };
            assert!(
                (0..here.len()).all(|i| derived[i][channel].re() == here[i][channel]),
                "{what}: other values"
            );
            let column = norm(&|i| difference(i));
            let wrong = norm(&|i| derived[i][channel].slopes()[1] - difference(i));
            let response = norm(&|i| here[i][channel]);
            assert!(
                wrong <= SHARE * column + NOTHING * response / size,
                "{what}, channel {channel}: {wrong:.2e} of {column:.2e}, response {response:.2e}"
            );
        }
    }
}

/// What is differentiated by.
#[derive(Clone, Copy)]
pub enum Which {
    Parameter(P),
    Effect(usize),
}

impl Which {
    fn set<T: Real>(self, parameters: &mut Parameters<T>, effects: &mut Effects<T>, value: T) {
        match self {
            Self::Parameter(p) => parameters.set(p, value),
            Self::Effect(j) => effects[0].1[j] = value,
        }
    }
}

/// Checks the derivative by every value of an effect: at its start, and where the effect vanishes.
pub fn by_every_value(effect: &'static Descriptor, model: ModelName, kind: AmplifierKind) {
    let bench = Bench::new(kind);
    let stated = Parameters::stated(&bench.rig);
    let specs = (effect.parameters)(&bench.scale);
    // A little off: a start may lie on a kink, as a delay of two ticks does.
    let off = |s: &Spec| if s.held { s.start } else { (1.03 * s.start).clamp(s.low, s.high) };
    let start: Vec<f64> = specs.iter().map(off).collect();
    let none: Vec<f64> = specs.iter().map(|s| if s.shape { s.start } else { 0.0 }).collect();
    for (j, spec) in specs.iter().enumerate().filter(|(j, s)| !s.held && *j < 12) {
        let size = spec.start.abs().max(0.01 * (spec.high - spec.low));
        for (values, place) in [(&start, "at its start"), (&none, "where the effect vanishes")] {
            let one_sided = values[j] <= spec.low;
            let what = format!("{} {} {place}", effect.id, spec.name);
            let at = (&stated, &vec![(effect, values.clone())]);
            bench.check(&what, model, at, Which::Effect(j), (values[j], size), one_sided);
        }
    }
}
