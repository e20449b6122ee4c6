//! What systemd is told (`Type=notify`): that the service is up, that it lives, that it ends. Elsewhere nobody listens, and
//! nothing is said.

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// The word with systemd.
pub struct System {
    ready: bool,
    /// It ends a service that has not been heard for this long.
    patience: Option<Duration>,
    told: Instant,
}

impl System {
    /// Before the first word.
    pub fn new() -> Self {
        Self { ready: false, patience: sd_notify::watchdog_enabled(), told: Instant::now() }
    }

    /// Called by the loop that watches the processes, and by nobody else: if it hangs, systemd hears no more.
    pub fn look(&mut self, all_up: bool) {
        if all_up && !self.ready {
            self.ready = true;
            say(&[NotifyState::Ready, NotifyState::Status("servo, controller and gateway are up")]);
        }
        if self.patience.is_some_and(|patience| self.told.elapsed() > patience / 4) {
            self.told = Instant::now();
            say(&[NotifyState::Watchdog]);
        }
    }
}

/// Thrust goes to zero, then the processes end.
pub fn stopping() {
    say(&[NotifyState::Stopping, NotifyState::Status("thrust goes to zero")]);
}

/// What cannot be said is no reason to end.
fn say(words: &[NotifyState]) {
    let _ = sd_notify::notify(words);
}
