//! A serial port: raw, exclusive, and never waited for.
//!
//! `rustix` rather than the `serialport` crate: one `poll` over the port and the tick's wake-up needs
//! the descriptor non-blocking, which `serialport` hides behind a time-out of its own.

use std::io;
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::{Mode, OFlags, open};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr,
};

/// Bytes that may wait to be sent; one exchange is some tens.
const WAITING_MAX: usize = 1024;

/// An open port.
pub struct Port {
    descriptor: OwnedFd,
    waiting: Vec<u8>,
}

impl Port {
    /// Opens a device as 8N1 without flow control, at `baud` (an USB device takes any), for this process alone.
    ///
    /// # Errors
    /// What the system says: no such device, no permission, busy, not a terminal, a rate it does not know.
    pub fn open(path: &Path, baud: u32) -> io::Result<Self> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let descriptor = open(path, flags, Mode::empty())?;
        ioctl_tiocexcl(&descriptor)?;
        let mut settings = tcgetattr(&descriptor)?;
        settings.make_raw();
        settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
        settings.control_modes &= !(ControlModes::CRTSCTS | ControlModes::CSTOPB);
        settings.set_speed(baud)?;
        tcsetattr(&descriptor, OptionalActions::Now, &settings)?;
        // What was sent to somebody before us is not for us.
        tcflush(&descriptor, QueueSelector::IOFlush)?;
        Ok(Self { descriptor, waiting: Vec::with_capacity(WAITING_MAX) })
    }

    /// Reads what is there; zero if nothing is.
    ///
    /// # Errors
    /// The device is gone.
    pub fn read(&self, into: &mut [u8]) -> io::Result<usize> {
        match rustix::io::read(&self.descriptor, into) {
            Ok(0) => Err(io::Error::new(io::ErrorKind::UnexpectedEof, "the device hung up")),
            Ok(n) => Ok(n),
            Err(Errno::AGAIN | Errno::INTR) => Ok(0),
            Err(error) => Err(error.into()),
        }
    }

    /// Is something waiting to be sent?
    pub fn is_behind(&self) -> bool {
        !self.waiting.is_empty()
    }

    /// Sends as much as the device takes now, and keeps the rest for the next call. Bytes beyond what may wait are
    /// refused whole: half a frame must not go out.
    ///
    /// # Errors
    /// The device is gone.
    pub fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.waiting.len() + bytes.len() <= WAITING_MAX {
            self.waiting.extend_from_slice(bytes);
        }
        while !self.waiting.is_empty() {
            match rustix::io::write(&self.descriptor, &self.waiting) {
                Ok(n) => drop(self.waiting.drain(..n)),
                Err(Errno::AGAIN | Errno::INTR) => break,
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl AsFd for Port {
    fn as_fd(&self) -> BorrowedFd<'_> {
        self.descriptor.as_fd()
    }
}
