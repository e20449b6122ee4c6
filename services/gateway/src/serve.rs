//! The port: accepts, speaks TLS where it has a certificate, and gives every phase of a connection its time.

use std::convert::Infallible;
use std::net::{IpAddr, SocketAddr};
use std::pin::Pin;
use std::sync::Arc;
use std::task::{Context, Poll};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use http_body::{Frame, SizeHint};
use hyper::body::Incoming;
use hyper_util::rt::{TokioIo, TokioTimer};
use socket2::{Domain, Protocol, Socket, Type};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::watch;
use tokio_rustls::TlsAcceptor;
use tower::ServiceExt;

use crate::connections::{Caps, Connections, Seated, Slot};
use crate::tls::Certificate;

/// A whole request head, and a TLS handshake, arrive within this time; a connection kept open is idle as long.
const HEAD_WITHIN: Duration = Duration::from_secs(5);
/// Connections that the system holds for us until we accept them.
const BACKLOG: i32 = 4096;
/// Bytes that the system holds for a slow reader: a state is small, and an old one is worth nothing.
const SEND_BUFFER_BYTES: usize = 64 * 1024;
/// Files for shared memory, recordings, the event log: what connections must not take.
const FILES_OF_OURS: u64 = 192;
/// Caps where the system permits them.
const CONNECTIONS: usize = 512;
const CONNECTIONS_PER_PEER: usize = 64;
const CONNECTIONS_KEPT_BACK: usize = 16;

/// Marks a request on a connection that is kept back for stop and disarm.
#[derive(Clone, Copy, Debug)]
pub struct Reserved;

/// Where a request comes from.
#[derive(Clone, Copy, Debug)]
pub struct Peer(pub IpAddr);

/// The connection that a request came on.
#[derive(Clone, Debug)]
pub struct Seat(pub Arc<Slot>);

/// What the port needs.
pub struct Port {
    /// Where requests go.
    pub router: Router,
    /// The certificate; none for plain HTTP.
    pub certificate: Option<Arc<Certificate>>,
    /// Who is connected.
    pub connections: Arc<Connections>,
    /// Turns true when the service stops.
    pub stopping: watch::Receiver<bool>,
}

/// Caps for what this process may open. Behind a proxy all come from one address.
pub fn caps(behind_proxy: bool) -> Caps {
    let files = rustix::process::getrlimit(rustix::process::Resource::Nofile).current.unwrap_or(1024);
    let room = usize::try_from(files.saturating_sub(FILES_OF_OURS)).unwrap_or(CONNECTIONS);
    let total = CONNECTIONS.min(room / 2).max(32);
    let per_peer = if behind_proxy { total } else { CONNECTIONS_PER_PEER.min(total / 2) };
    Caps { total, per_peer, reserve: CONNECTIONS_KEPT_BACK }
}

/// Listens with a long queue and small send buffers, which accepted connections inherit.
pub fn listen(bind: SocketAddr) -> std::io::Result<TcpListener> {
    let socket = Socket::new(Domain::for_address(bind), Type::STREAM, Some(Protocol::TCP))?;
    socket.set_reuse_address(true)?;
    socket.set_nonblocking(true)?;
    socket.set_send_buffer_size(SEND_BUFFER_BYTES)?;
    socket.bind(&bind.into())?;
    socket.listen(BACKLOG)?;
    TcpListener::from_std(socket.into())
}

/// Accepts until the service stops.
pub async fn run(listener: TcpListener, mut port: Port) {
    let mut look = tokio::time::interval(Duration::from_secs(1));
    loop {
        let accepted = tokio::select! {
            accepted = listener.accept() => accepted,
            _ = look.tick() => {
                if let Some(certificate) = &port.certificate {
                    certificate.refresh();
                }
                continue;
            }
            _ = port.stopping.changed() => return,
        };
        match accepted {
            Ok((socket, peer)) => seat(socket, peer.ip(), &port),
            // No descriptor is free, or the peer is gone already: others may end meanwhile.
            Err(error) => {
                tracing::debug!(%error, "accepting");
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
        }
    }
}

/// Gives a connection its place and its task.
fn seat(socket: TcpStream, peer: IpAddr, port: &Port) {
    let Some(slot) = port.connections.admit(peer) else { return };
    // States and setpoints are small and urgent: no waiting for more to send.
    if let Err(error) = socket.set_nodelay(true) {
        tracing::debug!(%error, "a connection keeps its delay");
    }
    let socket = Seated::new(socket, Arc::clone(&slot), Arc::clone(&port.connections));
    let (router, stopping) = (port.router.clone(), port.stopping.clone());
    let acceptor = port.certificate.as_ref().map(|certificate| TlsAcceptor::from(certificate.config()));
    tokio::spawn(async move {
        tokio::select! {
            // Who has no place any more gets no answer first.
            biased;
            () = slot.evicted.notified() => (),
            () = async {
                match acceptor {
                    None => speak(socket, router, &slot, stopping).await,
                    Some(acceptor) => {
                        if let Ok(Ok(socket)) = tokio::time::timeout(HEAD_WITHIN, acceptor.accept(socket)).await {
                            speak(socket, router, &slot, stopping).await;
                        }
                    }
                }
            } => (),
        }
    });
}

/// HTTP/1.1 on one connection until either side ends it.
async fn speak<S>(socket: S, router: Router, slot: &Arc<Slot>, mut stopping: watch::Receiver<bool>)
where
    S: AsyncRead + AsyncWrite + Unpin + Send + 'static,
{
    let theirs = Arc::clone(slot);
    let service = hyper::service::service_fn(move |request: hyper::Request<Incoming>| {
        // A request is at work once it is here as a whole: until then it waits for its peer like any other, and makes
        // room where there is none.
        let placed =
            if http_body::Body::is_end_stream(request.body()) { theirs.busy() } else { theirs.idle() };
        let (router, slot) = (router.clone(), Arc::clone(&theirs));
        async move {
            if !placed {
                // It ends with the next look of its task: no stream begins on it that nobody counts.
                let mut gone = hyper::Response::new(Answer { body: Body::empty(), idle_after: None });
                *gone.status_mut() = hyper::StatusCode::SERVICE_UNAVAILABLE;
                return Ok(gone);
            }
            let arriving = Arc::clone(&slot);
            let mut request = request.map(|body| Body::new(Arriving { body, slot: arriving }));
            request.extensions_mut().insert(Peer(slot.peer));
            request.extensions_mut().insert(Seat(Arc::clone(&slot)));
            if slot.reserved {
                request.extensions_mut().insert(Reserved);
            }
            let upgrade = request.headers().contains_key(hyper::header::UPGRADE);
            let response = match router.oneshot(request).await {
                Ok(response) => response,
                Err(never) => match never {},
            };
            // A WebSocket is at work for as long as it is open.
            let idle_after =
                (!upgrade || response.status() != hyper::StatusCode::SWITCHING_PROTOCOLS).then_some(slot);
            Ok::<_, Infallible>(response.map(|body| Answer { body, idle_after }))
        }
    });
    let connection = hyper::server::conn::http1::Builder::new()
        .timer(TokioTimer::new())
        .header_read_timeout(HEAD_WITHIN)
        .max_buf_size(64 * 1024)
        .serve_connection(TokioIo::new(socket), service)
        .with_upgrades();
    let mut connection = std::pin::pin!(connection);
    let ended = tokio::select! {
        ended = connection.as_mut() => ended,
        _ = stopping.changed() => {
            connection.as_mut().graceful_shutdown();
            connection.await
        }
    };
    if let Err(error) = ended {
        tracing::debug!(%error, "a connection ended");
    }
}

/// A request's body; the connection counts as at work once the whole of it is here.
struct Arriving {
    body: Incoming,
    slot: Arc<Slot>,
}

impl http_body::Body for Arriving {
    type Data = Bytes;
    type Error = hyper::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, hyper::Error>>> {
        let frame = std::task::ready!(Pin::new(&mut self.body).poll_frame(cx));
        if frame.is_none() || self.body.is_end_stream() {
            self.slot.busy();
        }
        Poll::Ready(frame)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}

/// An answer's body; the connection counts as idle once it is sent or dropped.
struct Answer {
    body: Body,
    idle_after: Option<Arc<Slot>>,
}

impl Drop for Answer {
    fn drop(&mut self) {
        if let Some(slot) = &self.idle_after {
            slot.idle();
        }
    }
}

impl http_body::Body for Answer {
    type Data = Bytes;
    type Error = axum::Error;

    fn poll_frame(
        mut self: Pin<&mut Self>,
        cx: &mut Context<'_>,
    ) -> Poll<Option<Result<Frame<Bytes>, axum::Error>>> {
        Pin::new(&mut self.body).poll_frame(cx)
    }

    fn is_end_stream(&self) -> bool {
        self.body.is_end_stream()
    }

    fn size_hint(&self) -> SizeHint {
        self.body.size_hint()
    }
}
