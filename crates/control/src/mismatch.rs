//! Mismatch between thruster and model while it runs: which path has changed, and since when; and how far it is off.
//!
//! Beside every tick, from what is measured and commanded alone (not from an observer that would learn the mismatch
//! away): the drive's current behind its lag, the shaft's torque balance, the blades' thrust in a flow that the
//! model makes of the measured speed, and that flow. Over a block of time what is missing in each is regressed on what is
//! expected, its rate of change and a constant: it is off in proportion, late, or by a constant, and it may be restless.
//! Each of these signs is standardised with mean and spread of the blocks before it, and more spread where a block
//! was driven less than those: of noise that is there anyway it has more. The first blocks are learnt as they come; every
//! later one once it is a minute old and nothing is off. So standardised, a sign is off by no more than it is by nature, however
//! the first minutes fell out: a self-starting CUSUM (Hawkins 1987, The Statistician 36), where a mean learnt once and a third
//! of a standard deviation wrong, as some of 150 blocks are, would stand in every later block.
//!
//! What a fault of each path does to all signs is rehearsed on the model before anything runs (`faults.rs`), and a two-sided
//! CUSUM (Page 1954) sums the projection of every block on it. Once one reaches its threshold something is off; the path is
//! that of the likeliest fault over the blocks since the onset, whose signs lie most along it, and of several that are as good
//! the commonest.
//!
//! The threshold follows from the stated rate of false alarms by Siegmund's approximation (Siegmund 1985, Sequential
//! Analysis, eq. 2.57): a CUSUM of unit-variance increments with drift `-d` and threshold `h` runs
//! `(exp(2 d b) - 2 d b - 1)/(2 d^2)` blocks to a false alarm on average, `b = h + 1.166`. `d` is the reference value
//! less two standard errors of the learnt mean, so that a mean learnt wrong is in the rate. Onset is when the
//! sum last stood at zero.
//!
//! A path that is off is so until that sum of its own stands at zero again. What a fault does to
//! other signs would raise the other paths' sums too: they begin anew then, over the
//! channels that it leaves alone. So a second fault is found beside a first, where it shows in any of those.
//!
//! What is off from the start is learnt as usual and no sum rises of it: so beside the sums stands what each residual is
//! lately against the rig as stated, learnt or not.
//!
//! An ambient flow that changes and is not measured is off the model's path too, and shows as `flow`.

mod channels;
mod cusum;
mod faults;

use crate::model::ControlModel;
use crate::signals::Measurement;

use channels::{Block, CHANNELS, Channels, DRIVE, GAIN, SIGNS, THRUST, TORQUE, WATER, WAYS, ZERO, sign};
pub use cusum::threshold;
use cusum::{Cusum, LEAST, Lately, Onset, Usual};
use faults::{FAULTS, Sides, rehearsed};

/// Where a mismatch is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Path {
    /// Between command and current.
    Drive,
    /// Torque on the shaft that is not the blades'.
    Shaft,
    /// Lift and drag.
    Blade,
    /// The axial flow.
    Flow,
    /// A sensor alone.
    Sensor,
}

impl Path {
    /// Every path.
    pub const ALL: [Self; 5] = [Self::Drive, Self::Shaft, Self::Blade, Self::Flow, Self::Sensor];

    /// Name as in a diagnosis.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Drive => "drive",
            Self::Shaft => "shaft",
            Self::Blade => "blade",
            Self::Flow => "flow",
            Self::Sensor => "sensor",
        }
    }
}

/// Length of a block, s.
pub const BLOCK_S: f64 = 2.0;
/// Blocks from which mean and spread are known well enough to begin: five minutes of driving.
pub const LEARNT: u32 = 150;

/// Blocks that a path is named from: a minute.
const KEPT: usize = 32;

/// Share of the likeliest from which another fault is as good: how they are driven changes directions by a few percent.
const AS_GOOD: f64 = 0.97;

/// Least share of a fault, squared, that a block must say something of.
const ENOUGH: f64 = 0.1;
/// Share of a fault from which it touches a channel.
const TOUCHED: f64 = 0.01;

/// What is told of a block beside the paths: in proportion, of every channel; thrust's constant; and the lateness of the current.
pub const RESIDUALS: usize = 6;
const TOLD: [usize; RESIDUALS - 1] =
    [sign(DRIVE, GAIN), sign(TORQUE, GAIN), sign(THRUST, GAIN), sign(WATER, GAIN), sign(THRUST, ZERO)];

/// What the monitor says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// The CUSUM of each path over its threshold, in the order of [`Path::ALL`]: 1 is an alarm, and no sum goes beyond.
    pub level: [f64; 5],
    /// The path that went off last, of those that still are.
    pub alarm: Option<Path>,
    /// Time since its onset, s, driven or not; zero without an alarm.
    pub since_s: f64,
    /// Mean and spread are still being learnt.
    pub learning: bool,
    /// What each residual was in the last minute of driving, as a share of what the model expects: current, torque, thrust and
    /// flow, thrust of a sensor at rest, and current that comes late. None before there was a block that says anything.
    pub lately: [Option<f64>; RESIDUALS],
}

/// The running monitor. Plain data: no allocation, a bounded time a tick.
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    threshold: f64,
    /// Time that passed since it was made, driven or not, s, and what it was when the block began to be driven.
    clock_s: f64,
    began_s: f64,
    channels: Channels,
    usual: [Usual; SIGNS],
    lately: [Lately; RESIDUALS],
    faults: [(Path, Sides, [f64; SIGNS]); FAULTS],
    cusums: [Cusum; FAULTS],
    /// The last blocks, standardised: a ring, and the place of the oldest.
    kept: [[Option<f64>; SIGNS]; KEPT],
    /// The same as they were, to be learnt when they leave it; none while something is off.
    to_learn: [Block; KEPT],
    oldest: usize,
    /// Which faults are off: how many went off up to each, zero for one that is not.
    off: [u32; FAULTS],
}

/// What a run of the monitor is given at a tick.
#[derive(Clone, Copy, Debug)]
pub struct Seen<'a> {
    /// The model of the rig as stated, with what it is known to have.
    pub model: &'a ControlModel,
    /// Measurements as ideal sensors would show them.
    pub measured: &'a Measurement,
    /// Current that was asked for and has reached the drive, and the one that it shows, A; `None` where no current is
    /// measured.
    pub drive_a: Option<(f64, f64)>,
    /// The thruster is driven: a drive at rest or disarmed says nothing.
    pub driving: bool,
    /// Time since the last tick, s, as the statistics take it.
    pub dt_s: f64,
}

impl Monitor {
    /// For a model, with a rate of false alarms a day.
    pub fn new(model: &ControlModel, alarms_per_day: f64) -> Self {
        Self {
            threshold: threshold(alarms_per_day, FAULTS),
            clock_s: 0.0,
            began_s: 0.0,
            channels: Channels::default(),
            usual: [Usual::default(); SIGNS],
            lately: [Lately::default(); RESIDUALS],
            faults: rehearsed(model),
            cusums: [Cusum::default(); FAULTS],
            kept: [[None; SIGNS]; KEPT],
            to_learn: [[None; SIGNS]; KEPT],
            oldest: 0,
            off: [0; FAULTS],
        }
    }

    /// Forgets alarms and sums; what is usual stays.
    pub fn clear(&mut self) {
        self.cusums = [Cusum::default(); FAULTS];
        self.off = [0; FAULTS];
    }

    /// Time passes, s, driven or not and however long: onsets are told by it, and nothing else counts it.
    pub fn passes(&mut self, time_s: f64) {
        self.clock_s += time_s;
    }

    /// One tick.
    pub fn tick(&mut self, seen: &Seen) {
        let before_s = self.channels.time_s;
        self.channels.tick(seen);
        if before_s == 0.0 && self.channels.time_s > 0.0 {
            self.began_s = self.clock_s - seen.dt_s;
        }
        if self.channels.time_s >= BLOCK_S {
            self.end_block();
        }
    }

    fn end_block(&mut self) {
        let late = self.channels.late_share();
        let block = self.channels.block();
        let told = TOLD.into_iter().map(|k| block[k].map(|sign| sign.value)).chain([late]);
        for (lately, x) in self.lately.iter_mut().zip(told) {
            x.into_iter().for_each(|x| lately.take(x));
        }
        let mut z = [None; SIGNS];
        for (i, usual) in self.usual.iter_mut().enumerate() {
            if usual.n < LEARNT {
                block[i].into_iter().for_each(|sign| usual.take(sign));
            } else {
                z[i] = block[i].map(|sign| usual.standardised(sign, LEAST[i % WAYS]));
            }
        }
        self.learn_oldest();
        // What was learnt as it came is not learnt again.
        self.to_learn[self.oldest] = std::array::from_fn(|i| z[i].and(block[i]));
        self.kept[self.oldest] = z;
        self.oldest = (self.oldest + 1) % KEPT;
        let views = self.views();
        for ((cusum, view), (_, sides, _)) in self.cusums.iter_mut().zip(&views).zip(&self.faults) {
            let (along, length) = projected(view, &z);
            if length > ENOUGH {
                cusum.take(along / length.sqrt(), *sides, self.threshold, self.began_s);
            }
        }
        self.judge(&views);
    }

    /// Learns the block that is about to leave the ring. Once something is off, nothing that may have shown it is learnt.
    fn learn_oldest(&mut self) {
        if self.off.iter().any(|off| *off > 0) {
            self.to_learn = [[None; SIGNS]; KEPT];
        }
        for (usual, sign) in self.usual.iter_mut().zip(self.to_learn[self.oldest]) {
            sign.into_iter().for_each(|sign| usual.take(sign));
        }
    }

    /// Each fault's direction in standard deviations, of length one; of what a fault of another path touches that is off, nothing.
    fn views(&self) -> [[f64; SIGNS]; FAULTS] {
        let mut views = self.faults.map(|(.., direction)| {
            let in_deviations = |i: usize| match &self.usual[i] {
                usual if usual.n >= LEARNT => direction[i] / usual.spread(LEAST[i % WAYS]),
                _ => 0.0,
            };
            let view: [f64; SIGNS] = std::array::from_fn(in_deviations);
            let length = view.iter().map(|d| d * d).sum::<f64>().sqrt();
            if length > 0.0 { view.map(|d| d / length) } else { view }
        });
        let mut touched = [[false; CHANNELS]; Path::ALL.len()];
        for (view, (path, ..)) in
            views.iter().zip(&self.faults).zip(self.off).filter(|x| x.1 > 0).map(|x| x.0)
        {
            for (i, _) in view.iter().enumerate().filter(|(_, d)| d.abs() > TOUCHED) {
                Path::ALL.iter().filter(|p| *p != path).for_each(|p| touched[*p as usize][i / WAYS] = true);
            }
        }
        // A fault that is off itself goes on as it is, or it would never be let go of.
        for (view, (path, ..)) in
            views.iter_mut().zip(&self.faults).zip(self.off).filter(|x| x.1 == 0).map(|x| x.0)
        {
            for (channel, signs) in view.chunks_exact_mut(WAYS).enumerate() {
                if touched[*path as usize][channel] {
                    signs.fill(0.0);
                }
            }
        }
        views
    }

    /// What the blocks since an onset say along a fault, standard deviations: the square is twice the logarithm of its likelihood.
    fn likely(&self, view: &[f64; SIGNS], sides: Sides, driven_s: f64) -> f64 {
        let blocks = ((driven_s / BLOCK_S).round() as usize).clamp(1, KEPT);
        let (mut along, mut length) = (0.0, 0.0);
        for back in 1..=blocks {
            let (a, l) = projected(view, &self.kept[(self.oldest + KEPT - back) % KEPT]);
            if l > ENOUGH {
                (along, length) = (along + a, length + l);
            }
        }
        let likely = if length > 0.0 { along / length.sqrt() } else { 0.0 };
        if sides == Sides::One { likely.max(0.0) } else { likely }
    }

    fn judge(&mut self, views: &[[f64; SIGNS]; FAULTS]) {
        let sums = self.cusums.map(|c| c.level().0);
        for (off, sum) in self.off.iter_mut().zip(sums) {
            if sum == 0.0 {
                *off = 0;
            }
        }
        // That something is off is what a sum says; which it is says the likeliest, the others being what it does to them.
        // What else is seen of a path that is off already is no news.
        let full = |k: &usize| sums[*k] >= self.threshold && !self.is_off(self.faults[*k].0);
        let onsets = (0..FAULTS).filter(full).map(|k| self.cusums[k].level().1);
        let Some(onset) = onsets.min_by(|a, b| a.driven_s.total_cmp(&b.driven_s)) else { return };
        if let Some((fault, side)) = self.likeliest(views, onset.driven_s) {
            self.goes_off(fault, side, onset);
        }
    }

    /// Whether a fault of a path is off.
    fn is_off(&self, path: Path) -> bool {
        self.faults.iter().zip(self.off).any(|((other, ..), off)| *other == path && off > 0)
    }

    /// The likeliest of the faults on paths that are not off, and its side: of those that are as good as likeliest the commonest.
    fn likeliest(&self, views: &[[f64; SIGNS]; FAULTS], driven_s: f64) -> Option<(usize, usize)> {
        let along: [f64; FAULTS] = std::array::from_fn(|k| {
            let (path, sides, _) = self.faults[k];
            if self.is_off(path) { 0.0 } else { self.likely(&views[k], sides, driven_s) }
        });
        let most = along.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let fault = along.iter().position(|x| most > 0.0 && x.abs() >= AS_GOOD * most)?;
        Some((fault, usize::from(along[fault] < 0.0)))
    }

    /// A fault goes off; the other paths begin anew.
    fn goes_off(&mut self, fault: usize, side: usize, onset: Onset) {
        self.cusums[fault].fill(side, self.threshold, onset);
        self.off[fault] = 1 + self.off.iter().max().copied().unwrap_or(0);
        for k in 0..FAULTS {
            if self.off[k] == 0 && self.faults[k].0 != self.faults[fault].0 {
                self.cusums[k] = Cusum::default();
            }
        }
    }

    /// The fault that went off last, of those that still are.
    fn last_off(&self) -> Option<usize> {
        (0..FAULTS).filter(|k| self.off[*k] > 0).max_by_key(|k| self.off[*k])
    }

    /// Whether mean and spread are still being learnt.
    fn learning(&self) -> bool {
        // What is measured at all has been seen often enough; the rest may never be.
        self.usual.iter().all(|u| u.n < LEARNT)
    }

    /// What it says now.
    pub fn mismatch(&self) -> Mismatch {
        let mut level = [0.0; 5];
        for ((path, ..), cusum) in self.faults.iter().zip(&self.cusums) {
            let own = &mut level[*path as usize];
            *own = f64::max(*own, cusum.level().0 / self.threshold);
        }
        let last = self.last_off();
        let alarm = last.map(|k| self.faults[k].0);
        let since_s = last.map_or(0.0, |k| self.clock_s - self.cusums[k].level().1.at_s);
        let lately = self.lately.map(|lately| lately.mean());
        Mismatch { level, alarm, since_s, learning: self.learning(), lately }
    }
}

/// A block along a fault, and the square of the part of the fault that the block says anything of.
fn projected(view: &[f64; SIGNS], z: &[Option<f64>; SIGNS]) -> (f64, f64) {
    let known = view.iter().zip(z).filter_map(|(d, z)| z.map(|z| (d, z)));
    known.fold((0.0, 0.0), |(along, length), (d, z)| (along + d * z, length + d * d))
}

#[cfg(test)]
mod tests;
