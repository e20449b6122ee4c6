//! A pseudo terminal under a name that stays: unplugged and plugged in again it is another device of the same name,
//! as udev's links are.

use std::io;
use std::os::fd::OwnedFd;
use std::path::Path;
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::fs::{Mode, OFlags, fcntl_setfl, open};
use rustix::io::Errno;
use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
use rustix::termios::{OptionalActions, tcgetattr, tcsetattr};

/// The device's end.
pub struct Pty {
    master: OwnedFd,
    /// Kept open, so that the other end coming and going is no hang-up.
    _slave: OwnedFd,
}

impl Pty {
    /// A new one, which `link` points at from now on.
    pub fn new(link: &Path) -> io::Result<Self> {
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY | OpenptFlags::CLOEXEC)?;
        grantpt(&master)?;
        unlockpt(&master)?;
        let name = ptsname(&master, Vec::new())?;
        let slave = open(name.as_c_str(), OFlags::RDWR | OFlags::NOCTTY | OFlags::CLOEXEC, Mode::empty())?;
        let mut settings = tcgetattr(&slave)?;
        settings.make_raw();
        tcsetattr(&slave, OptionalActions::Now, &settings)?;
        fcntl_setfl(&master, OFlags::NONBLOCK)?;
        let _ = std::fs::remove_file(link);
        std::os::unix::fs::symlink(name.to_string_lossy().as_ref(), link)?;
        Ok(Self { master, _slave: slave })
    }

    /// Waits for bytes, at most this long.
    pub fn wait(&self, most: Duration) {
        let most = Timespec { tv_sec: 0, tv_nsec: most.subsec_nanos().into() };
        let _ = poll(&mut [PollFd::new(&self.master, PollFlags::IN)], Some(&most));
    }

    /// Bytes that came.
    pub fn read(&self) -> Vec<u8> {
        let mut bytes = vec![0; 4096];
        let n = rustix::io::read(&self.master, &mut bytes).unwrap_or(0);
        bytes.truncate(n);
        bytes
    }

    /// Sends what fits; nobody who reads loses the rest, as on a wire.
    pub fn write(&self, mut bytes: &[u8]) {
        while !bytes.is_empty() {
            match rustix::io::write(&self.master, bytes) {
                Ok(n) => bytes = bytes.get(n..).unwrap_or_default(),
                Err(Errno::INTR) => (),
                Err(_) => return,
            }
        }
    }
}
