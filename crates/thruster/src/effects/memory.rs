//! What effects remember from tick to tick: a past signal, a first-order lag, a running mean, and both in a row.

use super::Context;
use crate::parameters::Parameter as P;
use crate::real::Real;

/// The past of a signal sampled once a tick. Before the first sample the signal is taken as
/// constant.
pub(super) struct History<T> {
    tick_s: f64,
    ring: Vec<T>,
    newest: usize,
    empty: bool,
}

impl<T: Real> History<T> {
    /// Room for delays up to `longest_s`.
    pub fn new(longest_s: f64, tick_s: f64) -> Self {
        let ticks = (longest_s.max(0.0) / tick_s).ceil() as usize;
        Self { tick_s, ring: vec![T::ZERO; ticks + 2], newest: 0, empty: true }
    }

    /// The sample of this tick.
    pub fn push(&mut self, sample: T) {
        if self.empty {
            self.ring.fill(sample);
            self.empty = false;
        }
        self.newest = if self.newest + 1 == self.ring.len() { 0 } else { self.newest + 1 };
        self.ring[self.newest] = sample;
    }

    /// The signal `delay_s` before the newest sample; the two neighbouring ticks are mixed, so
    /// that the answer is continuous in the delay.
    pub fn ago(&self, delay_s: T) -> T {
        let (whole, part) = self.split(delay_s / self.tick_s);
        self.back(whole) * (T::ONE - part) + self.back(whole + 1) * part
    }

    /// Whole ticks and a part of one, as far back as there is room.
    fn split(&self, ticks: T) -> (usize, T) {
        let last = self.ring.len() - 1;
        let ticks = ticks.max(T::ZERO).min(T::from(last as f64));
        let whole = (ticks.re() as usize).min(last - 1);
        (whole, ticks - whole as f64)
    }

    /// The sample so many ticks before the newest.
    fn back(&self, ticks: usize) -> T {
        self.ring[(self.newest + self.ring.len() - ticks) % self.ring.len()]
    }
}

/// Exact first-order lag of a signal that runs straight from sample to sample.
pub(crate) struct FirstOrder<T> {
    input: T,
    output: T,
    started: bool,
}

impl<T: Real> FirstOrder<T> {
    /// Without a past.
    pub fn new() -> Self {
        Self { input: T::ZERO, output: T::ZERO, started: false }
    }

    /// The lagged signal at the end of a tick of `tick_s`, for a lag of `lag_s` (none below 1 ns).
    pub fn step(&mut self, input: T, lag_s: T, tick_s: f64) -> T {
        if !self.started {
            *self = Self { input, output: input, started: true };
            return input;
        }
        let step = input - self.input;
        self.output = if lag_s > 1e-9 {
            let behind = lag_s * step / tick_s;
            input - behind + (self.output - self.input + behind) * (T::from(-tick_s) / lag_s).exp()
        } else {
            // No lag, but the slope into one: the signal would trail.
            input - (lag_s - lag_s.re()) * step / tick_s
        };
        self.input = input;
        self.output
    }

    /// The mean over this tick of the lagged signal, for an input that is held over the tick.
    pub fn mean_of_held(&mut self, input: T, lag_s: T, tick_s: f64) -> T {
        if !self.started {
            *self = Self { input, output: input, started: true };
            return input;
        }
        let behind = self.output - input;
        if lag_s > 1e-3 * tick_s {
            let left = (T::from(-tick_s) / lag_s).exp();
            self.output = input + behind * left;
            input + behind * (T::ONE - left) * lag_s / tick_s
        } else {
            // Hardly a lag: what is left of the step is its area alone.
            self.output = input;
            input + behind * lag_s / tick_s
        }
    }
}

/// Exact answer of a lightly damped filter of second order, `x''/wn^2 + 2 z x'/wn + x = u`, to a signal that runs straight
/// from sample to sample.
pub(super) struct SecondOrder<T> {
    /// By how much a ramp's answer trails it: `2 z/wn`.
    behind_s: T,
    tick_s: f64,
    /// Free swing over one tick: e(t), e'(t) from e, e' at its start.
    free: [[T; 2]; 2],
    input: T,
    /// Position and its rate.
    swing: Option<[T; 2]>,
}

impl<T: Real> SecondOrder<T> {
    /// Without a past; `time_s` is 1/wn, the damping ratio below 1.
    pub fn new(time_s: T, damping_ratio: T, tick_s: f64) -> Self {
        let (wn, z) = (T::ONE / time_s, damping_ratio);
        let (decay, damped) = (z * wn, wn * (T::ONE - z * z).sqrt());
        let ((sin, cos), fall) = ((damped * tick_s).sin_cos(), (-decay * tick_s).exp());
        Self {
            behind_s: z * 2.0 / wn,
            tick_s,
            free: [
                [fall * (cos + decay / damped * sin), fall * sin / damped],
                [-fall * wn * wn / damped * sin, fall * (cos - decay / damped * sin)],
            ],
            input: T::ZERO,
            swing: None,
        }
    }

    /// Position and rate at the end of a tick: the swing about the forced answer to a ramp.
    pub fn step(&mut self, input: T) -> [T; 2] {
        let started = self.swing.is_some();
        let [position, rate] = self.swing.unwrap_or([input, T::ZERO]);
        let before = if started { self.input } else { input };
        let slope = (input - before) / self.tick_s;
        let (e, de) = (position - (before - self.behind_s * slope), rate - slope);
        let [[a, b], [c, d]] = self.free;
        let swing = [input - self.behind_s * slope + a * e + b * de, slope + c * e + d * de];
        (self.input, self.swing) = (input, Some(swing));
        swing
    }
}

/// The measuring chain of an encoder that runs ahead of the shaft by an angle of its own: differenced over a control period,
/// then filtered, as the plant does with the shaft's own angle; its rate itself on a rig that states neither.
pub(super) struct EncoderAhead<T> {
    /// How far it was ahead at the ticks of the last period, the oldest in turn.
    past_rad: Vec<T>,
    oldest: usize,
    started: bool,
    speed_rad_s: T,
    /// What a tick leaves of a filter's error; none where nothing is differenced.
    left: Option<T>,
    tick_s: f64,
}

impl<T: Real> EncoderAhead<T> {
    /// As far ahead as it is at first.
    pub fn new(context: &Context<T>) -> Self {
        let lag_s = context.parameters.get(P::SpeedFilterTimeConstantS);
        let left = if lag_s > 0.0 {
            Some((T::from(-context.tick_s) / lag_s).exp())
        } else {
            context.rig.sensors.encoder_counts_per_rev.map(|_| T::ZERO)
        };
        // A period may be several steps of a simulation.
        let period_s = context.rig.sensors.control_rate_hz.map_or(context.tick_s, |rate_hz| 1.0 / rate_hz);
        let ticks = (period_s / context.tick_s).round().max(1.0) as usize;
        Self {
            past_rad: vec![T::ZERO; ticks],
            oldest: 0,
            started: false,
            speed_rad_s: T::ZERO,
            left,
            tick_s: context.tick_s,
        }
    }

    /// What is shown on top of the shaft's speed, rad/s, at the end of a tick at which the encoder is so far ahead and
    /// gains so fast.
    pub fn step(&mut self, ahead_rad: T, rate_rad_s: T) -> T {
        let Some(left) = self.left else { return rate_rad_s };
        if !self.started {
            self.past_rad.fill(ahead_rad);
            self.started = true;
        }
        let ticks = self.past_rad.len();
        let before_rad = std::mem::replace(&mut self.past_rad[self.oldest], ahead_rad);
        self.oldest = (self.oldest + 1) % ticks;
        let raw = (ahead_rad - before_rad) / (self.tick_s * ticks as f64);
        self.speed_rad_s = raw + (self.speed_rad_s - raw) * left;
        self.speed_rad_s
    }
}

/// The mean over a window of a signal that runs straight from sample to sample. Before the first sample the signal
/// is taken as constant.
struct RunningMean<T> {
    window_s: T,
    signal: History<T>,
    /// Its integral since the first sample.
    integral: History<T>,
}

impl<T: Real> RunningMean<T> {
    fn new(window_s: T, longest_s: f64, tick_s: f64) -> Self {
        Self { window_s, signal: History::new(longest_s, tick_s), integral: History::new(longest_s, tick_s) }
    }

    fn step(&mut self, input: T) -> T {
        let (tick_s, last) = (self.signal.tick_s, self.signal.ring[self.signal.newest]);
        if self.signal.empty {
            // What it was before it was first sampled.
            let ticks = self.integral.ring.len();
            self.signal.push(input);
            (0..ticks).for_each(|k| self.integral.push(input * (k as f64 * tick_s)));
            return input;
        }
        self.signal.push(input);
        self.integral.push(self.integral.ring[self.integral.newest] + (input + last) * (0.5 * tick_s));
        let within = self.window_s / tick_s;
        if within < 1.0 {
            return input - (input - last) * within * 0.5;
        }
        (self.integral.ago(T::ZERO) - self.integral_ago(within)) / self.window_s
    }

    /// The integral so many ticks ago: a parabola between ticks.
    fn integral_ago(&self, ticks: T) -> T {
        let (whole, part) = self.signal.split(ticks);
        let (newer, older) = (self.signal.back(whole), self.signal.back(whole + 1));
        self.integral.back(whole) - (newer - (newer - older) * part * 0.5) * part * self.signal.tick_s
    }
}

/// A running mean and a first-order lag one after the other, that share a mean delay: the lag alone, the mean alone, and about
/// half way a filter of second order.
pub(super) struct MeanAndLag<T> {
    mean: RunningMean<T>,
    lag_s: T,
    lag: FirstOrder<T>,
    tick_s: f64,
}

impl<T: Real> MeanAndLag<T> {
    /// Without a past; there is room for delays up to `longest_s`. `mean_share` of the delay is the running mean's, over
    /// twice as long.
    pub fn new(delay_s: T, mean_share: T, longest_s: f64, tick_s: f64) -> Self {
        Self {
            mean: RunningMean::new(delay_s * mean_share * 2.0, 2.0 * longest_s, tick_s),
            lag_s: delay_s * (-mean_share + 1.0),
            lag: FirstOrder::new(),
            tick_s,
        }
    }

    /// The delayed signal at the end of a tick.
    pub fn step(&mut self, input: T) -> T {
        self.lag.step(self.mean.step(input), self.lag_s, self.tick_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_second_order_swings_over_by_what_its_damping_leaves() {
        let (time_s, z) = (0.02, 0.3_f64);
        let mut swing = SecondOrder::new(time_s, z, 0.0005);
        swing.step(0.0);
        let largest = (0..2000).map(|_| swing.step(1.0)[0]).fold(0.0, f64::max);
        let over = (-std::f64::consts::PI * z / (1.0 - z * z).sqrt()).exp();
        assert!((largest - 1.0 - over).abs() < 1e-3, "{largest}");
        assert!((swing.step(1.0)[0] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn history_interpolates_between_ticks() {
        let mut past = History::new(0.01, 0.002);
        for k in 0..20 {
            past.push(k as f64);
        }
        assert_eq!(past.ago(0.0), 19.0);
        assert!((past.ago(0.005) - 16.5).abs() < 1e-9);
        assert!((past.ago(0.01) - 14.0).abs() < 1e-9);
    }

    #[test]
    fn a_held_step_arrives_as_its_exponential_tick_by_tick() {
        let mut lag = FirstOrder::new();
        lag.mean_of_held(0.0, 0.02, 0.002);
        let missing: f64 = (0..200).map(|_| 1.0 - lag.mean_of_held(1.0, 0.02, 0.002)).sum::<f64>() * 0.002;
        assert!((missing - 0.02).abs() < 1e-9, "the step is late by the lag in the mean: {missing}");
        let mut none = FirstOrder::new();
        none.mean_of_held(0.0, 0.0, 0.002);
        assert_eq!(none.mean_of_held(1.0, 0.0, 0.002), 1.0);
    }

    #[test]
    fn a_ramp_leaves_a_first_order_lag_behind_by_slope_times_lag() {
        let mut lag = FirstOrder::new();
        let mut y = 0.0;
        for k in 0..2000 {
            y = lag.step(k as f64 * 0.002, 0.05, 0.002);
        }
        assert!((1999.0 * 0.002 - y - 0.05).abs() < 1e-9);
    }

    #[test]
    fn a_running_mean_is_the_mean_over_its_window() {
        let signal = |k: i32| (0.3 * f64::from(k.max(0))).sin() + 2.0;
        // 2.4 ticks: the newest one and a half times, and what a straight line gives of the fourth.
        let mut mean = RunningMean::new(2.4 * 0.002, 0.1, 0.002);
        let mut short = RunningMean::new(0.5 * 0.002, 0.1, 0.002);
        let between = |k: i32, part: f64| signal(k) + (signal(k - 1) - signal(k)) * part;
        for k in 0..100 {
            let (shown, at_once) = (mean.step(signal(k)), short.step(signal(k)));
            let two = 0.5 * signal(k) + signal(k - 1) + 0.5 * signal(k - 2);
            let rest = 0.4 * 0.5 * (signal(k - 2) + between(k - 2, 0.4));
            assert!((shown - (two + rest) / 2.4).abs() < 1e-12, "{k}");
            assert!((at_once - 0.5 * (signal(k) + between(k, 0.5))).abs() < 1e-12, "{k}");
        }
    }

    /// Whatever the running mean's share, up to the largest delay.
    #[test]
    fn a_ramp_leaves_a_mean_and_a_lag_behind_by_their_delay() {
        for (delay_s, share) in [(0.05, 0.0), (0.05, 0.4), (0.05, 1.0), (1.0, 0.8)] {
            let mut delay = MeanAndLag::new(delay_s, share, 1.0, 0.002);
            let mut y = 0.0;
            for k in 0..10_000 {
                y = delay.step(k as f64 * 0.002);
            }
            assert!((9999.0 * 0.002 - y - delay_s).abs() < 1e-6, "{delay_s} s, {share}: {y}");
        }
    }
}
