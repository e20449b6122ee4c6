//! Sizes: the strength at which an effect moves a channel by a share of its full scale, and what of
//! it a re-fit of the stated quantities would leave.

use crate::controller::Controller;
use crate::log::LogPlan;
use crate::machine::{DriveKind, Machine, Scale};
use crate::physics::Physics;
use crate::refit;
use crate::run::{Bench, Driver, Trace};
use crate::statement::{Claim, Quantity};

/// Hidden physics of one run.
pub type Hidden = Vec<Box<dyn Physics>>;

/// What a machine is put through.
#[derive(Clone, Debug, PartialEq)]
pub struct Trial {
    /// Command or set-point a tick.
    pub asked: Vec<f64>,
    /// The loop that follows the set-point.
    pub controller: Option<Controller>,
}

/// One machine under one trial, without noise.
pub struct Experiment<'a> {
    machine: &'a Machine,
    trial: &'a Trial,
    log: LogPlan,
    /// Largest values without hidden physics.
    pub full: Scale,
    /// What drives the model of whoever reads the log, where nothing is hidden.
    base: Driven,
    clean: Vec<Channel>,
}

/// The logged driver of a run.
enum Driven {
    Command(Vec<f64>),
    Current(Vec<f64>),
}

impl Driven {
    fn driver(&self) -> Driver<'_> {
        match self {
            Driven::Command(list) => Driver::Command(list),
            Driven::Current(list) => Driver::Current(list),
        }
    }
}

/// A response: name, samples, noise over full scale.
struct Channel {
    name: &'static str,
    noise: f64,
    values: Vec<f64>,
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |top: f64, value| top.max(value.abs()))
}

fn energy(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

impl<'a> Experiment<'a> {
    /// Runs the trial without hidden physics.
    pub fn new(machine: &'a Machine, trial: &'a Trial, log: LogPlan) -> Self {
        let mut full = Scale { speed_rad_s: 1.0, flow_m_s: 1.0, thrust_n: 1.0, ..Scale::default() };
        let mut experiment =
            Experiment { machine, trial, log, full, base: Driven::Command(Vec::new()), clean: Vec::new() };
        let trace = experiment.closed(machine, &mut Vec::new());
        full.speed_rad_s = largest(trace.speed_rad_s.iter().copied()).max(1e-9);
        full.flow_m_s = largest(trace.readings.iter().map(|r| r.flow_m_s)).max(1e-9);
        full.thrust_n = largest(trace.readings.iter().map(|r| r.thrust_n)).max(1e-9);
        full.torque_n_m = largest(trace.torque_n_m.iter().copied()).max(1e-9);
        full.current_a = largest(trace.readings.iter().map(|r| r.current_a)).max(1e-9);
        full.command = largest(trace.command.iter().copied()).max(1e-9);
        full.duration_s = trial.asked.len() as f64 * machine.sensors.tick_s;
        experiment.full = full;
        experiment.base = experiment.driven(&trace);
        experiment.clean = experiment.responses(&trace);
        experiment
    }

    fn bench<'m>(&self, machine: &'m Machine, quick: bool) -> Bench<'m> {
        let step_s = if quick { machine.fine_step_s() } else { machine.coarse_step_s() };
        Bench { machine, full: self.full, step_s, quantise: false }
    }

    /// The run as it happens, its loop closed.
    fn closed(&self, machine: &Machine, hidden: &mut Hidden) -> Trace {
        let quick = hidden.iter().any(|each| each.quick());
        self.bench(machine, quick).run(self.trial.driver(), hidden)
    }

    fn driven(&self, trace: &Trace) -> Driven {
        if self.log.columns.command {
            Driven::Command(trace.command.clone())
        } else {
            Driven::Current(trace.readings.iter().map(|reading| reading.current_a).collect())
        }
    }

    fn responses(&self, trace: &Trace) -> Vec<Channel> {
        let every = self.machine.sensors.ticks_per_row.max((0.004 / self.machine.sensors.tick_s) as usize);
        let first = (self.log.from_s / self.machine.sensors.tick_s) as usize;
        let list = |name, noise, pick: &dyn Fn(&crate::physics::Reading) -> f64| Channel {
            name,
            noise,
            values: trace.readings.iter().skip(first).step_by(every).map(pick).collect(),
        };
        let mut channels =
            vec![list("shaft_speed_rad_s", if self.machine.wet() { 0.0013 } else { 0.003 }, &|r| {
                r.speed_rad_s
            })];
        if self.log.columns.thrust {
            channels.push(list("thrust_n", 0.005, &|r| r.thrust_n));
        }
        if self.log.columns.torque {
            channels.push(list("torque_n_m", 0.008, &|r| r.torque_n_m));
        }
        if self.log.columns.flow {
            channels.push(list("flow_m_s", 0.03, &|r| r.flow_m_s));
        }
        if self.log.columns.current && self.machine.drive == DriveKind::Voltage {
            channels.push(list("current_a", 0.006, &|r| r.current_a));
        }
        channels
    }

    /// What hidden physics changes beside a run without it under the same logged driver, each channel
    /// over its full scale.
    fn change(&self, hidden: &mut Hidden) -> Vec<Channel> {
        let trace = self.closed(self.machine, hidden);
        if trace.broken {
            // Far too much of it.
            let endless = |clean: &Channel| Channel {
                name: clean.name,
                noise: clean.noise,
                values: vec![1e3; clean.values.len()],
            };
            return self.clean.iter().map(endless).collect();
        }
        let with = self.responses(&trace);
        let replayed;
        let clean = if self.trial.controller.is_some() {
            let driven = self.driven(&trace);
            replayed = self.responses(&self.bench(self.machine, false).run(driven.driver(), &mut Vec::new()));
            &replayed
        } else {
            &self.clean
        };
        with.into_iter()
            .zip(clean)
            .zip(&self.clean)
            .map(|((with, clean), scale)| {
                let full = largest(scale.values.iter().copied()).max(1e-12);
                let values = with.values.iter().zip(&clean.values).map(|(w, c)| (w - c) / full).collect();
                Channel { values, ..with }
            })
            .collect()
    }

    /// Root-mean-square change of the channel that shows most, over its full scale, and that channel.
    pub fn share(&self, hidden: &mut Hidden) -> (f64, &'static str) {
        best(&self.change(hidden))
    }

    /// Gives a single hidden effect the strength at which it moves its best channel by `wanted` of
    /// full scale; one that saturates below that stays at full strength. Returns share and channel.
    pub fn size(&self, hidden: &mut Hidden, wanted: f64) -> (f64, &'static str) {
        let (mut low, mut high, mut guess): (f64, f64, f64) = (1e-6, 1.0, (1.5 * wanted).min(0.5));
        let mut made = (0.0, "none");
        for _ in 0..12 {
            hidden.iter_mut().for_each(|each| each.set(guess));
            made = self.share(hidden);
            if (made.0 / wanted - 1.0).abs() < 0.06 || (made.0 < wanted && guess >= 0.999) {
                break;
            }
            if made.0 < wanted {
                low = low.max(guess);
            } else {
                high = high.min(guess);
            }
            let scaled =
                if made.0 > 0.02 * wanted { guess * (wanted / made.0).powf(0.85) } else { guess * 6.0 };
            guess = if scaled > low && scaled < high {
                scaled
            } else if high >= 1.0 && scaled >= 1.0 {
                1.0
            } else {
                (low * high).sqrt()
            };
        }
        made
    }

    /// The share of [`Self::share`] that a re-fit of the stated quantities leaves (linear, channels
    /// weighed by their noise, none moved beyond its tolerance), and what is left, in noise.
    pub fn visible(&self, hidden: &mut Hidden, base: &BaseColumns) -> (f64, Vec<f64>) {
        let change = self.change(hidden);
        let target = weighed(&change);
        let rest = refit::residual_within(&base.columns, &target, &base.tolerances);
        (best(&change).0 * (energy(&rest) / energy(&target).max(1e-30)).sqrt(), rest)
    }

    /// What a relative change of each stated quantity does.
    pub fn base_columns(&self, claims: &[Claim]) -> BaseColumns {
        let step = 1e-3;
        let column = |quantity: Quantity| -> Vec<f64> {
            let machine = quantity.scaled(self.machine, 1.0 + step);
            let moved = self.responses(&self.bench(&machine, false).run(self.base.driver(), &mut Vec::new()));
            let clean = if self.trial.controller.is_some() {
                self.responses(&self.bench(self.machine, false).run(self.base.driver(), &mut Vec::new()))
            } else {
                Vec::new()
            };
            let clean = if clean.is_empty() { &self.clean } else { &clean };
            moved
                .iter()
                .zip(clean)
                .flat_map(|(m, c)| {
                    let unit = step * largest(c.values.iter().copied()).max(1e-12) * c.noise;
                    m.values.iter().zip(&c.values).map(move |(m, c)| (m - c) / unit)
                })
                .collect()
        };
        BaseColumns {
            columns: claims.iter().map(|claim| column(claim.quantity)).collect(),
            tolerances: claims.iter().map(|claim| claim.tol).collect(),
        }
    }

    /// What tells `hidden` from a rival of about its size: the sum of squares, in noise, that the rival and a
    /// re-fit of the stated quantities leave of it (linear).
    #[cfg(test)]
    pub fn apart(&self, hidden: &mut Hidden, rival: &mut Hidden, base: &BaseColumns) -> f64 {
        let mut columns = base.columns.clone();
        columns.push(self.action(rival));
        let mut precision: Vec<f64> = base.tolerances.iter().map(|tol| 2.0 / tol).collect();
        precision.push(0.0);
        let target = self.action(hidden);
        let found = refit::project(&columns, &target, &precision);
        let rest: Vec<f64> = (0..target.len())
            .map(|row| {
                target[row] - found.iter().zip(&columns).map(|(c, column)| c * column[row]).sum::<f64>()
            })
            .collect();
        energy(&rest)
    }

    /// What a hidden effect changes, on all channels, in their noise.
    pub fn action(&self, hidden: &mut Hidden) -> Vec<f64> {
        weighed(&self.change(hidden))
    }

    /// Sign of the mean change of the shaft's speed along its turning.
    pub fn turns_slower(&self, hidden: &mut Hidden) -> bool {
        let change = self.change(hidden);
        let along: f64 =
            change[0].values.iter().zip(&self.clean[0].values).map(|(d, v)| d * v.signum()).sum();
        along < 0.0
    }
}

impl Trial {
    /// What drives the run.
    pub fn driver(&self) -> Driver<'_> {
        match &self.controller {
            None => Driver::Command(&self.asked),
            Some(controller) => Driver::Loop(&self.asked, controller),
        }
    }
}

/// Actions of the stated quantities, and how far each may move.
pub struct BaseColumns {
    columns: Vec<Vec<f64>>,
    tolerances: Vec<f64>,
}

fn weighed(change: &[Channel]) -> Vec<f64> {
    change.iter().flat_map(|channel| channel.values.iter().map(|value| value / channel.noise)).collect()
}

fn best(change: &[Channel]) -> (f64, &'static str) {
    let rms = |values: &[f64]| (energy(values) / values.len().max(1) as f64).sqrt();
    let sizes = change.iter().map(|channel| (rms(&channel.values), channel.name));
    sizes.fold((0.0, "none"), |best, next| if next.0 > best.0 { next } else { best })
}
