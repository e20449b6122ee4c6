//! What effects remember from tick to tick: a past signal, a first-order lag.

/// The past of a signal sampled once a tick. Before the first sample the signal is taken as
/// constant.
pub(super) struct History {
    tick_s: f64,
    ring: Vec<f64>,
    newest: usize,
    empty: bool,
}

impl History {
    /// Room for delays up to `longest_s`.
    pub fn new(longest_s: f64, tick_s: f64) -> Self {
        let ticks = (longest_s.max(0.0) / tick_s).ceil() as usize;
        Self { tick_s, ring: vec![0.0; ticks + 2], newest: 0, empty: true }
    }

    /// The sample of this tick.
    pub fn push(&mut self, sample: f64) {
        if self.empty {
            self.ring.fill(sample);
            self.empty = false;
        }
        self.newest = if self.newest + 1 == self.ring.len() { 0 } else { self.newest + 1 };
        self.ring[self.newest] = sample;
    }

    /// The signal `delay_s` before the newest sample; the two neighbouring ticks are mixed, so
    /// that the answer is continuous in the delay.
    pub fn ago(&self, delay_s: f64) -> f64 {
        let last = self.ring.len() - 1;
        let ticks = (delay_s / self.tick_s).clamp(0.0, last as f64);
        let whole = (ticks as usize).min(last - 1);
        let part = ticks - whole as f64;
        let at = |back: usize| self.ring[(self.newest + self.ring.len() - back) % self.ring.len()];
        at(whole) * (1.0 - part) + at(whole + 1) * part
    }
}

/// Exact first-order lag of a signal that runs straight from sample to sample.
#[derive(Default)]
pub(super) struct FirstOrder {
    input: f64,
    output: f64,
    started: bool,
}

impl FirstOrder {
    /// The lagged signal at the end of a tick of `tick_s`, for a lag of `lag_s` (none below 1 ns).
    pub fn step(&mut self, input: f64, lag_s: f64, tick_s: f64) -> f64 {
        if !self.started || lag_s <= 1e-9 {
            *self = Self { input, output: input, started: true };
            return input;
        }
        let behind = lag_s * (input - self.input) / tick_s;
        self.output = input - behind + (self.output - self.input + behind) * (-tick_s / lag_s).exp();
        self.input = input;
        self.output
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
    fn a_ramp_leaves_a_first_order_lag_behind_by_slope_times_lag() {
        let mut lag = FirstOrder::default();
        let mut y = 0.0;
        for k in 0..2000 {
            y = lag.step(k as f64 * 0.002, 0.05, 0.002);
        }
        assert!((1999.0 * 0.002 - y - 0.05).abs() < 1e-9);
    }
}
