//! What systemd hears of the service (`Type=notify`, `WatchdogSec`).

use std::os::unix::net::UnixDatagram;
use std::time::{Duration, Instant};

use crate::common::{Site, Stack, kill};

/// Longest silence that is waited for.
const PATIENCE: Duration = Duration::from_secs(30);

/// Waits until this is said; what else is said is passed over.
fn hear(socket: &UnixDatagram, words: &str) {
    let (end, mut bytes) = (Instant::now() + PATIENCE, [0; 512]);
    loop {
        assert!(Instant::now() < end, "{words} was not said");
        let Ok(n) = socket.recv(&mut bytes) else { continue };
        if String::from_utf8_lossy(&bytes[..n]).lines().any(|line| line == words) {
            return;
        }
    }
}

#[test]
fn it_says_when_it_is_up_that_it_lives_and_that_it_ends() {
    let site = Site::new();
    let path = site.folder.path().join("notify");
    let socket = UnixDatagram::bind(&path).unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(1))).unwrap();
    let address = format!("NOTIFY_SOCKET={}", path.display());
    let stack = Stack::start_in(&["env", &address, "WATCHDOG_USEC=2000000"], site);
    hear(&socket, "READY=1");
    for _ in 0..4 {
        let before = Instant::now();
        hear(&socket, "WATCHDOG=1");
        assert!(before.elapsed() < Duration::from_secs(2), "systemd would have ended it");
    }
    kill(stack.supervisor.id(), "TERM");
    hear(&socket, "STOPPING=1");
}
