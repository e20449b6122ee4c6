//! The thread that serves an analogue amplifier: files may take milliseconds, and a tick waits for none.

use std::sync::atomic::Ordering;
use std::time::{Duration, Instant};

use kort_proto::faults::Fault;
use kort_proto::transport::monotonic_ns;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tracing::{info, warn};

use super::Iio;
use super::files::Files;
use super::interlock::{Found, Interlock, Look};
use crate::link::{Ends, Told, below_the_loop, printable};

/// Pause before files that could not be served are looked for again.
const AGAIN: Duration = Duration::from_millis(250);
/// Longest wait without a tick.
const LONGEST_WAIT: Duration = Duration::from_millis(20);

pub(super) struct Serving {
    name: String,
    iio: Iio,
    ends: Ends,
    told: Told,
    interlock: Interlock,
    /// Said last, so that what lasts is said once.
    complaint: String,
    /// The DAC is there.
    answered: bool,
    /// The enable fell, or did not come, while somebody was armed.
    fault: bool,
}

impl Serving {
    pub(super) fn new(name: String, iio: Iio, ends: Ends) -> Self {
        let interlock = Interlock::new((iio.timeout_s * 1e9) as u64, (iio.full_drive_s * 1e9) as u64);
        Self {
            name,
            iio,
            ends,
            told: Told::NOTHING,
            interlock,
            complaint: String::new(),
            answered: false,
            fault: false,
        }
    }

    pub(super) fn run(mut self, priority: i32) {
        below_the_loop(priority);
        while !self.ends.ending.load(Ordering::Relaxed) {
            if let Err(words) = self.begin().and_then(|files| self.serve(files)) {
                self.complain(&words);
                std::thread::sleep(AGAIN);
            }
        }
    }

    fn begin(&mut self) -> Result<Files, String> {
        self.told.guarded = false;
        self.answered = false;
        let name = Files::name(&self.iio).inspect_err(|_| self.publish())?;
        self.answered = true;
        self.publish();
        let files = Files::find(&self.iio, &name)?;
        info!("{}: DAC {}, at {}", self.name, printable(&name), self.iio.dac.folder.display());
        if self.iio.watchdog.is_none() {
            self.complain("`drive.watchdog` = \"none\": nothing takes the torque away when kort dies, so nobody can arm\nhint: docs/hardware.md says how a watchdog is wired");
        }
        self.interlock.begin(monotonic_ns());
        Ok(files)
    }

    /// Exchanges until a file is lost or the servo ends.
    fn serve(&mut self, mut files: Files) -> Result<(), String> {
        let done = self.exchange(&mut files);
        // Whatever it was: zero, if that still can be said. The pulse has ended.
        let zero = files.put(0.0);
        if done.is_err() {
            self.told.guarded = false;
            self.answered = false;
            self.fault = false;
            self.publish();
        }
        done.and(zero)
    }

    fn exchange(&mut self, files: &mut Files) -> Result<(), String> {
        let period = Duration::from_secs_f64(1.0 / self.iio.rate_hz);
        let mut next = Instant::now();
        while !self.ends.ending.load(Ordering::Relaxed) {
            self.wait(period)?;
            let ticked = self.ends.commands.update();
            let command = self.ends.commands.output_buffer().drive;
            // Off goes out at once, whatever the rate, and before anything that takes its time.
            let off = self.interlock.drives() && command.is_none();
            if off {
                files.put(0.0)?;
            }
            let now = Instant::now();
            // A servo that stands still gives neither command nor pulse.
            if (now < next || (self.interlock.drives() && !ticked)) && !off {
                continue;
            }
            next = (next + period).max(now);
            self.look(files, command.is_some())?;
            let share = self.interlock.share(monotonic_ns());
            files.put(command.unwrap_or(0.0) * share * self.iio.sign / self.iio.gain)?;
            if self.interlock.pulses(ticked) {
                let from_ns = monotonic_ns();
                files.pulse()?;
                self.interlock.pulsed(from_ns, monotonic_ns());
            }
            // Last: a conversion takes its time, and the command need not wait for it.
            let stamp_ns = monotonic_ns();
            let signals = files.measure()?;
            self.told.take(signals, Some(stamp_ns));
            self.publish();
        }
        Ok(())
    }

    /// Looks at the amplifier's enable, and says what follows.
    fn look(&mut self, files: &Files, wanted: bool) -> Result<(), String> {
        let from_ns = monotonic_ns();
        let Some(enabled) = files.enabled()? else { return Ok(()) };
        let look = Look { from_ns, to_ns: monotonic_ns(), enabled, wanted };
        let Some(found) = self.interlock.look(look) else { return Ok(()) };
        let (timeout_ms, file) = (self.iio.timeout_s * 1e3, self.enabled());
        self.told.guarded = matches!(found, Found::Guards(_));
        self.fault = matches!(found, Found::Fell | Found::NotEnabled);
        match found {
            Found::Guards(after_ns) => {
                let after_ms = after_ns as f64 * 1e-6;
                info!("{}: the watchdog takes its enable away {after_ms:.0} ms after the last pulse, at the latest", self.name);
                self.complaint.clear();
            }
            Found::StaysOn => self.complain(&format!("the watchdog does not take its enable away: {file} stays 1 for more than {timeout_ms} ms without a pulse\nhint: is it set to a shorter time, and wired into the enable? or a longer `timeout_ms`")),
            Found::StaysOff => self.complain(&format!("its enable does not come: {file} stays 0 under the pulse\nhint: power, emergency stop, the watchdog's wiring; or `rate_hz` is too low for it")),
            Found::Comes => self.complain(&format!("{file} came without a pulse\nhint: does somebody else pulse the watchdog, or is it bridged?")),
            Found::NotEnabled => self.complain(&format!("its enable did not come: {file} stays 0 under the pulse\nhint: power, emergency stop, a fault of the amplifier's own")),
            Found::Fell => self.complain(&format!("its enable fell under the pulse: {file}\nhint: emergency stop, a fault of the amplifier's own, or a machine that was busy for longer than the watchdog waits")),
        }
        Ok(())
    }

    fn enabled(&self) -> String {
        self.iio.watchdog.as_ref().map_or_else(String::new, |watchdog| watchdog.enabled.display().to_string())
    }

    /// Leaves for the tick what is known. An amplifier without a confirmed watchdog is not one to be armed.
    fn publish(&mut self) {
        let why = match (self.told.guarded, self.answered) {
            (true, _) => 0,
            (false, true) => Fault::DriveUnguarded.bit(),
            (false, false) => Fault::DriveLost.bit(),
        };
        let own = if self.fault { Fault::AmplifierFault.bit() } else { 0 };
        self.told.faults = own | why;
        self.ends.tell.write(self.told);
    }

    /// Sleeps until the loop ticks or some time passes.
    fn wait(&self, period: Duration) -> Result<(), String> {
        let longest = Timespec { tv_sec: 0, tv_nsec: period.min(LONGEST_WAIT).subsec_nanos().into() };
        match poll(&mut [PollFd::new(&*self.ends.waker, PollFlags::IN)], Some(&longest)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => (),
            Err(error) => return Err(format!("its ticks cannot be waited for: {error}")),
        }
        let _ = rustix::io::read(&*self.ends.waker, &mut [0; 8]);
        Ok(())
    }

    fn complain(&mut self, words: &str) {
        if self.complaint != words {
            warn!("{}: {}", self.name, printable(words));
            words.clone_into(&mut self.complaint);
        }
    }
}
