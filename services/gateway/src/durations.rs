//! How long answers took, by route: histograms for the metrics.

use std::collections::BTreeMap;
use std::sync::Mutex;
use std::time::Duration;

use crate::thruster::lock;

/// Upper bounds of the buckets, s.
pub const BOUNDS_S: [f64; 8] = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 1.0];

/// One route's answers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Route {
    /// Answers by bucket, not cumulative; the last has no bound.
    pub buckets: [u64; BOUNDS_S.len() + 1],
    /// Time in all, s.
    pub sum_s: f64,
}

/// Every route that was asked for.
#[derive(Debug, Default)]
pub struct Durations(Mutex<BTreeMap<String, Route>>);

impl Durations {
    /// Counts an answer. Routes are the patterns of the router: a client cannot make up more of them.
    pub fn count(&self, route: &str, took: Duration) {
        let took_s = took.as_secs_f64();
        let bucket = BOUNDS_S.iter().position(|bound| took_s <= *bound).unwrap_or(BOUNDS_S.len());
        let mut routes = lock(&self.0);
        let counts = match routes.get_mut(route) {
            Some(counts) => counts,
            None => routes.entry(route.to_owned()).or_default(),
        };
        counts.buckets[bucket] += 1;
        counts.sum_s += took_s;
    }

    /// The counts now.
    pub fn counts(&self) -> BTreeMap<String, Route> {
        lock(&self.0).clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_answer_falls_into_the_first_bucket_that_holds_it() {
        let durations = Durations::default();
        for ms in [1, 3, 70, 5000] {
            durations.count("/v1/thrusters", Duration::from_millis(ms));
        }
        let counts = durations.counts()["/v1/thrusters"];
        assert_eq!(counts.buckets, [1, 0, 1, 0, 0, 0, 1, 0, 1]);
        assert!((counts.sum_s - 5.074).abs() < 1e-9);
    }
}
