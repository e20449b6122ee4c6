//! Small memories that hidden physics and sensors keep.

use std::collections::VecDeque;

/// First-order lag, exact over a step in which its input stands.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lag {
    /// Output.
    pub value: f64,
}

impl Lag {
    /// Moves toward `input`; a time constant of zero follows at once.
    pub fn follow(&mut self, input: f64, time_constant_s: f64, step_s: f64) -> f64 {
        let keep = if time_constant_s > 0.0 { (-step_s / time_constant_s).exp() } else { 0.0 };
        self.value = input + (self.value - input) * keep;
        self.value
    }
}

/// Second-order lag of one natural frequency and damping, in small steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct Second {
    /// Output.
    pub value: f64,
    rate: f64,
}

impl Second {
    /// Moves toward `input`.
    pub fn follow(&mut self, input: f64, natural_rad_s: f64, damping: f64, step_s: f64) -> f64 {
        let parts = (natural_rad_s * step_s / 0.1).ceil().max(1.0) as usize;
        let small = step_s / parts as f64;
        for _ in 0..parts {
            // Semi-implicit Euler: no energy of its own.
            let force = natural_rad_s * natural_rad_s * (input - self.value);
            self.rate = (self.rate + small * force) / (1.0 + 2.0 * damping * natural_rad_s * small);
            self.value += small * self.rate;
        }
        self.value
    }
}

/// Values of the last while, a value a tick.
#[derive(Clone, Debug, Default)]
pub struct Past {
    values: VecDeque<f64>,
}

impl Past {
    /// Keeps one more, at most `most`.
    pub fn push(&mut self, value: f64, most: usize) {
        self.values.push_front(value);
        self.values.truncate(most.max(2));
    }

    /// Value so many ticks ago, between two of them in proportion; the oldest beyond memory.
    pub fn ago(&self, ticks: f64) -> f64 {
        let (whole, part) = (ticks.max(0.0).floor() as usize, ticks.max(0.0).fract());
        let oldest = self.values.back().copied().unwrap_or(0.0);
        let at = |index: usize| self.values.get(index).copied().unwrap_or(oldest);
        at(whole) + part * (at(whole + 1) - at(whole))
    }

    /// Mean over the last ticks.
    pub fn mean(&self, ticks: usize) -> f64 {
        let count = ticks.clamp(1, self.values.len().max(1));
        self.values.iter().take(count).sum::<f64>() / count as f64
    }

    /// Forgets.
    pub fn clear(&mut self) {
        self.values.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lag_reaches_the_share_of_its_exponential() {
        let mut lag = Lag::default();
        for _ in 0..10 {
            lag.follow(1.0, 0.02, 0.002);
        }
        assert!((lag.value - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
        assert_eq!(Lag::default().follow(3.0, 0.0, 0.1), 3.0);
    }

    #[test]
    fn a_second_order_lag_settles_and_rings_at_its_frequency() {
        let mut ring = Second::default();
        let (natural, step) = (std::f64::consts::TAU * 10.0, 0.0002);
        let top = (0..2500).map(|_| ring.follow(1.0, natural, 0.05, step)).fold(0.0, f64::max);
        // Overshoot of a damping of 0.05: 1 + exp(-pi 0.05 / sqrt(1 - 0.05^2)).
        assert!((top - 1.854).abs() < 0.03, "{top}");
        for _ in 0..200_000 {
            ring.follow(1.0, natural, 0.05, step);
        }
        assert!((ring.value - 1.0).abs() < 1e-6);
    }

    #[test]
    fn the_past_is_read_between_ticks() {
        let mut past = Past::default();
        for value in 0..5 {
            past.push(f64::from(value), 4);
        }
        assert_eq!((past.ago(0.0), past.ago(1.5), past.ago(40.0), past.mean(2)), (4.0, 2.5, 1.0, 3.5));
    }
}
