//! Physics that no catalogue holds: terms drawn from a random grammar, on a random path.
//!
//! A term is a product of one to three factors, or the sum of two such products. A factor is a shape
//! (power, saturation, threshold, window, wave, switch) over a signal of the machine, perhaps late or
//! smoothed. The list of what can come out is never written down; that no effect of the catalogue
//! does the same is checked case by case ([`crate::case`]).

use std::fmt;

use crate::dice::Dice;
use crate::machine::{Machine, Scale};
use crate::memory::{Lag, Past};
use crate::physics::{Drive, Now, Path, Physics, Reading, Shaft, Water};

/// What a factor looks at, each over its full scale.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Signal {
    Speed,
    Flow,
    Current,
    Command,
    Time,
    Acceleration,
}

/// How long ago, s, or over what time it is smoothed.
#[derive(Clone, Copy, Debug, PartialEq)]
enum When {
    Now,
    Late(f64),
    Smoothed(f64),
}

/// What is made of it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Shape {
    /// sgn(x) |x|^p, or |x|^p.
    Power { power: f64, even: bool },
    /// tanh(x/w).
    Saturated(f64),
    /// max(0, |x| - a), signed like x or not.
    Beyond { from: f64, even: bool },
    /// exp(-((|x| - c)/w)^2).
    Window { centre: f64, width: f64 },
    /// sin(k x).
    Wave(f64),
    /// 1 above a threshold, 0 below; with hysteresis.
    Switch { on: f64, off: f64 },
}

#[derive(Clone, Debug)]
struct Factor {
    signal: Signal,
    when: When,
    shape: Shape,
    lag: Lag,
    past: Past,
    closed: bool,
    value: f64,
}

/// Where a term enters.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Entry {
    Command,
    MotorTorque,
    ShaftTorque,
    BladeForce { torque: f64 },
    Ambient,
    Flux,
    Thrust,
    Flow,
    Speed,
}

impl Entry {
    fn path(self) -> Path {
        match self {
            Entry::Command | Entry::MotorTorque => Path::Drive,
            Entry::ShaftTorque => Path::Shaft,
            Entry::BladeForce { .. } => Path::Blade,
            Entry::Ambient | Entry::Flux => Path::Flow,
            Entry::Thrust | Entry::Flow | Entry::Speed => Path::Sensor,
        }
    }
}

/// A term of the grammar.
#[derive(Clone, Debug)]
pub struct Term {
    entry: Entry,
    products: Vec<Vec<Factor>>,
    sign: f64,
    size: f64,
}

/// Draws a term for a machine.
pub fn draw(
    machine: &Machine,
    full: &Scale,
    flow_recorded: bool,
    thrust_recorded: bool,
    dice: &mut Dice,
) -> Term {
    let mut entries =
        vec![Entry::Command, Entry::MotorTorque, Entry::ShaftTorque, Entry::ShaftTorque, Entry::ShaftTorque];
    if machine.wet() {
        let blade = Entry::BladeForce { torque: dice.between(0.2, 1.2) };
        entries.extend([blade, blade, blade, Entry::Ambient, Entry::Ambient, Entry::Flux]);
        if thrust_recorded {
            entries.push(Entry::Thrust);
        }
        if flow_recorded {
            entries.push(Entry::Flow);
        }
    } else {
        entries.push(Entry::Speed);
    }
    let entry = dice.pick(&entries);
    let products = (0..if dice.chance(0.25) { 2 } else { 1 })
        .map(|_| {
            let count = dice.pick(&[1, 2, 2, 2, 3]);
            (0..count).map(|place| factor(machine, full, place == 0 && count == 1, dice)).collect()
        })
        .collect();
    Term { entry, products, sign: dice.side(), size: 0.0 }
}

fn factor(machine: &Machine, full: &Scale, alone: bool, dice: &mut Dice) -> Factor {
    let mut signals = vec![
        Signal::Speed,
        Signal::Speed,
        Signal::Current,
        Signal::Command,
        Signal::Time,
        Signal::Acceleration,
    ];
    if machine.wet() {
        signals.extend([Signal::Flow, Signal::Flow]);
    }
    let when = match dice.index(5) {
        0 | 1 if !alone => When::Now,
        2 => When::Now,
        3 => When::Late(dice.log_between(0.05, 1.0)),
        _ => When::Smoothed(dice.log_between(0.2, 0.15 * full.duration_s)),
    };
    let centre = dice.between(0.25, 0.7);
    let shape = match dice.index(if alone { 5 } else { 6 }) {
        0 => Shape::Beyond { from: dice.between(0.2, 0.6), even: dice.chance(0.5) },
        1 => Shape::Window { centre, width: dice.between(0.08, 0.25) },
        2 => Shape::Wave(dice.between(3.0, 9.0)),
        3 => Shape::Switch { on: centre, off: centre * dice.between(0.5, 0.95) },
        4 => Shape::Saturated(dice.between(0.1, 0.5)),
        _ => Shape::Power { power: dice.pick(&[0.5, 1.0, 2.0, 3.0]), even: dice.chance(0.5) },
    };
    Factor {
        signal: dice.pick(&signals),
        when,
        shape,
        lag: Lag::default(),
        past: Past::default(),
        closed: false,
        value: 0.0,
    }
}

/// A load that comes on half way through the run.
pub fn switched_load() -> Term {
    let half = Shape::Switch { on: 0.5, off: 0.5 };
    let factor = |signal, shape| Factor {
        signal,
        when: When::Now,
        shape,
        lag: Lag::default(),
        past: Past::default(),
        closed: false,
        value: 0.0,
    };
    let products = vec![vec![factor(Signal::Time, half), factor(Signal::Speed, Shape::Saturated(0.05))]];
    Term { entry: Entry::ShaftTorque, products, sign: 1.0, size: 0.0 }
}

impl Factor {
    fn advance(&mut self, now: &Now, step_s: f64) {
        let x = match self.signal {
            Signal::Speed => now.relative_speed(),
            Signal::Flow => now.relative_flow(),
            Signal::Current => now.relative_current(),
            Signal::Command => now.command / now.full.command,
            Signal::Time => now.time_s / now.full.duration_s,
            Signal::Acceleration => {
                (now.acceleration_rad_s2 * now.machine.inertia_kg_m2 / now.full.torque_n_m).clamp(-2.0, 2.0)
            }
        };
        let x = match self.when {
            When::Now => x,
            When::Late(late_s) => {
                let ticks = late_s / step_s;
                self.past.push(x, ticks as usize + 2);
                self.past.ago(ticks)
            }
            When::Smoothed(time_s) => self.lag.follow(x, time_s, step_s),
        };
        self.value = match self.shape {
            Shape::Power { power, even } => x.abs().powf(power) * if even { 1.0 } else { x.signum() },
            Shape::Saturated(width) => (x / width).tanh(),
            Shape::Beyond { from, even } => (x.abs() - from).max(0.0) * if even { 1.0 } else { x.signum() },
            Shape::Window { centre, width } => (-((x.abs() - centre) / width).powi(2)).exp(),
            Shape::Wave(k) => (k * x).sin(),
            Shape::Switch { on, off } => {
                self.closed = x.abs() > if self.closed { off } else { on };
                f64::from(self.closed)
            }
        };
    }
}

impl Term {
    /// Path on which it acts.
    pub fn path(&self) -> Path {
        self.entry.path()
    }

    fn value(&self) -> f64 {
        let sum: f64 =
            self.products.iter().map(|list| list.iter().map(|factor| factor.value).product::<f64>()).sum();
        self.sign * self.size * sum
    }
}

impl Physics for Term {
    fn set(&mut self, strength: f64) {
        self.size = strength;
    }

    fn rest(&mut self) {
        for factor in self.products.iter_mut().flatten() {
            (factor.lag, factor.closed, factor.value) = (Lag::default(), false, 0.0);
            factor.past.clear();
        }
    }

    fn command(&mut self, asked: f64, _: &Now, _: f64) -> f64 {
        if self.entry == Entry::Command { asked * (1.0 + 2.0 * self.value()).max(0.0) } else { asked }
    }

    fn drive(&self, _: &Now, drive: &mut Drive) {
        if self.entry == Entry::MotorTorque {
            drive.torque_gain *= (1.0 + 2.0 * self.value()).max(0.0);
        }
    }

    fn shaft(&self, now: &Now, shaft: &mut Shaft) {
        if self.entry == Entry::ShaftTorque {
            shaft.torque_n_m += self.value() * now.full.torque_n_m;
        }
    }

    fn water(&self, now: &Now, water: &mut Water) {
        match self.entry {
            Entry::Ambient => water.ambient_m_s += 2.0 * self.value() * now.full.flow_m_s,
            Entry::Flux => water.flux_gain *= (1.0 + 4.0 * self.value()).max(0.1),
            _ => {}
        }
    }

    fn forces(&self, _: &Now, thrust_n: &mut f64, torque_n_m: &mut f64) {
        if let Entry::BladeForce { torque } = self.entry {
            let value = 2.0 * self.value();
            *thrust_n *= 1.0 + value;
            *torque_n_m *= 1.0 + torque * value;
        }
    }

    fn advance(&mut self, now: &Now, step_s: f64) {
        self.products.iter_mut().flatten().for_each(|factor| factor.advance(now, step_s));
    }

    fn sense(&mut self, now: &Now, reading: &mut Reading, _: f64) {
        match self.entry {
            Entry::Thrust => reading.thrust_n += self.value() * now.full.thrust_n,
            Entry::Flow => reading.flow_m_s += self.value() * now.full.flow_m_s,
            Entry::Speed => reading.speed_rad_s += self.value() * now.full.speed_rad_s,
            _ => {}
        }
    }
}

impl fmt::Display for Factor {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let name = match self.signal {
            Signal::Speed => "speed",
            Signal::Flow => "flow",
            Signal::Current => "current",
            Signal::Command => "command",
            Signal::Time => "time",
            Signal::Acceleration => "acceleration",
        };
        let x = match self.when {
            When::Now => name.to_owned(),
            When::Late(late_s) => format!("{name}(t - {late_s:.2} s)"),
            When::Smoothed(time_s) => format!("smooth({name}, {time_s:.2} s)"),
        };
        match self.shape {
            Shape::Power { power, even: true } => write!(f, "|{x}|^{power}"),
            Shape::Power { power, even: false } => write!(f, "sgn({x}) |{x}|^{power}"),
            Shape::Saturated(width) => write!(f, "tanh({x}/{width:.2})"),
            Shape::Beyond { from, even: true } => write!(f, "max(0, |{x}| - {from:.2})"),
            Shape::Beyond { from, even: false } => write!(f, "sgn({x}) max(0, |{x}| - {from:.2})"),
            Shape::Window { centre, width } => write!(f, "exp(-((|{x}| - {centre:.2})/{width:.2})^2)"),
            Shape::Wave(k) => write!(f, "sin({k:.1} {x})"),
            Shape::Switch { on, off } => write!(f, "switch({x}: on {on:.2}, off {off:.2})"),
        }
    }
}

impl fmt::Display for Term {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let enters = match self.entry {
            Entry::Command => "command x",
            Entry::MotorTorque => "motor torque x",
            Entry::ShaftTorque => "shaft torque +",
            Entry::BladeForce { .. } => "blade force x",
            Entry::Ambient => "ambient flow +",
            Entry::Flux => "momentum flux x",
            Entry::Thrust => "thrust reading +",
            Entry::Flow => "flow reading +",
            Entry::Speed => "speed reading +",
        };
        let products: Vec<String> = self
            .products
            .iter()
            .map(|list| list.iter().map(ToString::to_string).collect::<Vec<_>>().join(" * "))
            .collect();
        let sign = if self.sign < 0.0 { "-" } else { "" };
        write!(f, "{enters} {sign}c ({})", products.join(" + "))
    }
}
