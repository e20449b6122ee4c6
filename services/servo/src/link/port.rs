//! A serial port, raw and exclusive, a CAN interface of the system, or an address by UDP: never waited for.
//!
//! `rustix` rather than the `serialport` crate: one `poll` over the port and the tick's wake-up needs
//! the descriptor non-blocking, which `serialport` hides behind a time-out of its own. The crate `socketcan` opens and filters
//! the CAN socket; frames are read and written as the kernel's records ([`super::can`]).

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::os::fd::{AsFd, BorrowedFd, OwnedFd};
use std::path::Path;

use rustix::fs::{FlockOperation, Mode, OFlags, flock, open};
use rustix::io::Errno;
use rustix::termios::{
    ControlModes, OptionalActions, QueueSelector, ioctl_tiocexcl, tcflush, tcgetattr, tcsetattr,
};
use socketcan::{CanFilter, CanSocket, Socket, SocketOptions};

use super::Medium;
use super::can::RECORD;

/// Bytes that may wait to be sent; one exchange is some tens.
const WAITING_MAX: usize = 1024;

/// Bits of a CANopen identifier that are the node.
const NODE: u32 = 0x7f;

enum Device {
    Serial(OwnedFd),
    Can(CanSocket),
    Udp(UdpSocket),
}

/// An open port.
pub struct Port {
    device: Device,
    waiting: Vec<u8>,
}

impl Port {
    /// Opens what leads to the device.
    ///
    /// # Errors
    /// What the system says.
    pub fn open(medium: &Medium) -> io::Result<Self> {
        match medium {
            Medium::Serial { port, baud } => Self::open_serial(port, *baud),
            Medium::Can { interface, node } => Self::open_can(interface, *node),
            Medium::Udp(address) => Self::open_udp(*address),
        }
    }

    /// Opens a device as 8N1 without flow control, at `baud` (an USB device takes any), for this process alone. Errors: no such device,
    /// no permission, busy, locked by another one of ours, not a terminal, a rate it does not know.
    fn open_serial(path: &Path, baud: u32) -> io::Result<Self> {
        let flags = OFlags::RDWR | OFlags::NOCTTY | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let descriptor = open(path, flags, Mode::empty())?;
        // Exclusive by the terminal does not hold for root, nor for who has it open already; a lock does, against all that take one.
        if flock(&descriptor, FlockOperation::NonBlockingLockExclusive) == Err(Errno::WOULDBLOCK) {
            return Err(io::Error::new(
                io::ErrorKind::ResourceBusy,
                "another thruster, instrument or program has it locked: one device a port",
            ));
        }
        ioctl_tiocexcl(&descriptor)?;
        let mut settings = tcgetattr(&descriptor)?;
        settings.make_raw();
        settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
        settings.control_modes &= !(ControlModes::CRTSCTS | ControlModes::CSTOPB);
        settings.set_speed(baud)?;
        tcsetattr(&descriptor, OptionalActions::Now, &settings)?;
        // What was sent to somebody before us is not for us.
        tcflush(&descriptor, QueueSelector::IOFlush)?;
        Ok(Self { device: Device::Serial(descriptor), waiting: Vec::with_capacity(WAITING_MAX) })
    }

    /// Opens a CAN interface by its name; of what others say on the bus, only frames of this node come in. Errors: no such
    /// interface, it is down, the kernel has no CAN.
    fn open_can(interface: &Path, node: u8) -> io::Result<Self> {
        let socket = CanSocket::open(&interface.to_string_lossy())?;
        socket.set_filters(&[CanFilter::new(u32::from(node), NODE)])?;
        Self::on_can(socket)
    }

    fn on_can(socket: CanSocket) -> io::Result<Self> {
        socket.set_nonblocking(true)?;
        Ok(Self { device: Device::Can(socket), waiting: Vec::with_capacity(WAITING_MAX) })
    }

    /// Speaks to an address and hears nobody else. Where nobody listens the answer to the first word is an error.
    fn open_udp(address: SocketAddr) -> io::Result<Self> {
        let any = if address.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
        let socket = UdpSocket::bind(any)?;
        socket.connect(address)?;
        socket.set_nonblocking(true)?;
        Ok(Self { device: Device::Udp(socket), waiting: Vec::with_capacity(WAITING_MAX) })
    }

    /// Reads what is there; zero if nothing is.
    ///
    /// # Errors
    /// The device is gone.
    pub fn read(&self, into: &mut [u8]) -> io::Result<usize> {
        match rustix::io::read(self, into) {
            // An empty datagram is nothing.
            Ok(0) if matches!(self.device, Device::Udp(_)) => Ok(0),
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
            // A raw socket takes one frame at a time.
            let most = if matches!(self.device, Device::Can(_)) { RECORD } else { WAITING_MAX };
            let next = self.waiting.get(..most).unwrap_or(&self.waiting);
            match rustix::io::write(&*self, next) {
                Ok(n) => drop(self.waiting.drain(..n)),
                Err(Errno::AGAIN | Errno::INTR) => break,
                // Nobody takes frames off the bus: what is late is of no use, and waiting for room would be a busy loop.
                Err(Errno::NOBUFS) => self.waiting.clear(),
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }
}

impl AsFd for Port {
    fn as_fd(&self) -> BorrowedFd<'_> {
        match &self.device {
            Device::Serial(descriptor) => descriptor.as_fd(),
            Device::Can(socket) => socket.as_fd(),
            Device::Udp(socket) => socket.as_fd(),
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::fd::OwnedFd;
    use std::os::unix::net::UnixDatagram;

    use super::super::can::{Carrier, Frame, Frames};
    use super::*;

    /// A pair of datagram sockets stands for the kernel's CAN, which not every kernel has: each write is one frame.
    #[test]
    fn each_frame_is_a_record_of_its_own() {
        let (near, far) = UnixDatagram::pair().unwrap();
        let mut port = Port::on_can(CanSocket::from(OwnedFd::from(near))).unwrap();
        let said = [Frame::new(0x201, &[0x0f, 0, 0x2c, 0x01]), Frame::new(0x080, &[])];
        let mut out = Vec::new();
        said.iter().for_each(|frame| Carrier::Socket.send(frame, &mut out));
        port.send(&out).unwrap();
        assert!(!port.is_behind());
        let mut bytes = [0; 64];
        for frame in said {
            let n = far.recv(&mut bytes).unwrap();
            assert_eq!(n, RECORD);
            assert_eq!(Frames::new(Carrier::Socket).take(&bytes[..n]), [frame]);
        }
        assert_eq!(port.read(&mut bytes).unwrap(), 0, "nothing is there, and it does not wait");
        far.send(&out[..RECORD]).unwrap();
        let n = port.read(&mut bytes).unwrap();
        assert_eq!(Frames::new(Carrier::Socket).take(&bytes[..n]), said[..1]);
    }

    /// A port by two names, as two thrusters may have it that started before it was plugged in: the second one is told so,
    /// root too, and has it once the first one lets go.
    #[test]
    fn a_serial_port_is_locked_against_a_second_opening() {
        use rustix::pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt};
        let master = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        grantpt(&master).unwrap();
        unlockpt(&master).unwrap();
        let name = ptsname(&master, Vec::new()).unwrap().into_string().unwrap();
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("by-id");
        std::os::unix::fs::symlink(&name, &link).unwrap();
        let first = Port::open_serial(Path::new(&name), 115_200).unwrap();
        let words = Port::open_serial(&link, 115_200).err().unwrap().to_string();
        assert!(words.contains("locked: one device a port") || words.contains("busy"), "{words}");
        drop(first);
        Port::open_serial(&link, 115_200).unwrap();
    }

    /// Where the kernel has no CAN, or no interface of this name, the way out is an error.
    #[test]
    fn an_interface_that_is_not_there_is_an_error() {
        assert!(Port::open_can(Path::new("kort-none"), 1).is_err());
    }
}
