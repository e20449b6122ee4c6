//! Latency of samples and jitter of the servo's loop, of the real processes, beside the bare
//! mechanisms they are built on, in one run and as ratios.
//!
//! `cargo bench --bench latency_and_jitter [-- SECONDS]`
//!
//! - one way: telemetry stamped by the servo until the controller's process holds it;
//! - answered: until the controller has sent the command that answers it, control law included. The
//!   way back is not in it: the servo takes a command at its next tick, a wait that is the period's.
//!   Beside it stands the bare round trip, which has the way back;
//! - bare: two processes that exchange 128 bytes at 1 kHz through iceoryx2 (sample and event) and
//!   through a Unix datagram socket, woken the same way, at the same priority;
//! - jitter: lateness of the wake-up of the servo against a bare loop on `clock_nanosleep`, idle
//!   and with a spinning process for every core but one. Both loops run turn about, second by second.

use std::os::unix::net::UnixDatagram;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use iceoryx2::prelude::*;
use kort_proto::transport::{Deployment, GatewayPorts, Ticker, monotonic_ns, realtime};
use rustix::process::Signal;

const PERIOD_NS: u64 = 1_000_000;
const PRIORITY: i32 = 80;
type Sample = [u64; 16];

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    match arguments.as_slice() {
        [_, role, folder] if role.starts_with("echo-") => return echo(role, Path::new(folder)),
        [_, role, _] if role == "spin" => loop {
            std::hint::spin_loop();
        },
        _ => {}
    }
    let seconds: u64 = arguments.iter().find_map(|a| a.parse().ok()).unwrap_or(10);
    let folder = std::env::temp_dir().join(format!("kort-bench-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a folder");
    println!("{seconds} s each; microseconds p50 / p99 / p99.9 / max\n");

    let service = service(&folder, seconds);
    let bare = ping_pong("echo-iceoryx2", &folder, seconds);
    let socket = ping_pong("echo-socket", &folder, seconds);
    println!("one way, iceoryx2 bare        {}", figures(&bare.0));
    println!("one way, Unix socket          {}", figures(&socket.0));
    println!("one way, servo to controller  {}", figures(&service.0));
    println!("round trip, iceoryx2 bare     {}", figures(&bare.1));
    println!("round trip, Unix socket       {}", figures(&socket.1));
    println!("answered, servo to command    {}", figures(&service.1));
    println!("  service / bare iceoryx2     {}", ratios(&service.0, &bare.0, "one way"));
    println!("                              {}", ratios(&service.1, &bare.1, "answered / round trip"));
    println!("  service / Unix socket       {}", ratios(&service.0, &socket.0, "one way"));
    println!("                              {}\n", ratios(&service.1, &socket.1, "answered / round trip"));

    for loaded in [false, true] {
        let spinners =
            if loaded { std::thread::available_parallelism().map_or(1, |n| n.get() - 1) } else { 0 };
        let _spinning: Vec<_> = (0..spinners).map(|_| copy("spin", &folder)).collect();
        let (bare, servo) = jitter(&folder, seconds);
        let words = if loaded { "loaded" } else { "idle" };
        println!("jitter {words}, bare loop   {}", figures(&bare));
        println!("jitter {words}, servo       {}", figures(&servo));
        println!("  servo / bare            {}", ratios(&servo, &bare, words));
    }
    drop(Deployment::new(Some(&folder.join("shm"))).own());
    let _ = std::fs::remove_dir_all(&folder);
    for left in std::fs::read_dir("/dev/shm").into_iter().flatten().flatten() {
        if left.file_name().as_encoded_bytes().starts_with(prefix(&folder).as_bytes()) {
            let _ = std::fs::remove_file(left.path());
        }
    }
}

/// Prefix of the bare connection's shared memory.
fn prefix(folder: &Path) -> String {
    format!("bench_{}_", folder.file_name().unwrap_or_default().to_string_lossy())
}

/// Sorted microseconds.
type Spread = Vec<f64>;

fn spread(mut ns: Vec<u64>) -> Spread {
    assert!(!ns.is_empty(), "nothing was measured");
    ns.sort_unstable();
    ns.into_iter().map(|n| n as f64 * 1e-3).collect()
}

fn at(spread: &Spread, share: f64) -> f64 {
    spread[((spread.len() - 1) as f64 * share).round() as usize]
}

fn figures(s: &Spread) -> String {
    format!(
        "{:8.1} {:8.1} {:8.1} {:8.1}   ({} samples)",
        at(s, 0.5),
        at(s, 0.99),
        at(s, 0.999),
        at(s, 1.0),
        s.len()
    )
}

fn ratios(a: &Spread, b: &Spread, words: &str) -> String {
    let ratio = |share| at(a, share) / at(b, share);
    format!("{words}: p50 {:.2}, p99 {:.2}, p99.9 {:.2}", ratio(0.5), ratio(0.99), ratio(0.999))
}

/// A process that ends with this one's handle.
struct Running(Child);

impl Running {
    fn signal(&self, signal: Signal) {
        let process = rustix::process::Pid::from_child(&self.0);
        rustix::process::kill_process(process, signal).expect("the process takes a signal");
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// A copy of this program in another role.
fn copy(role: &str, folder: &Path) -> Running {
    let program = std::env::current_exe().expect("this program");
    Running(Command::new(program).arg(role).arg(folder).spawn().expect("a copy starts"))
}

fn role(role: &str, folder: &Path) -> Running {
    if role == "servo" {
        // What the servo of the run before left, which was killed.
        drop(Deployment::new(Some(&folder.join("shm"))).own());
    }
    let mut command = Command::new(env!("CARGO_BIN_EXE_kort"));
    command.arg(role).arg("--root").arg(folder.join("shm")).env("RUST_LOG", "warn");
    command.arg("--config").arg(concat!(env!("CARGO_MANIFEST_DIR"), "/config/kort.toml"));
    Running(command.stdout(Stdio::null()).spawn().expect("kort starts"))
}

fn ports(folder: &Path) -> GatewayPorts {
    let deployment = Deployment::new(Some(&folder.join("shm")));
    deployment.wait_for_generation(Duration::from_secs(20)).expect("the servo creates its shared memory");
    let ports = GatewayPorts::open(&deployment, "t1").expect("ports");
    std::thread::sleep(Duration::from_secs(1));
    while ports.telemetry.next().is_some() || ports.state.next().is_some() {}
    ports
}

/// One way and round trip between the real servo and the real controller.
fn service(folder: &Path, seconds: u64) -> (Spread, Spread) {
    let _servo = role("servo", folder);
    let _controller = role("controller", folder);
    let ports = ports(folder);
    let (mut one_way, mut round_trip, mut last) = (Vec::new(), Vec::new(), 0);
    watch(Duration::from_secs(seconds), || {
        while let Some(state) = ports.state.next() {
            one_way.push(state.timing.lateness_ns);
        }
        while let Some(t) = ports.telemetry.next() {
            if t.command_sequence != last && t.command_telemetry_stamp_ns != 0 {
                last = t.command_sequence;
                round_trip.push(t.command_stamp_ns.saturating_sub(t.command_telemetry_stamp_ns));
            }
        }
    });
    (spread(one_way), spread(round_trip))
}

/// Lateness of every wake-up of the bare loop and of the real servo, turn about: what the machine
/// does meanwhile (a host's other guests above all) then falls on both alike.
fn jitter(folder: &Path, seconds: u64) -> (Spread, Spread) {
    let process = role("servo", folder);
    let ports = ports(folder);
    let (mut bare, mut servo) = (Vec::new(), Vec::new());
    for _ in 0..seconds {
        process.signal(Signal::STOP);
        bare.extend(bare_loop());
        while ports.telemetry.next().is_some() {}
        process.signal(Signal::CONT);
        let woken_ns = monotonic_ns();
        watch(Duration::from_secs(1), || {
            while let Some(t) = ports.telemetry.next() {
                // The tick that was slept through is not the servo's lateness.
                if t.header.stamp_ns > woken_ns + 10 * PERIOD_NS {
                    servo.push(t.timing.lateness_ns);
                }
            }
        });
    }
    (spread(bare), spread(servo))
}

/// Looks every 20 ms for as long.
fn watch(time: Duration, mut look: impl FnMut()) {
    let end = Instant::now() + time;
    while Instant::now() < end {
        std::thread::sleep(Duration::from_millis(20));
        look();
    }
}

/// A second of the servo's deadlines at its priority, with memory locked and a reader as it has,
/// and nothing to do.
fn bare_loop() -> Vec<u64> {
    let thread = std::thread::spawn(|| {
        realtime(PRIORITY, true);
        let mut ticker = Ticker::new(PERIOD_NS);
        let mut late = Vec::with_capacity(1000);
        while late.len() < late.capacity() {
            ticker.wait();
            late.push(ticker.timing.lateness_ns);
        }
        late
    });
    watch(Duration::from_secs(1), || {});
    thread.join().expect("the bare loop")
}

/// This process pings, a copy of it echoes with its time of receipt.
///
/// The pings have a thread of their own, and the copy starts before that thread is a real-time one:
/// whatever a real-time thread starts is one too, the load of the jitter included.
fn ping_pong(role: &str, folder: &Path, seconds: u64) -> (Spread, Spread) {
    let (role, folder) = (role.to_owned(), folder.to_path_buf());
    let thread = std::thread::spawn(move || {
        let (wire, _other) = open(&role, &folder, true);
        let _echo = copy(&role, &folder);
        std::thread::sleep(Duration::from_secs(1));
        realtime(PRIORITY, false);
        let (mut one_way, mut round_trip) = (Vec::new(), Vec::new());
        let mut ticker = Ticker::new(PERIOD_NS);
        for i in 0..seconds * 1000 {
            ticker.wait();
            let sent = monotonic_ns();
            wire.send([sent, 0, i, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]);
            if let Some(back) = wire.receive()
                && back[2] == i
            {
                round_trip.push(monotonic_ns() - sent);
                one_way.push(back[1] - back[0]);
            }
        }
        wire.send([0; 16]);
        (spread(one_way), spread(round_trip))
    });
    thread.join().expect("the pings")
}

fn echo(role: &str, folder: &Path) {
    realtime(PRIORITY - 10, false);
    let (wire, _other) = open(role, folder, false);
    loop {
        let Some(mut sample) = wire.receive() else { continue };
        if sample[0] == 0 {
            return;
        }
        sample[1] = monotonic_ns();
        wire.send(sample);
    }
}

/// One end of a bare connection.
#[expect(
    clippy::large_enum_variant,
    reason = "one of each in a run; a box would add an indirection to what is timed"
)]
enum Wire {
    Iceoryx {
        send: iceoryx2::port::publisher::Publisher<ipc::Service, Sample, ()>,
        receive: iceoryx2::port::subscriber::Subscriber<ipc::Service, Sample, ()>,
        wake: iceoryx2::port::notifier::Notifier<ipc::Service>,
        woken: iceoryx2::port::listener::Listener<ipc::Service>,
        _node: Node<ipc::Service>,
    },
    Socket(UnixDatagram),
}

impl Wire {
    fn send(&self, sample: Sample) {
        match self {
            Self::Iceoryx { send, wake, .. } => {
                let _ = send.send_copy(sample);
                let _ = wake.notify();
            }
            Self::Socket(socket) => {
                let bytes: Vec<u8> = sample.iter().flat_map(|n| n.to_ne_bytes()).collect();
                let _ = socket.send(&bytes);
            }
        }
    }

    fn receive(&self) -> Option<Sample> {
        match self {
            Self::Iceoryx { receive, woken, .. } => {
                let end = Instant::now() + Duration::from_millis(20);
                while Instant::now() < end {
                    let _ = woken.timed_wait(|_| {}, Duration::from_millis(20));
                    if let Some(sample) = receive.receive().ok().flatten() {
                        return Some(*sample.payload());
                    }
                }
                None
            }
            Self::Socket(socket) => {
                let mut bytes = [0u8; 128];
                socket.recv(&mut bytes).ok()?;
                let mut sample = [0u64; 16];
                for (n, chunk) in sample.iter_mut().zip(bytes.chunks_exact(8)) {
                    *n = u64::from_ne_bytes(chunk.try_into().ok()?);
                }
                Some(sample)
            }
        }
    }
}

/// Opens one end; the pinging end creates, and keeps alive what the second value holds.
fn open(role: &str, folder: &Path, ping: bool) -> (Wire, Vec<Box<dyn std::any::Any>>) {
    let (mine, theirs) = if ping { ("ping", "pong") } else { ("pong", "ping") };
    if role == "echo-socket" {
        let socket = UnixDatagram::bind(folder.join(mine)).expect("a socket");
        socket.set_read_timeout(Some(Duration::from_millis(20))).expect("a time-out");
        let end = Instant::now() + Duration::from_secs(5);
        if !ping {
            while socket.connect(folder.join(theirs)).is_err() && Instant::now() < end {}
            return (Wire::Socket(socket), Vec::new());
        }
        // The echo binds its name later: connect when it is there.
        let peer = folder.join(theirs);
        let connecting = socket.try_clone().expect("a copy of the socket");
        std::thread::spawn(move || {
            while connecting.connect(&peer).is_err() && Instant::now() < end {
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        return (Wire::Socket(socket), Vec::new());
    }
    let mut config = Config::default();
    let root = folder.join("bare");
    config
        .global
        .set_root_path(&iceoryx2::prelude::Path::new(root.as_os_str().as_encoded_bytes()).expect("a path"));
    config.global.prefix = FileName::new(prefix(folder).as_bytes()).expect("a prefix");
    set_log_level(LogLevel::Fatal);
    let node = NodeBuilder::new()
        .config(&config)
        .signal_handling_mode(SignalHandlingMode::Disabled)
        .create::<ipc::Service>()
        .expect("a node");
    let samples = |name: &str| {
        node.service_builder(&ServiceName::new(name).expect("a name"))
            .publish_subscribe::<Sample>()
            .subscriber_max_buffer_size(1)
            .enable_safe_overflow(true)
            .open_or_create()
            .expect("a service")
    };
    let event = |name: &str| {
        node.service_builder(&ServiceName::new(name).expect("a name"))
            .event()
            .open_or_create()
            .expect("an event")
    };
    let (out, back) = (samples(mine), samples(theirs));
    let (wake, woken) = (event(&format!("{mine}-event")), event(&format!("{theirs}-event")));
    let wire = Wire::Iceoryx {
        send: out.publisher_builder().create().expect("a publisher"),
        receive: back.subscriber_builder().create().expect("a subscriber"),
        wake: wake.notifier_builder().create().expect("a notifier"),
        woken: woken.listener_builder().create().expect("a listener"),
        _node: node,
    };
    (wire, vec![Box::new(out), Box::new(back), Box::new(wake), Box::new(woken)])
}
