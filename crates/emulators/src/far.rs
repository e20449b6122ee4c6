//! The device's end of the wire: a pseudo terminal, or an endpoint of UDP.

use std::io;
use std::net::{SocketAddr, UdpSocket};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::event::{PollFd, PollFlags, Timespec, poll};

use crate::pty::Pty;

/// The end, and how it is plugged in again.
pub struct Far {
    line: Option<Line>,
    name: Name,
}

enum Line {
    Terminal(Pty),
    /// With who spoke last: whom it answers.
    Udp(UdpSocket, Option<SocketAddr>),
}

enum Name {
    Link(PathBuf),
    Address(SocketAddr),
}

impl Far {
    /// A pseudo terminal under this name.
    pub fn terminal(link: &Path) -> io::Result<Self> {
        Ok(Self { line: Some(Line::Terminal(Pty::new(link)?)), name: Name::Link(link.to_owned()) })
    }

    /// An address on this machine.
    pub fn endpoint() -> io::Result<Self> {
        let socket = udp("127.0.0.1:0".parse().map_err(io::Error::other)?)?;
        let address = socket.local_addr()?;
        Ok(Self { line: Some(Line::Udp(socket, None)), name: Name::Address(address) })
    }

    /// What `port` is told.
    pub fn name(&self) -> PathBuf {
        match &self.name {
            Name::Link(link) => link.clone(),
            Name::Address(address) => format!("udp:{address}").into(),
        }
    }

    /// Pulls the plug, or puts it in again.
    pub fn plug(&mut self, plugged: bool) {
        if !plugged && self.line.take().is_some() {
            if let Name::Link(link) = &self.name {
                let _ = std::fs::remove_file(link);
            }
        } else if plugged && self.line.is_none() {
            self.line = match &self.name {
                Name::Link(link) => Pty::new(link).ok().map(Line::Terminal),
                Name::Address(address) => udp(*address).ok().map(|socket| Line::Udp(socket, None)),
            };
        }
    }

    /// Waits for bytes, at most this long.
    pub fn wait(&self, most: Duration) {
        match &self.line {
            Some(Line::Terminal(pty)) => pty.wait(most),
            Some(Line::Udp(socket, _)) => {
                let most = Timespec { tv_sec: 0, tv_nsec: most.subsec_nanos().into() };
                let _ = poll(&mut [PollFd::new(socket, PollFlags::IN)], Some(&most));
            }
            None => std::thread::sleep(most),
        }
    }

    /// Bytes that came.
    pub fn read(&mut self) -> Vec<u8> {
        match &mut self.line {
            Some(Line::Terminal(pty)) => pty.read(),
            Some(Line::Udp(socket, whom)) => {
                let mut bytes = vec![0; 4096];
                let (n, from) = socket.recv_from(&mut bytes).map_or((0, None), |(n, from)| (n, Some(from)));
                *whom = from.or(*whom);
                bytes.truncate(n);
                bytes
            }
            None => Vec::new(),
        }
    }

    /// Sends what fits; nobody who reads loses the rest, as on a wire.
    pub fn write(&self, bytes: &[u8]) {
        match &self.line {
            Some(Line::Terminal(pty)) => pty.write(bytes),
            Some(Line::Udp(socket, Some(whom))) => drop(socket.send_to(bytes, whom)),
            Some(Line::Udp(_, None)) | None => (),
        }
    }
}

fn udp(address: SocketAddr) -> io::Result<UdpSocket> {
    let socket = UdpSocket::bind(address)?;
    socket.set_nonblocking(true)?;
    Ok(socket)
}
