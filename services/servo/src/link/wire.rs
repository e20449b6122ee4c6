//! The tick's end of a wire.

use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use kort_proto::faults::Fault;
use kort_proto::signals::Signals;
use rustix::event::{EventfdFlags, eventfd};
use triple_buffer::{Input, Output, triple_buffer};

use super::{Medium, Protocol, thread};
use crate::devices::{At, Reading, Shown};
use crate::drives::Drive;
use crate::sensors::Source;

/// How long the start waits for a device that is there to answer in full; without it the servo starts all the
/// same, with the fault shown.
const PATIENCE: Duration = Duration::from_secs(1);

/// How the wire is used.
#[derive(Clone, Debug)]
pub struct Wire {
    /// For the log, for example "drive of t1".
    pub name: String,
    /// What leads there.
    pub medium: Medium,
    /// Exchanges a second.
    pub rate_hz: f64,
    /// How long a reading stands, ns.
    pub reading_life_ns: u64,
    /// SCHED_FIFO priority of the loop, just below which the thread stands; zero leaves the scheduler alone.
    pub priority: i32,
    /// It answers to commands; a mere instrument speaks by itself.
    pub is_drive: bool,
}

/// Newest command of the tick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Command {
    pub(crate) drive: Option<f64>,
}

/// Newest word of the device.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Told {
    pub(crate) readings: u64,
    pub(crate) stamp_ns: u64,
    pub(crate) signals: Signals,
    pub(crate) faults: u64,
    pub(crate) restarts: u32,
    pub(crate) guarded: bool,
}

impl Told {
    pub(crate) const NOTHING: Self =
        Self { readings: 0, stamp_ns: 0, signals: Signals::UNKNOWN, faults: 0, restarts: 0, guarded: false };

    /// Takes a reading, if it is known when it was taken.
    pub(crate) fn take(&mut self, signals: Signals, stamp_ns: Option<u64>) {
        if let Some(stamp_ns) = stamp_ns {
            self.readings = self.readings.wrapping_add(1);
            (self.stamp_ns, self.signals) = (stamp_ns, signals);
        }
    }
}

/// The device's end of what a thread and the tick leave for each other.
pub(crate) struct Ends {
    pub(crate) commands: Output<Command>,
    pub(crate) tell: Input<Told>,
    /// A counter that each tick adds to.
    pub(crate) waker: Arc<OwnedFd>,
    pub(crate) ending: Arc<AtomicBool>,
}

/// The tick's end of a wire, or of whatever else a thread serves.
pub struct Link {
    life_ns: u64,
    commands: Input<Command>,
    told: Output<Told>,
    seen: Told,
    waker: Arc<OwnedFd>,
    ending: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Link {
    /// Starts the thread, and waits for a device that answers at once.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had.
    pub fn start(wire: Wire, protocol: Box<dyn Protocol>) -> std::io::Result<Self> {
        let (life_ns, is_drive) = (wire.reading_life_ns, wire.is_drive);
        Self::spawn(life_ns, is_drive, |ends| thread::Serving::new(wire, protocol, ends).run())
    }

    /// The same with a thread that serves a device in its own way.
    ///
    /// # Errors
    /// No thread or no descriptor is to be had.
    pub(crate) fn spawn(
        life_ns: u64,
        is_drive: bool,
        serve: impl FnOnce(Ends) + Send + 'static,
    ) -> std::io::Result<Self> {
        let (commands, newest) = triple_buffer(&Command { drive: None });
        // Until the thread has confirmed something else.
        let lost = if is_drive { Fault::DriveLost.bit() } else { 0 };
        let (tell, told) = triple_buffer(&Told { faults: lost, ..Told::NOTHING });
        let waker = Arc::new(eventfd(0, EventfdFlags::NONBLOCK | EventfdFlags::CLOEXEC)?);
        let ending = Arc::new(AtomicBool::new(false));
        let ends = Ends { commands: newest, tell, waker: Arc::clone(&waker), ending: Arc::clone(&ending) };
        let thread = std::thread::Builder::new().name("device".into()).spawn(move || serve(ends))?;
        let mut link =
            Self { life_ns, commands, told, seen: Told::NOTHING, waker, ending, thread: Some(thread) };
        let end = std::time::Instant::now() + PATIENCE;
        while !link.told.read().guarded && std::time::Instant::now() < end {
            std::thread::sleep(Duration::from_millis(5));
        }
        Ok(link)
    }

    fn newest(&mut self) -> Shown {
        let told = *self.told.read();
        let new = told.readings != self.seen.readings;
        let restarted = told.restarts != self.seen.restarts;
        self.seen = told;
        Shown {
            reading: new.then_some(Reading { stamp_ns: told.stamp_ns, signals: told.signals }),
            faults: told.faults | if restarted { Fault::DriveRestarted.bit() } else { 0 },
        }
    }
}

impl Drive for Link {
    fn reading_life_ns(&self) -> u64 {
        self.life_ns
    }

    fn show(&mut self, _: At) -> Shown {
        self.newest()
    }

    fn drive(&mut self, _: u64, drive: Option<f64>) {
        self.commands.write(Command { drive });
        // A full counter wakes as well as one that grew.
        let _ = rustix::io::write(&*self.waker, &1u64.to_ne_bytes());
    }
}

impl Source for Link {
    fn show(&mut self, _: At) -> Shown {
        self.newest()
    }
}

impl Drop for Link {
    /// The thread switches the output off before it ends.
    fn drop(&mut self) {
        self.ending.store(true, Ordering::Relaxed);
        let _ = rustix::io::write(&*self.waker, &1u64.to_ne_bytes());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
