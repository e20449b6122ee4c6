//! How long the machine stood still.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// How late a thread that only sleeps wakes: what the machine holds up, it holds up every process with.
#[derive(Clone, Default)]
pub struct Stalls(Arc<AtomicU64>);

impl Stalls {
    /// Begins to look.
    pub fn watch() -> Self {
        let stalls = Self::default();
        let weak = Arc::downgrade(&stalls.0);
        std::thread::spawn(move || {
            const NAP: Duration = Duration::from_millis(5);
            loop {
                let asleep = Instant::now();
                std::thread::sleep(NAP);
                let late = asleep.elapsed().saturating_sub(NAP).as_millis() as u64;
                let Some(worst) = weak.upgrade() else { return };
                worst.fetch_max(late, Ordering::Relaxed);
            }
        });
        stalls
    }

    /// The longest since this was asked last, ms.
    pub fn take_ms(&self) -> f64 {
        self.0.swap(0, Ordering::Relaxed) as f64
    }
}
