//! A source that must be asked and may take its time: a thread of its own reads it at its rate.

use std::io;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use kort_proto::transport::{monotonic_ns, ordinary};
use tracing::{info, warn};
use triple_buffer::{Input, Output, triple_buffer};

use super::Source;
use super::iio::Reader;
use crate::devices::{At, Reading, Shown};

/// Pause before a device that could not be read is tried again.
const AGAIN: Duration = Duration::from_millis(250);

/// The tick's end of the thread.
pub struct Polled {
    readings: Output<Option<Reading>>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Polled {
    /// Starts the thread.
    ///
    /// # Errors
    /// There is none to be had.
    pub fn start(name: String, reader: Reader) -> io::Result<Self> {
        let (show, readings) = triple_buffer(&None);
        let ending = Arc::new(AtomicBool::new(false));
        let end = Arc::clone(&ending);
        let thread = std::thread::Builder::new()
            .name("sensor".into())
            .spawn(move || serve(&name, reader, show, &end))?;
        Ok(Self { readings, ending, thread: Some(thread) })
    }
}

fn serve(name: &str, mut reader: Reader, mut show: Input<Option<Reading>>, ending: &AtomicBool) {
    ordinary();
    let period = Duration::from_secs_f64(1.0 / reader.rate_hz());
    let (mut next, mut said) = (Instant::now(), String::from("nothing yet"));
    while !ending.load(Ordering::Relaxed) {
        let stamp_ns = monotonic_ns();
        match reader.read() {
            Ok(signals) => {
                if !said.is_empty() {
                    info!("{name} is read");
                    said.clear();
                }
                show.write(Some(Reading { stamp_ns, signals }));
                next = (next + period).max(Instant::now());
                std::thread::sleep(next.saturating_duration_since(Instant::now()).min(AGAIN));
            }
            Err(words) => {
                if said != words {
                    warn!("{name}: {words}");
                    said = words;
                }
                reader.reopen();
                std::thread::sleep(AGAIN);
            }
        }
    }
}

impl Source for Polled {
    fn show(&mut self, _: At) -> Shown {
        let reading = if self.readings.update() { *self.readings.output_buffer() } else { None };
        Shown { reading, faults: 0 }
    }
}

impl Drop for Polled {
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Relaxed);
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
