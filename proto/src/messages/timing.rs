//! How a loop keeps its time.

#[cfg(feature = "transport")]
use iceoryx2::prelude::ZeroCopySend;

/// Upper bounds of the buckets of a lateness histogram, ns; a last bucket has no bound.
pub const LATENESS_BOUNDS_NS: [u64; 11] =
    [5_000, 10_000, 20_000, 50_000, 100_000, 200_000, 500_000, 1_000_000, 2_000_000, 5_000_000, 10_000_000];

message! { "kort.Timing",
    /// A loop's timing since its process started.
    Timing {
        /// Period of the loop, ns.
        period_ns: u64,
        /// Ticks done.
        ticks: u64,
        /// Ticks skipped because the loop came too late.
        overruns: u64,
        /// Lateness of the last wake-up, ns.
        lateness_ns: u64,
        /// Largest lateness, ns.
        lateness_max_ns: u64,
        /// Sum of all latenesses, ns.
        lateness_sum_ns: u64,
        /// Work of the last tick, wake-up to send, ns.
        busy_ns: u64,
        /// Wake-ups by lateness, see [`LATENESS_BOUNDS_NS`]; not cumulative.
        histogram: [u64; LATENESS_BOUNDS_NS.len() + 1],
    }
}

impl Timing {
    /// Counts one wake-up, `lateness_ns` after its deadline.
    pub fn count(&mut self, lateness_ns: u64) {
        self.ticks = self.ticks.wrapping_add(1);
        self.lateness_ns = lateness_ns;
        self.lateness_max_ns = self.lateness_max_ns.max(lateness_ns);
        self.lateness_sum_ns = self.lateness_sum_ns.wrapping_add(lateness_ns);
        let bucket =
            LATENESS_BOUNDS_NS.iter().position(|b| lateness_ns <= *b).unwrap_or(LATENESS_BOUNDS_NS.len());
        if let Some(n) = self.histogram.get_mut(bucket) {
            *n += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_histogram_counts_every_wake_up(late in prop::collection::vec(0u64..30_000_000, 0..50)) {
            let mut timing = Timing::default();
            for l in &late {
                timing.count(*l);
            }
            prop_assert_eq!(timing.histogram.iter().sum::<u64>(), late.len() as u64);
            prop_assert_eq!(timing.lateness_max_ns, late.iter().copied().max().unwrap_or(0));
        }
    }
}
