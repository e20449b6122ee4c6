//! Who is connected: caps by peer and in all. A slow or silent peer costs connections, never the stop: where a
//! cap is reached the connection that has been idle longest makes room, and some are kept back that only stop. A stream is
//! never idle: only so many connections may become one, and the rest is left to requests.

use std::future::Future;
use std::net::IpAddr;
use std::pin::Pin;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::task::{Context, Poll};
use std::time::{Duration, Instant};

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};
use tokio::sync::Notify;
use tokio::time::Sleep;

use crate::thruster::lock;

/// A peer that takes nothing for this long is gone: its connection ends.
const WRITE_TIMEOUT: Duration = Duration::from_secs(15);

/// What counts as one peer: of IPv6 a whole subnet, for a host has as many addresses there as it likes.
pub fn subnet(peer: IpAddr) -> u128 {
    match peer.to_canonical() {
        IpAddr::V4(address) => address.to_ipv6_mapped().into(),
        IpAddr::V6(address) => u128::from(address) >> 64,
    }
}

/// How many connections there may be.
#[derive(Clone, Copy, Debug)]
pub struct Caps {
    /// In all.
    pub total: usize,
    /// From one peer: an address, of IPv6 a subnet.
    pub per_peer: usize,
    /// Beyond `total`, for stop and disarm alone.
    pub reserve: usize,
}

impl Caps {
    /// How many of so many connections may be streams: a quarter is left to requests.
    fn streams(of: usize) -> usize {
        of - of / 4
    }
}

/// One connection.
#[derive(Debug)]
pub struct Slot {
    number: u64,
    /// Who is at its other end.
    pub peer: IpAddr,
    /// Only stop and disarm are answered here.
    pub reserved: bool,
    /// Milliseconds since the table began at which it fell idle; zero while a request is worked on, [`ENDED`] once it made
    /// room for another.
    idle_since_ms: AtomicU64,
    began: Instant,
    /// It became a stream, and is one until it ends.
    streams: AtomicBool,
    /// Told to end and make room.
    pub evicted: Notify,
}

/// Of a connection that has no place any more.
const ENDED: u64 = u64::MAX;

impl Slot {
    /// A request is being worked on; false if this connection has no place any more, and nothing may begin on it.
    pub fn busy(&self) -> bool {
        self.turn(0)
    }

    /// It waits for the peer; false as [`Self::busy`].
    pub fn idle(&self) -> bool {
        self.turn((self.began.elapsed().as_millis() as u64).max(1))
    }

    fn turn(&self, idle_since_ms: u64) -> bool {
        let stands = |now: u64| (now != ENDED).then_some(idle_since_ms);
        self.idle_since_ms.fetch_update(Ordering::Relaxed, Ordering::Relaxed, stands).is_ok()
    }

    /// Takes its place away, if it still has been idle since then.
    fn end(&self, idle_since_ms: u64) -> bool {
        let ended =
            self.idle_since_ms.compare_exchange(idle_since_ms, ENDED, Ordering::Relaxed, Ordering::Relaxed);
        ended.inspect(|_| self.evicted.notify_one()).is_ok()
    }
}

/// All connections.
#[derive(Debug)]
pub struct Connections {
    caps: Caps,
    began: Instant,
    open: Mutex<Vec<Arc<Slot>>>,
    next: AtomicU64,
    refused: AtomicU64,
    evicted: AtomicU64,
}

impl Connections {
    /// None yet.
    pub fn new(caps: Caps) -> Connections {
        Connections {
            caps,
            began: Instant::now(),
            open: Mutex::default(),
            next: AtomicU64::new(1),
            refused: AtomicU64::new(0),
            evicted: AtomicU64::new(0),
        }
    }

    /// A place for a new connection of this peer; none if there is no room at all.
    pub fn admit(&self, peer: IpAddr) -> Option<Arc<Slot>> {
        let mut open = lock(&self.open);
        let (kept_back, of_all): (Vec<&Arc<Slot>>, _) = open.iter().partition(|slot| slot.reserved);
        let theirs = |slot: &Slot| subnet(slot.peer) == subnet(peer);
        let of_peer = of_all.iter().filter(|slot| theirs(slot)).count();
        let full = of_peer >= self.caps.per_peer || of_all.len() >= self.caps.total;
        // Ends the one that has been idle longest; one that falls to work just then keeps its place.
        let make_room = |of: &[&Arc<Slot>]| loop {
            let candidates = of.iter().filter(|slot| of_peer < self.caps.per_peer || theirs(slot));
            let since = candidates.map(|slot| (slot.idle_since_ms.load(Ordering::Relaxed), *slot));
            let waiting = since.filter(|(since_ms, _)| !matches!(*since_ms, 0 | ENDED));
            match waiting.min_by_key(|(since_ms, slot)| (*since_ms, slot.number)) {
                Some((since_ms, idle)) if idle.end(since_ms) => break Some(idle.number),
                Some(_) => {}
                None => break None,
            }
        };
        let in_place_of = if full { make_room(&of_all) } else { None };
        let (reserved, in_place_of) = match in_place_of {
            None if !full => (false, None),
            Some(ended) => (false, Some(ended)),
            // All are at work: what comes now may only stop, in place of another of that kind too.
            None if kept_back.len() < self.caps.reserve => (true, None),
            None => match make_room(&kept_back) {
                Some(ended) => (true, Some(ended)),
                None => {
                    self.refused.fetch_add(1, Ordering::Relaxed);
                    return None;
                }
            },
        };
        if let Some(number) = in_place_of {
            open.retain(|slot| slot.number != number);
            self.evicted.fetch_add(1, Ordering::Relaxed);
        }
        let slot = Arc::new(Slot {
            number: self.next.fetch_add(1, Ordering::Relaxed),
            peer,
            reserved,
            idle_since_ms: AtomicU64::new(0),
            began: self.began,
            streams: AtomicBool::new(false),
            evicted: Notify::new(),
        });
        slot.idle();
        open.push(Arc::clone(&slot));
        Some(slot)
    }

    /// May this connection become a stream? It is counted as one from here on then; else how many its peer, or all together,
    /// may have.
    ///
    /// # Errors
    /// The cap that is reached.
    pub fn stream(&self, slot: &Slot) -> Result<(), usize> {
        let open = lock(&self.open);
        let streams = || open.iter().filter(|other| other.streams.load(Ordering::Relaxed));
        let of_peer = streams().filter(|other| subnet(other.peer) == subnet(slot.peer)).count();
        for (there, cap) in [(of_peer, self.caps.per_peer), (streams().count(), self.caps.total)] {
            if there >= Caps::streams(cap) {
                return Err(Caps::streams(cap));
            }
        }
        slot.streams.store(true, Ordering::Relaxed);
        Ok(())
    }

    fn leave(&self, slot: &Slot) {
        lock(&self.open).retain(|other| other.number != slot.number);
    }

    /// Open now; refused and ended for others since start.
    pub fn counts(&self) -> (usize, u64, u64) {
        (lock(&self.open).len(), self.refused.load(Ordering::Relaxed), self.evicted.load(Ordering::Relaxed))
    }
}

/// A socket that holds its place for as long as it lives, upgrades included, and gives up on a peer that takes
/// nothing.
pub struct Seated<S> {
    socket: S,
    slot: Arc<Slot>,
    connections: Arc<Connections>,
    stuck: Option<Pin<Box<Sleep>>>,
}

impl<S> Seated<S> {
    /// Takes the place.
    pub fn new(socket: S, slot: Arc<Slot>, connections: Arc<Connections>) -> Seated<S> {
        Seated { socket, slot, connections, stuck: None }
    }

    /// What a write came to: pending for too long is an error.
    fn watch<T>(&mut self, cx: &mut Context<'_>, came: Poll<std::io::Result<T>>) -> Poll<std::io::Result<T>> {
        if came.is_ready() {
            self.stuck = None;
            return came;
        }
        let stuck = self.stuck.get_or_insert_with(|| Box::pin(tokio::time::sleep(WRITE_TIMEOUT)));
        match stuck.as_mut().poll(cx) {
            Poll::Ready(()) => Poll::Ready(Err(std::io::ErrorKind::TimedOut.into())),
            Poll::Pending => Poll::Pending,
        }
    }
}

impl<S> Drop for Seated<S> {
    fn drop(&mut self) {
        self.connections.leave(&self.slot);
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Seated<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<std::io::Result<()>> {
        Pin::new(&mut self.socket).poll_read(cx, buffer)
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Seated<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<std::io::Result<usize>> {
        let came = Pin::new(&mut self.socket).poll_write(cx, bytes);
        self.watch(cx, came)
    }

    fn poll_flush(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        let came = Pin::new(&mut self.socket).poll_flush(cx);
        self.watch(cx, came)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, cx: &mut Context<'_>) -> Poll<std::io::Result<()>> {
        let came = Pin::new(&mut self.socket).poll_shutdown(cx);
        self.watch(cx, came)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEERS: [IpAddr; 2] =
        [IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 1)), IpAddr::V4(std::net::Ipv4Addr::new(10, 0, 0, 2))];

    fn table() -> Connections {
        Connections::new(Caps { total: 6, per_peer: 4, reserve: 2 })
    }

    #[tokio::test]
    async fn the_longest_idle_of_a_greedy_peer_makes_room() {
        let table = table();
        let other = table.admit(PEERS[1]).unwrap();
        let first = table.admit(PEERS[0]).unwrap();
        std::thread::sleep(Duration::from_millis(5));
        for _ in 0..20 {
            assert!(!table.admit(PEERS[0]).unwrap().reserved);
        }
        first.evicted.notified().await;
        assert_eq!(table.counts().0, 5, "four of the one, and the other's");
        assert!(tokio::time::timeout(Duration::from_millis(5), other.evicted.notified()).await.is_err());
    }

    #[test]
    fn where_all_are_at_work_some_places_are_kept_for_stop() {
        let table = table();
        for _ in 0..4 {
            table.admit(PEERS[0]).unwrap().busy();
        }
        for _ in 0..2 {
            let slot = table.admit(PEERS[0]).unwrap();
            assert!(slot.reserved);
            slot.busy();
        }
        assert!(table.admit(PEERS[0]).is_none());
        assert_eq!(table.counts(), (6, 1, 0));
    }

    /// Streams are at work for as long as they are open: were every connection one, no command of that peer would pass.
    #[test]
    fn streams_leave_room_for_requests_of_the_same_peer() {
        let table = table();
        let streams: Vec<_> = (0..4).map(|_| table.admit(PEERS[0]).unwrap()).collect();
        let granted = streams.iter().map(|slot| {
            slot.busy();
            table.stream(slot)
        });
        assert_eq!(granted.collect::<Vec<_>>(), [Ok(()), Ok(()), Ok(()), Err(3)]);
        streams[3].idle();
        assert!(!table.admit(PEERS[0]).unwrap().reserved, "a request of theirs passes");
        let others: Vec<_> = (0..2).map(|_| table.admit(PEERS[1]).unwrap()).collect();
        let granted: Vec<_> = others.iter().map(|slot| table.stream(slot)).collect();
        assert_eq!(granted, [Ok(()), Ok(())], "five of all six");
        assert_eq!(table.stream(&table.admit(PEERS[1]).unwrap()), Err(5));
        table.leave(&streams[0]);
        assert_eq!(table.stream(&table.admit(PEERS[1]).unwrap()), Ok(()), "one ended");
    }

    #[test]
    fn a_host_with_many_addresses_of_its_subnet_is_one_peer() {
        let table = table();
        let address = |host: u128| IpAddr::from((0x2001_0db8_u128 << 96 | host).to_be_bytes());
        for host in 1..=4 {
            table.admit(address(host)).unwrap().busy();
        }
        assert!(table.admit(address(5)).unwrap().reserved, "its fifth, from its fifth address");
        let neighbour = IpAddr::from((0x2001_0db8_u128 << 96 | 1 << 64).to_be_bytes());
        assert!(!table.admit(neighbour).unwrap().reserved, "the next subnet is another peer");
    }

    /// Connections that only stop are no way around the caps: who takes the place of one may only stop too.
    #[test]
    fn who_takes_a_place_that_is_kept_back_gets_no_other() {
        let table = table();
        for _ in 0..4 {
            table.admit(PEERS[0]).unwrap().busy();
        }
        for _ in 0..20 {
            let idle = table.admit(PEERS[0]).unwrap();
            assert!(idle.reserved);
        }
        assert_eq!(table.counts().0, 6, "four at work and two kept back");
        assert!(!table.admit(PEERS[1]).unwrap().reserved, "another peer has its own");
    }
}
