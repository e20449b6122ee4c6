//! What wakes the bus before its next tick, and what tells it that the rest of the gateway lives.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::Thread;
use std::time::{Duration, Instant};

/// Wakes the bus for a request.
#[derive(Debug, Default)]
pub struct Bell(OnceLock<Thread>);

impl Bell {
    /// The calling thread is the one to wake.
    pub fn hang(&self) {
        let _ = self.0.set(std::thread::current());
    }

    /// A request is there.
    pub fn ring(&self) {
        if let Some(bus) = self.0.get() {
            bus.unpark();
        }
    }
}

/// The runtime that answers requests beats too: a gateway that only this thread keeps alive must not look alive.
#[derive(Debug)]
pub struct Pulse {
    began: Instant,
    beat_ms: AtomicU64,
    ended: AtomicBool,
}

impl Pulse {
    /// How often the runtime beats.
    pub const EVERY: Duration = Duration::from_millis(100);
    /// A runtime silent for this long hangs.
    const LIFE: Duration = Duration::from_secs(2);

    /// Beats now.
    pub fn new() -> Pulse {
        Pulse { began: Instant::now(), beat_ms: AtomicU64::new(0), ended: AtomicBool::new(false) }
    }

    /// The runtime beats.
    pub fn beat(&self) {
        self.beat_ms.store(self.began.elapsed().as_millis() as u64, Ordering::Relaxed);
    }

    /// It commands no more: the process is about to end.
    pub fn end(&self) {
        self.ended.store(true, Ordering::Relaxed);
    }

    /// Did it beat lately?
    pub fn alive(&self) -> bool {
        if self.ended.load(Ordering::Relaxed) {
            return false;
        }
        let last = Duration::from_millis(self.beat_ms.load(Ordering::Relaxed));
        self.began.elapsed().saturating_sub(last) < Pulse::LIFE
    }
}
