//! What a fast signal did during the last second: a 1 kHz signal read once a second would alias.

/// Smallest, mean and largest value of one window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Smallest value.
    pub min: f64,
    /// Mean of all values.
    pub mean: f64,
    /// Largest value.
    pub max: f64,
}

/// Gathers one signal over consecutive windows of fixed length.
#[derive(Clone, Debug)]
pub struct Window {
    length_ns: u64,
    start_ns: u64,
    count: u64,
    sum: f64,
    min: f64,
    max: f64,
    complete: Option<Summary>,
}

impl Window {
    /// An empty window of this length, ns.
    pub fn new(length_ns: u64) -> Window {
        Window {
            length_ns,
            start_ns: 0,
            count: 0,
            sum: 0.0,
            min: f64::INFINITY,
            max: f64::NEG_INFINITY,
            complete: None,
        }
    }

    /// Adds a value taken at `now_ns`; values that are not finite mean "not measured" and only move time on.
    pub fn add(&mut self, now_ns: u64, value: f64) {
        if now_ns.saturating_sub(self.start_ns) >= self.length_ns {
            self.close(now_ns);
        }
        if value.is_finite() {
            self.count += 1;
            self.sum += value;
            self.min = self.min.min(value);
            self.max = self.max.max(value);
        }
    }

    /// The last complete window; none if nothing was measured in it.
    pub fn complete(&self) -> Option<Summary> {
        self.complete
    }

    fn close(&mut self, now_ns: u64) {
        self.complete = (self.count > 0).then(|| Summary {
            min: self.min,
            mean: (self.sum / self.count as f64).clamp(self.min, self.max),
            max: self.max,
        });
        *self = Window { start_ns: now_ns, complete: self.complete, ..Window::new(self.length_ns) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_spike_between_two_scrapes_is_seen() {
        let mut window = Window::new(1_000);
        for t in 0..2_000u64 {
            window.add(t + 1_000, if t == 417 { 50.0 } else { 1.0 });
        }
        // The window that holds the spike closes at t = 2000.
        let seen = window.complete().unwrap();
        assert_eq!((seen.min, seen.max), (1.0, 50.0));
    }

    #[test]
    fn a_window_without_measurement_is_none() {
        let mut window = Window::new(1_000);
        for t in 0..3_000u64 {
            window.add(t, f64::NAN);
        }
        assert_eq!(window.complete(), None);
    }

    proptest! {
        #[test]
        fn min_mean_max_are_ordered(values in prop::collection::vec(-1e12f64..1e12, 1..200)) {
            let mut window = Window::new(1_000);
            window.add(1_000, values[0]);
            for value in &values { window.add(1_500, *value); }
            window.add(2_000, 0.0);
            let seen = window.complete().unwrap();
            prop_assert!(seen.min <= seen.mean && seen.mean <= seen.max);
        }
    }
}
