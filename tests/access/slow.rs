//! Peers that send half of what they should: sockets by the thousand, and bodies that never come.

use std::io::Write;
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use kort_proto::transport::monotonic_ns;
use serde_json::json;
use tokio_tungstenite::tungstenite;

use crate::common::{self, Stack, wait};
use crate::{T1, ask, take};

/// 2,000 sockets that send half a request head and go on holding: stop is answered all the same.
#[test]
fn slow_sockets_do_not_lock_out_the_stop() {
    common::in_real_time(|| {
        let _ = rustix::process::setrlimit(
            rustix::process::Resource::Nofile,
            rustix::process::Rlimit {
                current: Some(4096),
                maximum: rustix::process::getrlimit(rustix::process::Resource::Nofile).maximum,
            },
        );
        let mut stack = Stack::start();
        stack.thrust(40.0, 60_000);
        let port = stack.site.port;
        let asked = |name: &str| std::env::var(name).ok().and_then(|n| n.parse::<u64>().ok());
        let rounds = asked("KORT_SLOW_ROUNDS").unwrap_or(2).max(1);
        let window = Duration::from_millis(asked("KORT_SLOW_MS").unwrap_or(1000));
        let mut took = Vec::new();
        // Idle and beset in turn on one and the same process, in windows so short that what others do to the machine
        // falls on both alike.
        let mut watch = stack.watch();
        let (mut idle, mut beset) = (vec![late_us(&mut watch, window)], Vec::new());
        for round in 0..rounds {
            let slow: Vec<TcpStream> = (0..2000).filter_map(|_| half_a_head(port)).collect();
            assert!(slow.len() > 1500, "{} sockets", slow.len());
            let held = Held::begin(port, slow);
            beset.push(late_us(&mut watch, window));
            took.extend((0..10).map(|_| {
                let began = Instant::now();
                assert_eq!(ask(port, "POST", "/v1/stop", &[], "").0, 200, "round {round}");
                began.elapsed()
            }));
            drop(held.end());
            wait("those that wait to be ended", || {
                let metrics = stack.text("/metrics")?;
                let line = metrics.lines().find(|line| line.starts_with("kort_connections_open "))?;
                (line.rsplit(' ').next()?.parse::<f64>().ok()? < 20.0).then_some(())
            });
            idle.push(late_us(&mut watch, window));
        }
        println!(
            "servo's wake-ups, us late, {rounds} windows of {window:?} of each side in turn: p50, p90, p99"
        );
        for (name, windows) in [("idle", &idle), ("beset", &beset)] {
            let all = windows.concat();
            let [p50, p90, p99] = [0.5, 0.9, 0.99].map(|share| quantile(&all, share));
            println!("{name:6} {p50:8.1} {p90:8.1} {p99:8.1}   of {}", all.len());
        }
        // Each beset window beside the two idle ones around it, and each idle one beside those around it in their turn:
        // what comes of idle beside idle is what this machine lets nobody tell.
        let around = |at: usize, step: usize| [&idle[at][..], &idle[at + step]].concat();
        let besets: Vec<_> = (0..beset.len()).map(|at| (beset[at].clone(), around(at, 1))).collect();
        let idles: Vec<_> = (0..idle.len() - 2).map(|at| (idle[at + 1].clone(), around(at, 2))).collect();
        println!("p99 beset beside idle {}", ratio(&besets));
        if !idles.is_empty() {
            println!("p99 idle beside idle  {}", ratio(&idles));
        }
        took.sort();
        let (median, worst) = (took[took.len() / 2], took[took.len() - 1]);
        println!("stop among 2000 slow sockets, {} times: median {median:?}, worst {worst:?}", took.len());
        // It waits for no tick of the controller. The worst is printed: what the machine does to it is not asserted.
        assert!(median < Duration::from_nanos(common::PERIOD_NS), "{took:?}");
    });
}

/// A request whose body never comes holds its connection no longer than half a head does: it makes room for others.
#[test]
fn bodies_that_never_come_lock_nobody_out() {
    common::in_real_time(|| {
        let stack = Stack::start();
        let port = stack.site.port;
        let half = |request: &str| {
            let mut socket = TcpStream::connect(("127.0.0.1", port)).ok()?;
            let head = "Host: 127.0.0.1\r\nContent-Type: application/json\r\nContent-Length: 1000\r\n\r\n{";
            socket.write_all(format!("{request} HTTP/1.1\r\n{head}").as_bytes()).ok()?;
            Some(socket)
        };
        let requests = ["PUT /v1/thrusters/t1/setpoint", "POST /v1/thrusters/t1/lease"];
        let open: Vec<TcpStream> = requests.iter().cycle().take(200).filter_map(|r| half(r)).collect();
        assert!(open.len() > 150, "{} sockets", open.len());
        assert_eq!(ask(port, "GET", T1, &[], "").0, 200, "any request is answered, not stop alone");
        let lease = take(port, &json!({"holder": "bench"}));
        assert_eq!(lease.0, 201, "a whole body is read: {}", lease.1);
        let mut took: Vec<Duration> = (0..10)
            .map(|_| {
                let began = Instant::now();
                assert_eq!(ask(port, "POST", "/v1/stop", &[], "").0, 200);
                began.elapsed()
            })
            .collect();
        took.sort();
        assert!(took[took.len() / 2] < Duration::from_nanos(common::PERIOD_NS), "{took:?}");
    });
}

/// Connections that are kept back for stop are no way to more streams than one peer may have.
#[test]
fn idle_connections_among_them_do_not_raise_the_cap_on_streams() {
    let stack = Stack::start();
    let port = stack.site.port;
    let mut idle = Vec::new();
    let streams = (0..120).filter_map(|_| {
        idle.extend(TcpStream::connect(("127.0.0.1", port)));
        tungstenite::connect(format!("ws://127.0.0.1:{port}{T1}/stream?hz=1")).ok()
    });
    let streams: Vec<_> = streams.collect();
    // A quarter of its 64 is left to its requests.
    assert!((24..=48).contains(&streams.len()), "{} streams of one peer", streams.len());
    drop(idle);
    assert_eq!(ask(port, "GET", T1, &[], "").0, 200);
    assert_eq!(take(port, &json!({"holder": "bench"})).0, 201, "commands of the same address pass");
    assert_eq!(ask(port, "POST", "/v1/stop", &[], "").0, 200);
}

/// The value below which this share lies.
fn quantile(of: &[f64], share: f64) -> f64 {
    let mut all = of.to_vec();
    all.sort_by(f64::total_cmp);
    all[((all.len() - 1) as f64 * share).round() as usize]
}

/// Wake-ups of two windows, or of two groups of them, that stand beside each other.
type Pair = (Vec<f64>, Vec<f64>);

/// How much larger the p99 of all wake-ups is on the first side than on the second, with the doubt of 95 % that comes of
/// drawing these pairs of windows anew.
fn ratio(pairs: &[Pair]) -> String {
    let of = |pairs_drawn: &[usize]| {
        let p99 = |side: fn(&Pair) -> &Vec<f64>| {
            let all: Vec<f64> = pairs_drawn.iter().flat_map(|at| side(&pairs[*at]).iter().copied()).collect();
            quantile(&all, 0.99)
        };
        100.0 * (p99(|pair| &pair.0) / p99(|pair| &pair.1) - 1.0)
    };
    let mut seed = 1u64;
    let mut draw = || {
        seed = seed.wrapping_mul(0x5851_F42D_4C95_7F2D).wrapping_add(0x1405_7B7E_F767_814F);
        ((seed >> 33) % pairs.len() as u64) as usize
    };
    let drawn: Vec<f64> =
        (0..400).map(|_| of(&(0..pairs.len()).map(|_| draw()).collect::<Vec<_>>())).collect();
    let whole = of(&(0..pairs.len()).collect::<Vec<_>>());
    format!("{whole:+.1} % ({:+.1} % to {:+.1} %)", quantile(&drawn, 0.025), quantile(&drawn, 0.975))
}

/// A connection that sends half a request and goes on holding.
fn half_a_head(port: u16) -> Option<TcpStream> {
    let mut socket = TcpStream::connect(("127.0.0.1", port)).ok()?;
    let _ = socket.write_all(b"POST /v1/thrusters/t1/arm HTTP/1.1\r\nHost: 127.0.0.1\r\nX-Slow: ");
    Some(socket)
}

/// Slow sockets that send a byte now and then; those that the gateway ends are opened anew, as one who means harm does.
struct Held {
    on: Arc<AtomicBool>,
    thread: std::thread::JoinHandle<Vec<TcpStream>>,
}

impl Held {
    fn begin(port: u16, mut sockets: Vec<TcpStream>) -> Self {
        let on = Arc::new(AtomicBool::new(true));
        let goes_on = Arc::clone(&on);
        let thread = std::thread::spawn(move || {
            let wanted = sockets.len();
            while goes_on.load(Ordering::Relaxed) {
                sockets.retain_mut(|socket| socket.write_all(b"x").is_ok());
                // All of them anew within the gateway's 5 s.
                let ended = wanted - sockets.len();
                sockets.extend((0..ended.min(40)).filter_map(|_| half_a_head(port)));
                std::thread::sleep(Duration::from_millis(100));
            }
            sockets
        });
        Self { on, thread }
    }

    fn end(self) -> Vec<TcpStream> {
        self.on.store(false, Ordering::Relaxed);
        self.thread.join().unwrap()
    }
}

/// How late the servo wakes in a stretch of time, by its own clock: each wake-up, us.
fn late_us(watch: &mut common::Watch, window: Duration) -> Vec<f64> {
    // What was on its way before is not of this time.
    let from_ns = monotonic_ns() + 20_000_000;
    let until_ns = from_ns + window.as_nanos() as u64;
    let mut late_us = Vec::new();
    loop {
        let t = watch.next();
        if t.time_ns >= until_ns {
            return late_us;
        }
        if t.time_ns >= from_ns {
            late_us.push(t.timing.lateness_ns as f64 * 1e-3);
        }
    }
}
