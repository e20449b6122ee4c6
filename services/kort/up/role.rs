//! One child process of the supervisor and how it fares.

use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, Command};
use std::time::{Duration, Instant};

use kort_proto::messages::Trip;
use rustix::process::{Pid, Signal, kill_process, set_parent_process_death_signal};
use tracing::{info, warn};

use super::{STOP_WITHIN, UpError};

/// A child that lived shorter than this did not start properly.
const START: Duration = Duration::from_secs(3);
/// A child beats this long after its start at the latest, busy machines included.
const FIRST_BEAT: Duration = Duration::from_secs(6);
/// One that has beaten and did not for this long hangs: it is ended and replaced.
const HUNG_AFTER: Duration = Duration::from_secs(2);
/// Ends in quick succession that are followed by a start at once; after them starts come slower and slower.
const AT_ONCE: u32 = 5;
const SLOWEST: Duration = Duration::from_secs(2);

/// What a child is started with beside the deployment.
#[derive(Clone, Copy, Debug, Default)]
pub struct Heritage {
    /// Faults that its predecessor had latched, or that its end is.
    pub latched: u64,
    /// The stop that ended its predecessor.
    pub tripped: Trip,
}

/// A child process.
pub struct Role {
    /// `servo`, `controller` or `gateway`.
    pub name: &'static str,
    /// Its thruster; none for the gateway.
    pub thruster: Option<String>,
    /// The process, while it lives.
    pub child: Option<Child>,
    started: Instant,
    /// When it was last heard, started, or excused.
    beat: Instant,
    /// Has it beaten since its start?
    beats: bool,
    /// Starts in a row that failed.
    pub failed_starts: u32,
    /// It cannot use the configuration.
    pub refused: bool,
    /// Starts beyond the first.
    pub restarts: u64,
    quick_ends: u32,
    not_before: Instant,
}

/// How a child ended.
pub struct Ended {
    /// The system's words, and ours where they say more.
    pub why: String,
}

impl Role {
    /// Not started yet.
    pub fn new(name: &'static str, thruster: Option<&str>) -> Self {
        let now = Instant::now();
        Self {
            name,
            thruster: thruster.map(Into::into),
            child: None,
            started: now,
            beat: now,
            beats: false,
            failed_starts: 0,
            refused: false,
            restarts: 0,
            quick_ends: 0,
            not_before: now,
        }
    }

    /// May it be started now? After quick ends it waits.
    pub fn due(&self) -> bool {
        self.child.is_none() && Instant::now() >= self.not_before
    }

    /// Starts it.
    pub fn start(
        &mut self,
        program: &Path,
        config: Option<&Path>,
        root: &Path,
        heritage: Heritage,
    ) -> Result<(), UpError> {
        let mut command = Command::new(program);
        command.arg(self.name).arg("--root").arg(root);
        if let Some(config) = config {
            command.arg("--config").arg(config);
        }
        if let Some(thruster) = &self.thruster {
            command.arg("--thruster").arg(thruster);
            if heritage.latched != 0 {
                command.arg("--latched").arg(heritage.latched.to_string());
            }
        }
        if self.name == "servo" {
            command.arg("--join");
            let Trip { at_ns, thrust_n, shaft_speed_rad_s, .. } = heritage.tripped;
            if heritage.latched != 0 && at_ns != 0 {
                command.arg(format!("--tripped={at_ns},{thrust_n},{shaft_speed_rad_s}"));
            }
        }
        // A group of its own: Ctrl-C on the terminal reaches only the supervisor.
        command.process_group(0);
        // The servo must set its drive to zero when the supervisor dies; the others just end.
        let last = if self.name == "servo" { Signal::TERM } else { Signal::KILL };
        let supervisor = rustix::process::getpid();
        // SAFETY: prctl and getppid are async-signal-safe and allocate nothing.
        unsafe {
            command.pre_exec(move || {
                set_parent_process_death_signal(Some(last))?;
                // The supervisor may have died before the line above.
                if rustix::process::getppid() != Some(supervisor) {
                    return Err(std::io::ErrorKind::Interrupted.into());
                }
                Ok(())
            });
        }
        let child = command
            .spawn()
            .map_err(|error| UpError::System { what: format!("starting {}", self.name), error })?;
        info!(thruster = self.thruster, process = child.id(), "{} started", self.name);
        self.child = Some(child);
        self.started = Instant::now();
        (self.beat, self.beats) = (self.started, false);
        Ok(())
    }

    /// Up for long enough to believe in it; forgets failed starts.
    pub fn is_up(&self) -> bool {
        self.child.is_some() && self.started.elapsed() >= START
    }

    /// It was heard.
    pub fn heard(&mut self) {
        (self.beat, self.beats) = (Instant::now(), true);
    }

    /// Its silence up to now is not its own doing.
    pub fn excuse(&mut self) {
        self.beat = Instant::now();
    }

    /// Does it live without a sign of life? For how long then.
    pub fn hangs(&self) -> Option<Duration> {
        let patience = if self.beats { HUNG_AFTER } else { FIRST_BEAT };
        (self.child.is_some() && self.beat.elapsed() > patience).then_some(patience)
    }

    /// Ends a child that does not listen any more.
    pub fn kill(&mut self) {
        if let Some(child) = &mut self.child {
            let _ = child.kill();
        }
    }

    /// Did it end since the last look? Counts a start that failed, and says when the next may come.
    pub fn look(&mut self) -> Option<Ended> {
        let child = self.child.as_mut()?;
        let status = match child.try_wait() {
            Ok(Some(status)) => status,
            _ => {
                if self.is_up() {
                    self.failed_starts = 0;
                    self.quick_ends = 0;
                }
                return None;
            }
        };
        // Killed from outside is no failed start: whoever killed it may do so at any instant.
        let killed = status.signal() == Some(Signal::KILL.as_raw());
        self.failed_starts = if killed || self.is_up() { 0 } else { self.failed_starts + 1 };
        // Exit code 2: wrong input, and no restart makes it right.
        self.refused = status.code() == Some(2) && !self.is_up();
        self.quick_ends = if self.is_up() { 0 } else { self.quick_ends + 1 };
        let wait = match self.quick_ends.checked_sub(AT_ONCE) {
            None | Some(0) => Duration::ZERO,
            Some(n) => Duration::from_millis(100 << n.min(6)).min(SLOWEST),
        };
        self.not_before = Instant::now() + wait;
        let full = status.signal() == Some(Signal::BUS.as_raw());
        let hint = if full { "\nhint: /dev/shm is full (df /dev/shm)" } else { "" };
        warn!(thruster = self.thruster, "{} ended ({status}){hint}", self.name);
        self.child = None;
        Some(Ended { why: status.to_string() })
    }

    /// Ends it: asks, and kills what does not answer. Whether it ended by itself, in order.
    pub fn end(&mut self) -> bool {
        let Some(mut child) = self.child.take() else { return true };
        if let Some(pid) = i32::try_from(child.id()).ok().and_then(Pid::from_raw) {
            let _ = kill_process(pid, Signal::TERM);
        }
        let end = Instant::now() + STOP_WITHIN;
        while Instant::now() < end {
            match child.try_wait() {
                Ok(None) => {}
                Ok(Some(status)) => return status.success(),
                Err(_) => return false,
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        warn!(thruster = self.thruster, "{} does not end, killed", self.name);
        let _ = child.kill();
        let _ = child.wait();
        false
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_that_has_beaten_hangs_after_two_seconds_however_young_it_is() {
        let mut role = Role::new("servo", None);
        role.child = Some(Command::new("sleep").arg("60").spawn().unwrap());
        let ago = |ms| Instant::now() - Duration::from_millis(ms);
        (role.started, role.beat) = (ago(2500), ago(2500));
        assert_eq!(role.hangs(), None, "it is starting");
        role.heard();
        assert_eq!(role.hangs(), None);
        role.beat = ago(2100);
        assert_eq!(role.hangs(), Some(HUNG_AFTER));
        role.excuse();
        assert_eq!(role.hangs(), None, "the machine stood still");
        (role.beat, role.beats) = (ago(6100), false);
        assert_eq!(role.hangs(), Some(FIRST_BEAT), "it never came up");
        role.kill();
        let _ = role.child.take().unwrap().wait();
    }
}
