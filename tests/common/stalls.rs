//! How long the machine stood still, and what is tried once more for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use kort_proto::transport::realtime;

/// How late a thread that only sleeps wakes: what the machine holds up, it holds up every process with.
#[derive(Clone, Default)]
pub struct Stalls(Arc<AtomicU64>);

impl Stalls {
    /// Begins to look.
    pub fn watch() -> Self {
        Self::watch_by(|| ())
    }

    /// The same by a real-time thread, between servo and controller, where that is permitted: what holds it up too, is
    /// the host.
    pub fn watch_in_real_time() -> Self {
        Self::watch_by(|| drop(realtime(75, false)))
    }

    fn watch_by(prepare: impl FnOnce() + Send + 'static) -> Self {
        let stalls = Self::default();
        let weak = Arc::downgrade(&stalls.0);
        std::thread::spawn(move || {
            prepare();
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

thread_local! {
    pub static STOOD_STILL: std::cell::Cell<bool> = const { std::cell::Cell::new(false) };
}

/// A thread that wakes so much too late was held up by the machine, ms: half a time-out of a service asked by HTTP.
const HELD_UP_MS: f64 = 50.0;

/// Runs a test of live processes again, up to twice, where it failed and a servo said that its loop or its controller
/// stood still, or a thread that only sleeps was held up: then the machine was suspended or overloaded for longer than
/// a drive may wait, the trip to zero is what the service promises, and what the test asks about was not to be seen.
pub fn in_real_time(test: impl Fn()) {
    let stalls = Stalls::watch();
    for again in [true, true, false] {
        STOOD_STILL.set(false);
        stalls.take_ms();
        match std::panic::catch_unwind(std::panic::AssertUnwindSafe(&test)) {
            Err(_) if again && (STOOD_STILL.get() || stalls.take_ms() > HELD_UP_MS) => {
                eprintln!("the machine stood still; once more")
            }
            Err(failure) => std::panic::resume_unwind(failure),
            Ok(()) => return,
        }
    }
}
