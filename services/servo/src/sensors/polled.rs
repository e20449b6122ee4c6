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
        let early = next.saturating_duration_since(Instant::now());
        if !early.is_zero() {
            // In naps, so that a slow instrument does not hold the servo's end up.
            std::thread::sleep(early.min(AGAIN));
            continue;
        }
        let stamp_ns = monotonic_ns();
        match reader.read() {
            Ok(signals) => {
                if !said.is_empty() {
                    info!("{name} is read");
                    said.clear();
                }
                show.write(Some(Reading { stamp_ns, signals }));
                next = (next + period).max(Instant::now());
            }
            Err(words) => {
                if said != words {
                    warn!("{name}: {words}");
                    said = words;
                }
                reader.reopen();
                next = Instant::now() + AGAIN;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensors::iio::Iio;
    use crate::sensors::{Channel, place};

    #[test]
    fn a_slow_instrument_is_read_at_its_own_rate() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("in_temp_input"), "20000\n").unwrap();
        let place = place("temperature_c").unwrap();
        let channels =
            vec![Channel { from: "in_temp".to_owned(), place, scale: 1e-3, offset: 0.0, most: 1e3 }];
        let iio = Iio { path: folder.path().to_owned(), rate_hz: 0.5, channels };
        let mut polled = Polled::start("bath".into(), Reader::new(iio)).unwrap();
        let (mut readings, began) = (0, Instant::now());
        while began.elapsed() < Duration::from_millis(1200) {
            readings += u32::from(polled.show(At { now_ns: 0, ticks: 1 }).reading.is_some());
            std::thread::sleep(Duration::from_millis(5));
        }
        // One at the start; the second comes after 2 s, unless the machine stood still for that long.
        assert!(readings == 1 || began.elapsed() > Duration::from_secs(2), "{readings} readings");
    }
}
