//! What is measured beside what the model makes of it, channel by channel, and over a block of time how the one is off the
//! other: in proportion, late, by a constant, and restless.

use kort_thruster::blade::BladeLoad;

use super::Seen;
use crate::model::ControlModel;

/// Current of the drive, torque on the shaft, thrust, flow.
pub(super) const CHANNELS: usize = 4;
pub(super) const DRIVE: usize = 0;
pub(super) const TORQUE: usize = 1;
pub(super) const THRUST: usize = 2;
pub(super) const WATER: usize = 3;

/// How a channel is off, for each.
pub(super) const WAYS: usize = 4;
/// In proportion to what is expected, 1.
pub(super) const GAIN: usize = 0;
/// Against the rate of change of what is expected, over a filter's time: negative what comes late by that share of it. For torque
/// it is the share of the inertia that is too much.
pub(super) const LATE: usize = 1;
/// By a constant, shares of full scale.
pub(super) const ZERO: usize = 2;
/// Logarithm of the mean square of what is faster than the filter.
pub(super) const RESTLESS: usize = 3;

/// What a block says of each channel and way.
pub(super) const SIGNS: usize = CHANNELS * WAYS;
pub(super) type Block = [Option<Sign>; SIGNS];

/// What a block says of one.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sign {
    pub(super) value: f64,
    /// Mean square of what it was told by, share of full scale squared: of noise that is there anyway a value has the more, the
    /// less that is.
    pub(super) excitation: f64,
}

/// Place of a channel's way.
pub(super) const fn sign(channel: usize, way: usize) -> usize {
    channel * WAYS + way
}

/// Corner of the filter on both sides of every balance, 1/s: no derivative is ever taken.
const FILTER_PER_S: f64 = 20.0;
/// Excitation, share of full scale squared, below which a block says nothing in proportion, or of lateness.
const EXCITED: [f64; 2] = [0.01, 1e-4];
/// Share of the ticks that must be left to tell a constant from the rest.
const APART: f64 = 0.1;

/// Sums of one block for the regression of what is missing on what is expected, its rate of change and a constant.
#[derive(Clone, Copy, Debug, Default)]
struct Fit {
    ticks: f64,
    /// Products of level, rate and one among themselves: level-level, level-rate, level, rate-rate, rate.
    among: [f64; 5],
    /// Of what is missing with level, rate and one.
    missing: [f64; 3],
    fast: f64,
}

impl Fit {
    fn take(&mut self, missing: f64, level: f64, rate: f64, fast: f64) {
        self.ticks += 1.0;
        let among = [level * level, level * rate, level, rate * rate, rate];
        self.among.iter_mut().zip(among).for_each(|(sum, x)| *sum += x);
        self.missing.iter_mut().zip([level, rate, 1.0]).for_each(|(sum, x)| *sum += missing * x);
        self.fast += fast * fast;
    }

    /// One after the other (Gram and Schmidt): in proportion all that can be, late what the level leaves, constant what both
    /// leave. So steady running, which cannot tell a constant from a gain, still says that something is missing.
    fn ways(&self) -> [Option<Sign>; WAYS] {
        let [ll, lr, l, rr, r] = self.among;
        let [ml, mr, m] = self.missing;
        let n = self.ticks;
        let mut ways = [None; WAYS];
        let told = |by: f64, energy: f64| Some(Sign { value: by / energy, excitation: energy / n });
        let (mut rr, mut r, mut mr) = (rr, r, mr);
        let (mut ones, mut m) = (n, m);
        if ll > EXCITED[0] * n {
            ways[GAIN] = told(ml, ll);
            let by = lr / ll;
            (rr, r, mr) = (rr - by * lr, r - by * l, mr - by * ml);
            (ones, m) = (ones - l * l / ll, m - l * ml / ll);
        }
        if rr > EXCITED[1] * n {
            ways[LATE] = told(mr, rr);
            (ones, m) = (ones - r * r / rr, m - r * mr / rr);
        }
        if n > 0.0 && ones > APART * n {
            ways[ZERO] = told(m, ones);
        }
        if n > 0.0 && self.fast > 0.0 {
            ways[RESTLESS] = Some(Sign { value: (self.fast / n).ln(), excitation: 1.0 });
        }
        ways.map(|way| way.filter(|sign| sign.value.is_finite()))
    }
}

/// First-order low pass.
#[derive(Clone, Copy, Debug, Default)]
struct Low(f64);

impl Low {
    fn step(&mut self, x: f64, left: f64) -> f64 {
        self.0 = x + (self.0 - x) * left;
        self.0
    }
}

/// The channels as they run.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Channels {
    pub(super) time_s: f64,
    flow_m_s: f64,
    drive_a: f64,
    thrust_n: f64,
    last_speed_rad_s: Option<f64>,
    speed: Low,
    /// Current, thrust and flow behind the filter that the speed stands behind: what the model makes of that speed comes as late.
    behind: [Low; CHANNELS],
    /// What is missing and what is expected of each channel.
    missing: [Low; CHANNELS],
    expected: [Low; CHANNELS],
    fits: [Fit; CHANNELS],
}

impl Channels {
    /// One tick.
    pub(super) fn tick(&mut self, seen: &Seen) {
        let Some(speed) = seen.measured.shaft_speed_rad_s else {
            self.last_speed_rad_s = None;
            return;
        };
        let (model, dt) = (seen.model, seen.dt_s);
        let before = self.last_speed_rad_s.replace(speed).unwrap_or(speed);
        let ambient = seen.measured.ambient_m_s.unwrap_or(model.ambient_mean_m_s);
        let load = water(model, &mut self.flow_m_s, 0.5 * (before + speed), ambient, dt);
        if !seen.driving {
            return;
        }
        self.time_s += dt;
        let left = (-dt * FILTER_PER_S).exp();
        let slow = self.speed.step(speed, left);
        let late = if model.speed_filter_s > 0.0 { (-dt / model.speed_filter_s).exp() } else { 0.0 };
        if let Some((asked, current)) = seen.drive_a {
            let lag = model.amplifier_lag_s;
            let keep = if lag > 0.0 { (-dt / lag).exp() } else { 0.0 };
            self.drive_a = asked + (self.drive_a - asked) * keep;
            self.level(DRIVE, current, self.drive_a, model.current_limit_a, left);
        }
        if let Some(current) = seen.measured.current_a {
            let full_n_m = model.torque_constant_nm_a * model.current_limit_a;
            let current = self.behind[TORQUE].step(current, late);
            let given = model.torque_constant_nm_a * current - model.friction_n_m(speed) - load.torque_n_m;
            let rate = model.inertia_kg_m2 * FILTER_PER_S * (speed - slow) / full_n_m;
            let missing = self.missing[TORQUE].step(given / full_n_m, left) - rate;
            let level = self.expected[TORQUE].step(load.torque_n_m / full_n_m, left);
            self.fits[TORQUE].take(missing, level, rate, missing);
        }
        if let Some(thrust) = seen.measured.thrust_n {
            self.thrust_n += (load.thrust_n - self.thrust_n) * dt / (model.thrust_filter_s + dt);
            let thrust = self.behind[THRUST].step(thrust, late);
            self.level(THRUST, thrust, self.thrust_n, model.thrust_max_n, left);
        }
        if let Some(flow) = seen.measured.flow_m_s {
            let flow = self.behind[WATER].step(flow, late);
            self.level(WATER, flow, self.flow_m_s, model.map.flow_m * model.speed_max_rad_s, left);
        }
    }

    fn level(&mut self, channel: usize, measured: f64, expected: f64, full: f64, left: f64) {
        let (missing, expected) = ((measured - expected) / full, expected / full);
        let slow = self.missing[channel].step(missing, left);
        let level = self.expected[channel].step(expected, left);
        self.fits[channel].take(slow, level, expected - level, missing - slow);
    }

    /// How much of the drive's largest current is late so far in the block, root mean square; negative where it lags.
    pub(super) fn late_share(&self) -> Option<f64> {
        let fit = &self.fits[DRIVE];
        fit.ways()[LATE].map(|late| late.value * (fit.among[3] / fit.ticks).sqrt())
    }

    /// Ends the block: what it says.
    pub(super) fn block(&mut self) -> Block {
        self.time_s = 0.0;
        let ways = std::mem::take(&mut self.fits).map(|fit| fit.ways());
        std::array::from_fn(|k| ways[k / WAYS][k % WAYS])
    }
}

/// One step of the flow that the model makes of a shaft speed; its load.
pub(super) fn water(
    model: &ControlModel,
    flow_m_s: &mut f64,
    speed_rad_s: f64,
    ambient_m_s: f64,
    dt_s: f64,
) -> BladeLoad {
    let parts = (dt_s / model.step_max_s).ceil().clamp(1.0, 16.0);
    let mut load = model.load(speed_rad_s, *flow_m_s, 0.0);
    for _ in 0..parts as u32 {
        let h = dt_s / parts;
        let middle = *flow_m_s + 0.5 * h * model.flow_acceleration(load.thrust_n, *flow_m_s, ambient_m_s);
        let there = model.load(speed_rad_s, middle, 0.0);
        *flow_m_s += h * model.flow_acceleration(there.thrust_n, middle, ambient_m_s);
        load = model.load(speed_rad_s, *flow_m_s, 0.0);
    }
    if !flow_m_s.is_finite() {
        *flow_m_s = 0.0;
    }
    load
}
