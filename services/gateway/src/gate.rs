//! The gate in front of every route: is it meant for us, who asks, and may they?

use std::collections::HashMap;
use std::net::{IpAddr, SocketAddr};
use std::sync::{Arc, Mutex, Weak};

use axum::extract::{Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use tokio::sync::Semaphore;

use crate::App;
use crate::connections::subnet;
use crate::hosts::Hosts;
use crate::problem::{Kind, Problem};
use crate::serve::{Peer, Reserved};
use crate::thruster::lock;
use crate::token::{Identity, LOCAL, Role, Tokens};

/// A browser cannot send `Authorization` with a WebSocket: it offers its token as a subprotocol.
const TOKEN_PROTOCOL: &str = "bearer.";

/// One of each peer waits for argon2: a flood of wrong tokens holds up its own peer, and no stop of another's. No two
/// peers share a lane, and there are no more of them than connections.
#[derive(Debug, Default)]
struct Lanes(Mutex<HashMap<Option<u128>, Weak<Semaphore>>>);

impl Lanes {
    /// The lane of a peer; of IPv6 a whole subnet, for a host has as many addresses there as it likes.
    fn of(&self, peer: Option<IpAddr>) -> Arc<Semaphore> {
        let subnet = peer.map(subnet);
        let mut lanes = lock(&self.0);
        if let Some(lane) = lanes.get(&subnet).and_then(Weak::upgrade) {
            return lane;
        }
        lanes.retain(|_, lane| lane.strong_count() > 0);
        let lane = Arc::new(Semaphore::new(1));
        lanes.insert(subnet, Arc::downgrade(&lane));
        lane
    }
}

/// What the gate knows.
#[derive(Debug)]
pub struct Gate {
    hosts: Hosts,
    tokens: Tokens,
    required: bool,
    /// Those that stop, and all others.
    stops: Queue,
    others: Queue,
}

/// Who waits for argon2, which is heavy on purpose: one at a time, so that wrong tokens cannot take the machine.
#[derive(Debug)]
struct Queue {
    work: Semaphore,
    lanes: Lanes,
}

impl Queue {
    fn new() -> Queue {
        Queue { work: Semaphore::new(1), lanes: Lanes::default() }
    }
}

impl Gate {
    /// A gate for an address.
    pub fn new(bind: SocketAddr, hosts: &[String], tokens: Tokens, required: bool) -> Gate {
        Gate { hosts: Hosts::new(bind, hosts), tokens, required, stops: Queue::new(), others: Queue::new() }
    }

    /// May anybody bring a thruster to zero, with whatever token or none?
    pub fn all_may_stop(&self) -> bool {
        !self.required
    }

    /// Is what somebody was let in by still in force?
    pub fn stands(&self, identity: &Identity) -> bool {
        self.tokens.stands(identity)
    }

    /// May whoever took a lease by the token of this name still command?
    pub fn commands(&self, token: &str) -> bool {
        !self.required && token == LOCAL || self.tokens.commands(token)
    }

    /// Who asks.
    async fn identify(
        &self,
        app: &Arc<App>,
        headers: &HeaderMap,
        peer: Option<IpAddr>,
        stops: bool,
    ) -> Result<Identity, Problem> {
        let Some(token) = shown(headers)? else {
            if self.required {
                return Err(Problem::new(Kind::TokenRequired, "no token is shown")
                    .hint("send Authorization: Bearer TOKEN; `kort token new NAME --role viewer|pilot|admin` makes one"));
            }
            return Ok(Identity::local());
        };
        if let Some(identity) = self.tokens.remembered(&token) {
            return Ok(identity);
        }
        let wrong = || {
            Problem::new(Kind::TokenRequired, "the token is not known, or was revoked")
                .hint("`kort token new NAME --role viewer|pilot|admin` makes another")
        };
        // Whoever floods with wrong ones, from however many addresses, takes nobody's turn at argon2.
        if !self.tokens.is_likely(&token) {
            return Err(wrong());
        }
        // However many wait with something else, from wherever: a stop does not stand behind them.
        let queue = if stops { &self.stops } else { &self.others };
        let lane = queue.lanes.of(peer);
        let _first_of_its_lane = lane.acquire().await;
        let _one_at_a_time = queue.work.acquire().await;
        // Accepted while this one waited, on another connection.
        if let Some(identity) = self.tokens.remembered(&token) {
            return Ok(identity);
        }
        let theirs = Arc::clone(app);
        let found =
            tokio::task::spawn_blocking(move || theirs.gate().tokens.verify(&token)).await.ok().flatten();
        found.ok_or_else(wrong)
    }
}

/// The token of a request, if one is shown.
fn shown(headers: &HeaderMap) -> Result<Option<String>, Problem> {
    let unreadable = || {
        Problem::new(Kind::MalformedHeader, "header Authorization is not readable")
            .hint("Authorization: Bearer TOKEN")
    };
    if let Some(value) = headers.get(header::AUTHORIZATION) {
        let text = value.to_str().map_err(|_| unreadable())?;
        let (scheme, token) = text.trim().split_once(' ').ok_or_else(unreadable)?;
        return if scheme.eq_ignore_ascii_case("bearer") {
            Ok(Some(token.trim().to_owned()))
        } else {
            Err(unreadable())
        };
    }
    let offered = headers.get(header::SEC_WEBSOCKET_PROTOCOL).and_then(|value| value.to_str().ok());
    Ok(offered.and_then(|list| {
        list.split(',').find_map(|p| p.trim().strip_prefix(TOKEN_PROTOCOL)).map(str::to_owned)
    }))
}

/// The console's page and the descriptions hold no data: anybody may read them.
pub fn is_open(path: &str) -> bool {
    matches!(path, "/" | "/healthz" | "/readyz" | "/openapi.json" | "/docs") || path.starts_with("/docs/")
}

/// Does this bring a thruster to zero?
pub fn stops(path: &str) -> bool {
    path == "/v1/stop" || of_thruster(path) == Some("disarm")
}

/// What of a thruster a path means; a recording may be called as it likes.
fn of_thruster(path: &str) -> Option<&str> {
    let (_, what) = path.strip_prefix("/v1/thrusters/")?.split_once('/')?;
    Some(what)
}

/// The least role that may do this; none where anybody may.
fn needed(method: &Method, path: &str) -> Option<Role> {
    match *method {
        _ if is_open(path) => None,
        Method::GET | Method::HEAD | Method::OPTIONS => Some(Role::Viewer),
        // A rig description is configuration.
        _ if matches!(of_thruster(path), Some("rig" | "rig/rollback")) => Some(Role::Admin),
        _ => Some(Role::Pilot),
    }
}

/// Lets a request through, with its [`Identity`], or says why not.
pub async fn check(
    State(app): State<Arc<App>>,
    mut request: Request,
    next: Next,
) -> Result<Response, Problem> {
    let gate = app.gate();
    gate.hosts.check(request.uri(), request.headers())?;
    let path = request.uri().path();
    if request.extensions().get::<Reserved>().is_some() && !stops(path) {
        return Err(Problem::new(
            Kind::Overloaded,
            "every connection is taken; this one is kept for stop and disarm",
        )
        .hint("close connections that are not used, and try again"));
    }
    if let Some(role) = needed(request.method(), path) {
        let peer = request.extensions().get::<Peer>().map(|Peer(address)| *address);
        let identified = gate.identify(&app, request.headers(), peer, stops(path)).await;
        let for_all = gate.all_may_stop() && stops(path);
        let identity = match identified {
            // Where anybody may stop, a header that is not understood, or a token that may not, stops nobody from it; who
            // it is, is told all the same.
            Err(_) if for_all => Identity::local(),
            Ok(known) if for_all && known.role < role => Identity { role, ..known },
            other => other?,
        };
        if identity.role < role {
            return Err(Problem::new(
                Kind::RoleTooLow,
                format!(
                    "token {:?} has the role {}; this needs {}",
                    identity.name,
                    identity.role.name(),
                    role.name()
                ),
            )
            .hint("`kort token new NAME --role …` makes a token of another role"));
        }
        request.extensions_mut().insert(identity);
    }
    Ok(next.run(request).await)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_changes_something_needs_a_pilot_and_the_page_nobody() {
        assert_eq!(needed(&Method::POST, "/v1/stop"), Some(Role::Pilot));
        assert_eq!(needed(&Method::DELETE, "/v1/recordings"), Some(Role::Pilot));
        assert_eq!(needed(&Method::POST, "/v1/thrusters/t1/rig"), Some(Role::Admin));
        assert_eq!(needed(&Method::POST, "/v1/thrusters/t1/rig/rollback"), Some(Role::Admin));
        assert_eq!(needed(&Method::GET, "/v1/thrusters/t1/rig"), Some(Role::Viewer));
        assert_eq!(needed(&Method::DELETE, "/v1/recordings/rig"), Some(Role::Pilot));
        assert!(stops("/v1/thrusters/t1/disarm") && !stops("/v1/recordings/disarm"));
        assert_eq!(needed(&Method::GET, "/metrics"), Some(Role::Viewer));
        assert_eq!(needed(&Method::GET, "/v1/events"), Some(Role::Viewer));
        assert_eq!(needed(&Method::GET, "/"), None);
        assert_eq!(needed(&Method::GET, "/docs/index.css"), None);
        assert_eq!(needed(&Method::GET, "/documents"), Some(Role::Viewer));
    }

    #[test]
    fn every_peer_waits_in_a_lane_of_its_own() {
        let lanes = Lanes::default();
        let peers: Vec<IpAddr> = (0..200).map(|host| IpAddr::from([10, 0, 0, host])).collect();
        let held: Vec<_> = peers.iter().map(|peer| lanes.of(Some(*peer))).collect();
        assert!(held.iter().all(|lane| lane.try_acquire().map(std::mem::forget).is_ok()));
        // The same peer, whichever way its address is written; hosts of one subnet of IPv6.
        assert!(lanes.of(Some("::ffff:10.0.0.7".parse().unwrap())).try_acquire().is_err());
        let (one, other) = ("2001:db8::1".parse().ok(), "2001:db8::2".parse().ok());
        let lane = lanes.of(one);
        assert!(Arc::ptr_eq(&lane, &lanes.of(other)));
        // Whoever is gone leaves nothing behind.
        drop((held, lane));
        lanes.of(one);
        assert_eq!(lock(&lanes.0).len(), 1);
    }

    #[test]
    fn a_token_is_read_from_header_or_subprotocol() {
        let with = |name: &'static str, value: &str| {
            let mut headers = HeaderMap::new();
            headers.insert(name, value.parse().unwrap());
            shown(&headers)
        };
        assert_eq!(with("authorization", "Bearer a.b").unwrap(), Some("a.b".into()));
        assert_eq!(with("sec-websocket-protocol", "kort, bearer.a.b").unwrap(), Some("a.b".into()));
        assert!(with("authorization", "Basic abc").is_err());
        assert_eq!(shown(&HeaderMap::new()).unwrap(), None);
    }
}
