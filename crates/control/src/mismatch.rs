//! Mismatch between thruster and model while it runs: which path has changed, and since when; and how far it is off.
//!
//! Beside every tick, from what is measured and commanded alone (not from an observer that would learn the mismatch
//! away): the drive's current behind its lag, the shaft's torque balance, the blades' thrust in a flow that the
//! model makes of the measured speed, and that flow. Over a block of time each residual becomes a share (torque, thrust
//! and flow missing or too many), is standardised with the mean and spread that the first blocks showed,
//! and is projected on what a fault of each path would do to all of them (the static map's own sensitivities to lift
//! and outflow tell blades and water from sensors). A two-sided CUSUM (Page 1954) sums each projection.
//!
//! The threshold follows from the stated rate of false alarms by Siegmund's approximation (Siegmund 1985, Sequential
//! Analysis, eq. 2.57): a CUSUM of unit-variance increments with drift `-d` and threshold `h` runs
//! `(exp(2 d b) - 2 d b - 1)/(2 d^2)` blocks to a false alarm on average, `b = h + 1.166`. `d` is the reference value
//! less two standard errors of the learnt mean, so that a mean learnt wrong is in the rate. Onset is when the
//! sum last stood at zero.
//!
//! A path whose sum reaches the threshold is off until that sum of its own stands at zero again. What a fault does to
//! other residuals would raise the other paths' sums too: they begin anew then, over the
//! residuals that it leaves alone. So a second fault is found beside a first, where it shows in any of those.
//!
//! What is off from the start is learnt as usual and no sum rises of it: so beside the sums stands what each residual is
//! lately against the rig as stated, learnt or not.
//!
//! An ambient flow that changes and is not measured is off the model's path too, and shows as `flow`.

mod cusum;

use crate::model::ControlModel;
use crate::signals::Measurement;

pub use cusum::threshold;
use cusum::{Cusum, Lately, Usual};

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
/// Blocks that mean and spread are learnt from: five minutes of driving.
pub const LEARNT: u32 = 150;
/// Excitation, share of full squared, below which a block says nothing.
const EXCITED: f64 = 0.01;

/// Residuals of a block.
pub const RESIDUALS: usize = 6;
const DRIVE: usize = 0;
const TORQUE: usize = 1;
const THRUST: usize = 2;
const WATER: usize = 3;
const BIAS: usize = 4;
const LATE: usize = 5;
type Block = [Option<f64>; RESIDUALS];

/// Faults that are told apart: the path, and what it does to the residuals.
const FAULTS: usize = 8;

/// What the monitor says.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mismatch {
    /// The CUSUM of each path over its threshold, in the order of [`Path::ALL`]: 1 is an alarm, and no sum goes beyond.
    pub level: [f64; 5],
    /// The path that went off last, of those that still are.
    pub alarm: Option<Path>,
    /// Time since its onset, s; zero without an alarm.
    pub since_s: f64,
    /// Mean and spread are still being learnt.
    pub learning: bool,
    /// What each residual was in the last minute of driving, as a share of what the model expects: current, torque, thrust and
    /// flow, thrust of a sensor at rest, and current that comes late. None before there was a block that says anything.
    pub lately: [Option<f64>; RESIDUALS],
}

/// Sums of one block.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    time_s: f64,
    ticks: f64,
    drive: [f64; 3],
    torque: [f64; 2],
    thrust: [f64; 2],
    water: [f64; 2],
    bias: [f64; 2],
}

/// The running monitor. Plain data: no allocation, a bounded time a tick.
#[derive(Clone, Copy, Debug)]
pub struct Monitor {
    threshold: f64,
    sums: Sums,
    usual: [Usual; RESIDUALS],
    lately: [Lately; RESIDUALS],
    faults: [(Path, [f64; RESIDUALS]); FAULTS],
    cusums: [Cusum; FAULTS],
    flow_m_s: f64,
    drive: f64,
    last_speed_rad_s: Option<f64>,
    filtered_torque: [f64; 2],
    filtered_thrust_n: f64,
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
    /// Time since the last tick, s.
    pub dt_s: f64,
}

/// Relative change of torque, thrust and flow at a given shaft speed for a relative change of a coefficient, in still water.
fn sensitivity(model: &ControlModel, change: impl Fn(&mut ControlModel, f64)) -> [f64; RESIDUALS] {
    let by = 0.02;
    let mut other = *model;
    change(&mut other, 1.0 + by);
    other.refresh();
    let (a, b) = (&model.map, &other.map);
    let mut direction = [0.0; RESIDUALS];
    direction[TORQUE] = (b.torque_n_m_s2 / a.torque_n_m_s2 - 1.0) / by;
    direction[THRUST] = (b.thrust_n_s2 / a.thrust_n_s2 - 1.0) / by;
    direction[WATER] = (b.flow_m / a.flow_m - 1.0) / by;
    direction
}

impl Monitor {
    /// For a model, with a rate of false alarms a day.
    pub fn new(model: &ControlModel, alarms_per_day: f64) -> Self {
        let one = |residual: usize| std::array::from_fn(|i| if i == residual { 1.0 } else { 0.0 });
        let blade = |m: &mut ControlModel, by: f64| m.blade.lift_max *= by;
        let outflow = |m: &mut ControlModel, by: f64| m.flux_coefficient *= by;
        Self {
            threshold: threshold(alarms_per_day, FAULTS),
            sums: Sums::default(),
            usual: [Usual::default(); RESIDUALS],
            lately: [Lately::default(); RESIDUALS],
            faults: [
                (Path::Drive, one(DRIVE)),
                (Path::Drive, one(LATE)),
                (Path::Shaft, one(TORQUE)),
                (Path::Blade, sensitivity(model, blade)),
                (Path::Flow, sensitivity(model, outflow)),
                (Path::Sensor, one(THRUST)),
                (Path::Sensor, one(WATER)),
                (Path::Sensor, one(BIAS)),
            ],
            cusums: [Cusum::default(); FAULTS],
            flow_m_s: 0.0,
            drive: 0.0,
            last_speed_rad_s: None,
            filtered_torque: [0.0; 2],
            filtered_thrust_n: 0.0,
            off: [0; FAULTS],
        }
    }

    /// Forgets alarms and sums; what is usual stays.
    pub fn clear(&mut self) {
        self.cusums = [Cusum::default(); FAULTS];
        self.off = [0; FAULTS];
    }

    /// One tick.
    pub fn tick(&mut self, seen: &Seen) {
        let Some(speed) = seen.measured.shaft_speed_rad_s else {
            self.last_speed_rad_s = None;
            return;
        };
        let (model, dt) = (seen.model, seen.dt_s);
        let before = self.last_speed_rad_s.replace(speed).unwrap_or(speed);
        let load = self.water(model, seen.measured, 0.5 * (before + speed), dt);
        if !seen.driving {
            return;
        }
        self.sums.time_s += dt;
        self.sums.ticks += 1.0;
        self.drive(seen);
        let turning = model.sense(speed);
        let full_n_m = model.torque_constant_nm_a * model.current_limit_a;
        if let Some(current) = seen.measured.current_a {
            // Both sides through one filter, so that the speed's derivative is never taken.
            let left = (-dt * FILTER_PER_S).exp();
            let [passed, lagged] = &mut self.filtered_torque;
            let torque = model.torque_constant_nm_a * current - model.friction_n_m(speed) - load.torque_n_m;
            *passed = torque + (*passed - torque) * left;
            *lagged = speed + (*lagged - speed) * left;
            let missing = (*passed - model.inertia_kg_m2 * FILTER_PER_S * (speed - *lagged)) / full_n_m;
            let expected = load.torque_n_m / full_n_m;
            self.sums.torque[0] += missing * turning * expected.abs();
            self.sums.torque[1] += expected * expected;
        }
        if let Some(thrust) = seen.measured.thrust_n {
            let behind = dt / (model.thrust_filter_s + dt);
            self.filtered_thrust_n += (load.thrust_n - self.filtered_thrust_n) * behind;
            let (missing, expected) = (
                (thrust - self.filtered_thrust_n) / model.thrust_max_n,
                self.filtered_thrust_n / model.thrust_max_n,
            );
            self.sums.thrust[0] += missing * expected;
            self.sums.thrust[1] += expected * expected;
            // What stays while thrust is small is the sensor's own.
            let small = 1.0 / (1.0 + (expected / 0.1).powi(2));
            self.sums.bias[0] += small * missing;
            self.sums.bias[1] += small;
        }
        if let Some(flow) = seen.measured.flow_m_s {
            let full = model.map.flow_m * model.speed_max_rad_s;
            let (missing, expected) = ((flow - self.flow_m_s) / full, self.flow_m_s / full);
            self.sums.water[0] += missing * expected;
            self.sums.water[1] += expected * expected;
        }
        if self.sums.time_s >= BLOCK_S {
            self.end_block();
        }
    }

    /// The flow that the model makes of the measured speed; its load.
    fn water(
        &mut self,
        model: &ControlModel,
        measured: &Measurement,
        speed: f64,
        dt: f64,
    ) -> kort_thruster::blade::BladeLoad {
        let ambient = measured.ambient_m_s.unwrap_or(model.ambient_mean_m_s);
        let parts = (dt / model.step_max_s).ceil().clamp(1.0, 16.0);
        let mut load = model.load(speed, self.flow_m_s, 0.0);
        for _ in 0..parts as u32 {
            let h = dt / parts;
            let middle =
                self.flow_m_s + 0.5 * h * model.flow_acceleration(load.thrust_n, self.flow_m_s, ambient);
            let there = model.load(speed, middle, 0.0);
            self.flow_m_s += h * model.flow_acceleration(there.thrust_n, middle, ambient);
            load = model.load(speed, self.flow_m_s, 0.0);
        }
        if !self.flow_m_s.is_finite() {
            self.flow_m_s = 0.0;
        }
        load
    }

    /// What the drive gave of what it was asked: its share, and how much of it was late.
    fn drive(&mut self, seen: &Seen) {
        let Some((asked, current)) = seen.drive_a else { return };
        let model = seen.model;
        let keep = if model.amplifier_lag_s > 0.0 { (-seen.dt_s / model.amplifier_lag_s).exp() } else { 0.0 };
        let before = self.drive;
        self.drive = asked + (self.drive - asked) * keep;
        let limit = model.current_limit_a;
        let (missing, expected) = ((current - self.drive) / limit, self.drive / limit);
        self.sums.drive[0] += missing * expected;
        self.sums.drive[1] += expected * expected;
        // Against its own change: what comes too late is missing while it rises.
        self.sums.drive[2] +=
            missing * (self.drive - before).signum() * f64::from(u8::from(self.drive != before));
    }

    fn end_block(&mut self) {
        let sums = std::mem::take(&mut self.sums);
        let share = |[missing, squares]: [f64; 2]| {
            (squares > EXCITED * sums.ticks).then(|| missing / squares).filter(|x: &f64| x.is_finite())
        };
        let drives = sums.drive[1] > EXCITED * sums.ticks;
        let block: Block = [
            share([sums.drive[0], sums.drive[1]]),
            share(sums.torque),
            share(sums.thrust),
            share(sums.water),
            (sums.bias[1] > 0.1 * sums.ticks).then(|| sums.bias[0] / sums.bias[1]),
            drives.then(|| sums.drive[2] / sums.ticks),
        ];
        let mut z = [None; RESIDUALS];
        for (((x, usual), lately), z) in
            block.into_iter().zip(&mut self.usual).zip(&mut self.lately).zip(&mut z)
        {
            let Some(x) = x else { continue };
            lately.take(x);
            *z = usual.standardised(x);
            if z.is_none() {
                usual.take(x);
            }
        }
        for fault in 0..FAULTS {
            let (path, direction) = self.faults[fault];
            // In standard deviations, over what this block says anything of and no other path that is off touches.
            let (mut along, mut length) = (0.0, 0.0);
            for i in (0..RESIDUALS).filter(|i| !self.touched(*i, path)) {
                if let Some(z) = z[i] {
                    let d = direction[i] / self.usual[i].spread();
                    along += d * z;
                    length += d * d;
                }
            }
            if length > 0.0 {
                self.cusums[fault].take(along / length.sqrt(), self.threshold, BLOCK_S);
            }
        }
        self.judge();
    }

    /// Whether a fault that is off on another path changes a residual.
    fn touched(&self, residual: usize, path: Path) -> bool {
        let mut off = self.faults.iter().zip(self.off).filter(|(_, off)| *off > 0);
        off.any(|((other, direction), _)| *other != path && direction[residual] != 0.0)
    }

    fn judge(&mut self) {
        let sums = self.cusums.map(|c| c.level().0);
        for (off, sum) in self.off.iter_mut().zip(sums) {
            if sum == 0.0 {
                *off = 0;
            }
        }
        let fresh = (0..FAULTS).filter(|k| self.off[*k] == 0 && sums[*k] >= self.threshold);
        // Of several in one block the one that rose fastest: the others may be what it does to them.
        let since = |k: &usize| self.cusums[*k].level().1;
        let Some(worst) = fresh.min_by(|a, b| since(a).total_cmp(&since(b))) else { return };
        self.off[worst] = 1 + self.off.iter().max().copied().unwrap_or(0);
        for k in 0..FAULTS {
            if self.off[k] == 0 && self.faults[k].0 != self.faults[worst].0 {
                self.cusums[k] = Cusum::default();
            }
        }
    }

    /// Whether mean and spread are still being learnt.
    fn learning(&self) -> bool {
        // What is measured at all has been seen often enough; the rest may never be.
        self.usual.iter().all(|u| u.n < LEARNT)
    }

    /// What it says now.
    pub fn mismatch(&self) -> Mismatch {
        let mut level = [0.0; 5];
        for ((path, _), cusum) in self.faults.iter().zip(&self.cusums) {
            let own = &mut level[*path as usize];
            *own = f64::max(*own, cusum.level().0 / self.threshold);
        }
        let last = (0..FAULTS).filter(|k| self.off[*k] > 0).max_by_key(|k| self.off[*k]);
        let alarm = last.map(|k| self.faults[k].0);
        let since_s = last.map_or(0.0, |k| self.cusums[k].level().1 + self.sums.time_s);
        let lately = self.lately.map(|lately| lately.mean());
        Mismatch { level, alarm, since_s, learning: self.learning(), lately }
    }
}

/// Corner of the filter on both sides of the torque balance, 1/s.
const FILTER_PER_S: f64 = 20.0;
