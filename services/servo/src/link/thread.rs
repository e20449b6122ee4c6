//! The thread behind a wire.

use std::io;
use std::os::fd::OwnedFd;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use kort_proto::faults::Fault;
use kort_proto::transport::{monotonic_ns, ordinary, realtime};
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use tracing::{info, warn};
use triple_buffer::{Input, Output};

use super::port::Port;
use super::stamps::Stamps;
use super::wire::{Command, Ends, Told, Wire};
use super::{Heard, Protocol};

/// Pause before a port that could not be opened, or was lost, is tried again.
const AGAIN: Duration = Duration::from_millis(250);
/// Pause between two questions on the way to a confirmed time-out.
const ASK_AGAIN: Duration = Duration::from_millis(100);
/// Longest wait without bytes and without a tick.
const LONGEST_WAIT_NS: i64 = 20_000_000;

pub(super) struct Serving {
    wire: Wire,
    protocol: Box<dyn Protocol>,
    commands: Output<Command>,
    tell: Input<Told>,
    told: Told,
    waker: Arc<OwnedFd>,
    ending: Arc<AtomicBool>,
    /// Said last, so that what lasts is said once.
    complaint: String,
    /// Who answered last, likewise: a drive that is refused is asked again and again.
    who: String,
    /// The fault that the device reports of itself.
    fault: Option<String>,
    /// The device has said something since the port was opened.
    answered: bool,
    driving: bool,
    /// When bytes came last, on CLOCK_MONOTONIC, ns.
    heard_ns: u64,
    /// When its time-out was confirmed, on CLOCK_MONOTONIC, ns.
    guarded_ns: u64,
    stamps: Stamps,
}

impl Serving {
    pub(super) fn new(wire: Wire, protocol: Box<dyn Protocol>, ends: Ends) -> Self {
        let Ends { commands, tell, waker, ending } = ends;
        let stamps = Stamps::new(protocol.ages(), wire.reading_life_ns);
        Self {
            wire,
            protocol,
            commands,
            tell,
            told: Told::NOTHING,
            waker,
            ending,
            complaint: String::new(),
            who: String::new(),
            fault: None,
            answered: false,
            driving: false,
            heard_ns: 0,
            guarded_ns: 0,
            stamps,
        }
    }

    pub(super) fn run(mut self) {
        below_the_loop(self.wire.priority);
        while !self.ending.load(Ordering::Relaxed) {
            let done = Port::open(&self.wire.medium).and_then(|mut port| self.serve(&mut port));
            if let Err(error) = done {
                let medium = &self.wire.medium;
                self.complain(format!("{medium}: {error}\nhint: {}", medium.hint()));
                self.lost();
                std::thread::sleep(AGAIN);
            }
        }
    }

    /// The port is gone.
    fn lost(&mut self) {
        self.driving = false;
        self.begin();
    }

    /// Leaves for the tick what is known. A drive whose time-out is not confirmed, now, is not one to be armed.
    fn publish(&mut self) {
        let why = match (self.wire.is_drive && !self.told.guarded, self.answered) {
            (false, _) => 0,
            (true, true) => Fault::DriveUnguarded.bit(),
            (true, false) => Fault::DriveLost.bit(),
        };
        let own = if self.fault.is_some() { Fault::AmplifierFault.bit() } else { 0 };
        self.told.faults = own | why;
        self.tell.write(self.told);
    }

    /// Talks until the port is lost or the servo ends.
    fn serve(&mut self, port: &mut Port) -> io::Result<()> {
        // A datagram, as long as a network carries, is read whole.
        let mut bytes = [0; 2048];
        let mut out = Vec::with_capacity(1024);
        let period = Duration::from_secs_f64(1.0 / self.wire.rate_hz);
        let (mut next, mut ask_next) = (Instant::now(), Instant::now());
        self.begin();
        self.driving = false;
        loop {
            if self.ending.load(Ordering::Relaxed) {
                out.clear();
                self.protocol.tell(None, false, &mut out);
                return port.send(&out);
            }
            self.wait(port)?;
            let n = port.read(&mut bytes)?;
            self.hear(bytes.get(..n).unwrap_or_default());
            out.clear();
            self.protocol.reply(&mut out);
            port.send(&out)?;
            let silent_ns = monotonic_ns().saturating_sub(self.told.stamp_ns.max(self.guarded_ns));
            if self.told.guarded && silent_ns > self.wire.reading_life_ns {
                self.complain(self.silence());
                // Perhaps it still hears, though it is not heard: off, while it is known how it wants to be spoken to.
                if std::mem::take(&mut self.driving) {
                    out.clear();
                    self.protocol.tell(None, false, &mut out);
                    port.send(&out)?;
                }
                // Whoever answers next may have been reset, or be another one.
                self.begin();
            }
            // An instrument hears no commands; it is asked at its own rate.
            let ticked = self.commands.update() || !self.wire.is_drive;
            let command = *self.commands.output_buffer();
            let now = Instant::now();
            out.clear();
            if !self.told.guarded {
                if std::mem::take(&mut self.driving) {
                    // It was reset, or is not to be driven any more: off.
                    self.protocol.tell(None, false, &mut out);
                } else if now >= ask_next {
                    ask_next = now + ASK_AGAIN;
                    self.converse(|protocol, heard| protocol.ask(&mut out, heard));
                }
            } else if ticked && !port.is_behind() {
                // Off goes out at once, whatever the rate.
                let off = self.driving && command.drive.is_none();
                if now >= next || off {
                    next = (next + period).max(now);
                    self.driving = command.drive.is_some();
                    // Late answers would pile up, and old ones pass for new, if it were asked on.
                    let question = self.stamps.exchange(monotonic_ns());
                    self.protocol.tell(command.drive, question, &mut out);
                }
            }
            port.send(&out)?;
        }
    }

    /// What is seen of a device that gives no readings any more.
    fn silence(&self) -> String {
        let life_ms = self.wire.reading_life_ns / 1_000_000;
        if monotonic_ns().saturating_sub(self.heard_ns) > self.wire.reading_life_ns / 2 {
            return format!(
                "nothing came for {life_ms} ms\nhint: its supply, the plug, both ends of the cable"
            );
        }
        format!(
            "no reading for {life_ms} ms, though bytes come\nhint: a line that is disturbed, another speed of the line, or another \
             device on it"
        )
    }

    /// A new conversation: what was known of the device is known no more, its fault neither.
    fn begin(&mut self) {
        self.protocol.begin();
        self.stamps.forget(self.wire.reading_life_ns);
        self.answered = false;
        self.who.clear();
        self.fault = None;
        self.told.guarded = false;
        self.publish();
    }

    /// Sleeps until bytes come, the loop ticks, or some time passes.
    fn wait(&self, port: &Port) -> io::Result<()> {
        let interest = if port.is_behind() { PollFlags::IN | PollFlags::OUT } else { PollFlags::IN };
        let mut both = [PollFd::new(port, interest), PollFd::new(&*self.waker, PollFlags::IN)];
        let longest_ns = if self.wire.is_drive {
            LONGEST_WAIT_NS
        } else {
            LONGEST_WAIT_NS.min((1e9 / self.wire.rate_hz) as i64)
        };
        let longest = Timespec { tv_sec: 0, tv_nsec: longest_ns };
        match poll(&mut both, Some(&longest)) {
            Ok(_) | Err(rustix::io::Errno::INTR) => (),
            Err(error) => return Err(error.into()),
        }
        let _ = rustix::io::read(&*self.waker, &mut [0; 8]);
        Ok(())
    }

    /// Has the protocol read, and leaves for the tick what it made of it.
    fn hear(&mut self, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        self.heard_ns = monotonic_ns();
        self.converse(|protocol, heard| protocol.hear(bytes, heard));
    }

    fn converse(&mut self, talk: impl FnOnce(&mut dyn Protocol, &mut dyn FnMut(Heard))) {
        let Self { protocol, wire, told, answered, complaint, who, fault, guarded_ns, stamps, .. } = self;
        let mut restarted = false;
        talk(protocol.as_mut(), &mut |heard| match heard {
            Heard::Known(words) => {
                if *who != words {
                    info!("{}: {}", wire.name, printable(&words));
                    *who = words;
                }
                *answered = true;
            }
            // One that nobody asked for is an answer of before.
            Heard::Reading(signals) => told.take(signals, stamps.reading(monotonic_ns(), None)),
            Heard::ReadAt(signals, clock_us) => {
                told.take(signals, stamps.reading(monotonic_ns(), Some(clock_us)));
            }
            Heard::Marked(clock_us) => stamps.marked(monotonic_ns(), clock_us),
            Heard::Fault(reported) => {
                if let Some(words) = reported.as_ref().filter(|_| *fault != reported) {
                    warn!("{}: {}", wire.name, printable(words));
                }
                *fault = reported;
            }
            Heard::Restarted => {
                warn!("{} was reset", wire.name);
                told.restarts = told.restarts.wrapping_add(1);
                restarted = true;
            }
            Heard::Guarded(words) => {
                info!("{}: {}", wire.name, printable(&words));
                told.guarded = true;
                *guarded_ns = monotonic_ns();
                complaint.clear();
            }
            Heard::Unguarded(words) => {
                told.guarded = false;
                if *complaint != words {
                    warn!("{}: {}", wire.name, printable(&words));
                    *complaint = words;
                }
            }
        });
        if restarted {
            self.begin();
            self.answered = true;
        }
        self.publish();
    }

    fn complain(&mut self, words: String) {
        if self.complaint != words {
            warn!("{}: {words}", self.wire.name);
            self.complaint = words;
        }
    }
}

/// Puts this thread just below the loop, whose priority this is.
pub(crate) fn below_the_loop(priority: i32) {
    if priority > 0 {
        // What is not permitted the loop's own thread has said.
        let _ = realtime((priority - 1).max(1), false);
    } else {
        ordinary();
    }
}

/// Words with something of a device in them, as they may stand in a log: no control character but the break before a hint.
pub(crate) fn printable(words: &str) -> String {
    let escaped =
        |c: char| if c.is_control() && c != '\n' { c.escape_default().collect() } else { c.to_string() };
    words.chars().map(escaped).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_device_prints_cannot_steer_a_terminal() {
        assert_eq!(printable("prints `\u{1b}[2J 1.0`\nhint: é"), "prints `\\u{1b}[2J 1.0`\nhint: é");
    }
}
