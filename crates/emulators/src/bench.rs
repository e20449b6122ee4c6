//! Any device on a pseudo terminal, behind UDP or behind files, served by a thread, with a wire that can be spoiled.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use kort_proto::transport::{monotonic_ns, realtime};

use crate::far::Far;

/// How often the device lives.
pub(crate) const STEP: Duration = Duration::from_micros(500);
/// Priority of the device where the system permits, below the servo's.
pub(crate) const PRIORITY: i32 = 60;
/// The device's name in its folder.
const PORT: &str = "port";
/// Changes of the command that are kept.
const COMMANDS_MAX: usize = 1_000_000;

/// A device at the far end of a wire.
pub trait Device: Send {
    /// Takes bytes as they come; its answers, a frame each.
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>>;

    /// Lives on to this instant: own time-out, motor, shaft. What it says unasked.
    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>>;

    /// Its supply was cut and came back: everything that it does not store is forgotten.
    fn restart(&mut self, now_s: f64);

    /// It reports this fault of its own from now on, in its own code; zero: none.
    fn report(&mut self, code: u32);

    /// What is true at its motor.
    fn truth(&self) -> Truth;

    /// What is done to its sensor from now on, where it has one that can be lied about.
    fn mislead(&mut self, _mischief: Mischief) {}
}

/// What is true at the motor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Truth {
    /// What the power stage is asked for, in the amplifier's unit.
    pub command: f64,
    /// Motor current, A.
    pub current_a: f64,
    /// Shaft speed, rad/s.
    pub shaft_speed_rad_s: f64,
    /// Thrust, N.
    pub thrust_n: f64,
}

/// What happens to the wire.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mischief {
    /// Nothing.
    #[default]
    None,
    /// The plug is pulled.
    Unplugged,
    /// Answers are lost.
    Silent,
    /// Noise instead of answers.
    Garbage,
    /// Only the first half of each answer arrives.
    Truncated,
    /// A bit of each answer is turned on the way.
    Flipped,
    /// The last answer before arrives instead of each new one.
    Stale,
    /// Answers arrive in pieces of one to sixteen bytes; nothing is lost.
    Split,
    /// Noise between the answers; nothing is lost.
    Noisy,
    /// Its sensor shows the other sign; the wire is sound.
    Reversed,
    /// Its sensor counts in a unit that is so many times larger (kilogram-force for newton, too many pole pairs): it shows that
    /// part of what is true.
    Scaled(u8),
    /// The other way round: it shows so many times what is true.
    Multiplied(u8),
    /// Its sensor shows the same from now on.
    Frozen,
}

/// What a sensor makes of what is true.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Lie {
    mischief: Mischief,
    held: f64,
}

impl Lie {
    /// The lie that this mischief is, from now on; truth for one of the wire.
    pub(crate) fn tell(&mut self, mischief: Mischief) {
        self.mischief = mischief;
    }

    /// What is shown of what is true.
    pub(crate) fn shown(&mut self, truth: f64) -> f64 {
        let shown = truth * self.factor();
        if self.mischief != Mischief::Frozen {
            self.held = shown;
        }
        self.held
    }

    /// Shown over true.
    pub(crate) fn factor(&self) -> f64 {
        match self.mischief {
            Mischief::Reversed => -1.0,
            Mischief::Scaled(times) => 1.0 / f64::from(times),
            Mischief::Multiplied(times) => f64::from(times),
            _ => 1.0,
        }
    }
}

#[derive(Default)]
pub(crate) struct Shared {
    mischief: Mischief,
    restart: bool,
    report: Option<u32>,
    ending: bool,
    truth: Truth,
    /// The last instant at which the power stage was asked for something.
    driven: Option<Instant>,
    heard: u64,
    /// When the power stage was asked for something else, on CLOCK_MONOTONIC, ns, and for what.
    commands: Vec<(u64, f64)>,
}

/// What a test asked for since the device lived last.
pub(crate) struct Asked {
    pub(crate) mischief: Mischief,
    pub(crate) restart: bool,
    pub(crate) report: Option<u32>,
}

impl Shared {
    /// What is asked for; none: the device ends.
    pub(crate) fn asked(&mut self) -> Option<Asked> {
        let (restart, report) = (std::mem::take(&mut self.restart), self.report.take());
        (!self.ending).then_some(Asked { mischief: self.mischief, restart, report })
    }

    /// The device lived on, heard so many bytes at this instant on CLOCK_MONOTONIC, ns, and this is true of it now.
    pub(crate) fn lived(&mut self, heard_ns: u64, truth: Truth, heard: u64) {
        let before = std::mem::replace(&mut self.truth, truth);
        if truth.command != before.command && self.commands.len() < COMMANDS_MAX {
            self.commands.push((heard_ns, truth.command));
        }
        self.heard += heard;
        if truth.command != 0.0 {
            self.driven = Some(Instant::now());
        }
    }
}

pub(crate) fn lock(shared: &Mutex<Shared>) -> MutexGuard<'_, Shared> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A device, running.
pub struct Bench {
    /// Holds the name of its port.
    _folder: tempfile::TempDir,
    port: PathBuf,
    shared: Arc<Mutex<Shared>>,
    thread: Option<JoinHandle<()>>,
}

impl Bench {
    /// Starts the device.
    ///
    /// # Errors
    /// No pseudo terminal is to be had.
    pub fn start(device: impl Device + 'static) -> std::io::Result<Self> {
        let folder = tempfile::tempdir()?;
        let link = folder.path().join(PORT);
        Self::start_on(device, folder, Far::terminal(&link)?)
    }

    /// The same behind UDP: an endpoint that waits for a client.
    ///
    /// # Errors
    /// No socket is to be had.
    pub fn start_udp(device: impl Device + 'static) -> std::io::Result<Self> {
        Self::start_on(device, tempfile::tempdir()?, Far::endpoint()?)
    }

    fn start_on(device: impl Device + 'static, folder: tempfile::TempDir, far: Far) -> std::io::Result<Self> {
        let port = far.name();
        Self::serve(folder, port, |shared| Serving { device, shared, last: Vec::new(), dice: 1 }.run(far))
    }

    /// Starts the thread behind a port, whose name lies in this folder.
    pub(crate) fn serve(
        folder: tempfile::TempDir,
        port: PathBuf,
        run: impl FnOnce(Arc<Mutex<Shared>>) + Send + 'static,
    ) -> std::io::Result<Self> {
        let shared = Arc::new(Mutex::new(Shared::default()));
        let theirs = Arc::clone(&shared);
        let thread = std::thread::Builder::new().name("emulator".into()).spawn(move || run(theirs))?;
        Ok(Self { _folder: folder, port, shared, thread: Some(thread) })
    }

    /// The device's name, which stays when it is plugged in again.
    pub fn port(&self) -> PathBuf {
        self.port.clone()
    }

    /// Spoils the wire from now on, or mends it.
    pub fn spoil(&self, mischief: Mischief) {
        self.lock().mischief = mischief;
    }

    /// Cuts the device's supply for a moment.
    pub fn restart(&self) {
        self.lock().restart = true;
    }

    /// Has the device report a fault of its own; zero: none any more.
    pub fn report(&self, code: u32) {
        self.lock().report = Some(code);
    }

    /// What is true at the motor.
    pub fn truth(&self) -> Truth {
        self.lock().truth
    }

    /// The same for another device that measures there, whatever it is called by.
    pub fn watched(&self) -> impl Fn() -> Truth + Send + use<> {
        let shared = Arc::clone(&self.shared);
        move || lock(&shared).truth
    }

    /// When the power stage was asked for something last.
    pub fn driven(&self) -> Option<Instant> {
        self.lock().driven
    }

    /// Every change of what the power stage was asked for: when, on CLOCK_MONOTONIC, ns, and for what.
    pub fn commands(&self) -> Vec<(u64, f64)> {
        self.lock().commands.clone()
    }

    /// Bytes that reached the device so far.
    pub fn heard(&self) -> u64 {
        self.lock().heard
    }

    fn lock(&self) -> MutexGuard<'_, Shared> {
        lock(&self.shared)
    }
}

impl Drop for Bench {
    fn drop(&mut self) {
        self.lock().ending = true;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

struct Serving<D> {
    device: D,
    shared: Arc<Mutex<Shared>>,
    /// The last frame sent unspoiled.
    last: Vec<u8>,
    dice: u32,
}

impl<D: Device> Serving<D> {
    fn run(mut self, mut far: Far) {
        // A real device waits for no scheduler; where this is not permitted it is as late as the machine is busy.
        let _ = realtime(PRIORITY, false);
        let began = Instant::now();
        loop {
            far.wait(STEP);
            let heard_ns = monotonic_ns();
            let now_s = began.elapsed().as_secs_f64();
            let Some(Asked { mischief, restart, report }) = lock(&self.shared).asked() else { return };
            if restart {
                self.device.restart(now_s);
            }
            if let Some(code) = report {
                self.device.report(code);
            }
            self.device.mislead(mischief);
            far.plug(mischief != Mischief::Unplugged);
            let bytes = far.read();
            let mut said = self.device.hear(now_s, &bytes);
            said.extend(self.device.live(now_s));
            for frame in said {
                self.send(&far, frame, mischief);
            }
            lock(&self.shared).lived(heard_ns, self.device.truth(), bytes.len() as u64);
        }
    }

    fn send(&mut self, far: &Far, mut frame: Vec<u8>, mischief: Mischief) {
        match mischief {
            Mischief::Unplugged | Mischief::Silent => return,
            Mischief::Garbage => frame.iter_mut().for_each(|byte| *byte = self.dice()),
            Mischief::Truncated => frame.truncate(frame.len() / 2),
            // One in eight, wherever it begins: a single one may fall where it changes nothing (a digit's case).
            Mischief::Flipped => {
                let first = usize::from(self.dice() % 8);
                frame.iter_mut().skip(first).step_by(8).for_each(|byte| *byte ^= 1);
            }
            Mischief::Stale => frame.clone_from(&self.last),
            Mischief::Noisy => far.write(&[self.dice() | 0x80, self.dice() | 0x80]),
            Mischief::None
            | Mischief::Split
            | Mischief::Reversed
            | Mischief::Scaled(_)
            | Mischief::Multiplied(_)
            | Mischief::Frozen => self.last.clone_from(&frame),
        }
        if mischief == Mischief::Split {
            let mut rest = frame.as_slice();
            while !rest.is_empty() {
                let (piece, after) = rest.split_at((1 + usize::from(self.dice() % 16)).min(rest.len()));
                far.write(piece);
                std::thread::sleep(Duration::from_micros(100));
                rest = after;
            }
        } else {
            far.write(&frame);
        }
    }

    /// A byte by chance (a linear congruence), the same in every run.
    fn dice(&mut self) -> u8 {
        self.dice = self.dice.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.dice >> 24) as u8
    }
}
