//! Requests a second: `GET /v1/thrusters/t1` of the real gateway, telemetry flowing at 1 kHz through shared
//! memory, against a bare axum handler that answers as many bytes; in one run, as a ratio.
//!
//! `cargo bench -p kort-gateway`

use std::net::SocketAddr;
use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::time::{Duration, Instant};

use kort_proto::config::Config;
use kort_proto::messages::{ControllerState, Telemetry};
use kort_proto::text::Text;
use kort_proto::transport::{ControllerPorts, Deployment, ServoPorts, Ticker, monotonic_ns};
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::{TcpListener, TcpStream};

const CONNECTIONS: usize = 32;
const ROUNDS: usize = 3;
const SECONDS: u64 = 2;

fn main() {
    let folder = std::env::temp_dir().join(format!("kort-bench-{}", std::process::id()));
    let deployment = Deployment::new(Some(&folder.join("shm")));
    let stop = Arc::new(AtomicBool::new(false));
    let stand_in = stand_in_for_servo_and_controller(deployment.clone(), Arc::clone(&stop));

    let gateway: SocketAddr = free_address();
    let config = configuration(&folder, gateway);
    std::thread::spawn(move || kort_gateway::run(&config, &deployment).expect("the gateway runs"));

    let runtime = tokio::runtime::Builder::new_multi_thread()
        .worker_threads(2)
        .enable_all()
        .build()
        .expect("a runtime");
    let ratio = runtime.block_on(async {
        let path = "/v1/thrusters/t1";
        wait_until_answered(gateway, path).await;
        let body = body_of(gateway, path).await;
        let bytes = body.len();
        let bare = bare_axum(body).await;
        let mut best = [0.0f64; 2];
        for round in 1..=ROUNDS {
            for (slot, (name, address)) in best.iter_mut().zip([("bare axum", bare), ("gateway", gateway)]) {
                let rate = load(address, path).await;
                *slot = slot.max(rate);
                println!("round {round}: {name:<10} {rate:>8.0} requests/s ({bytes} bytes each)");
            }
        }
        best[1] / best[0]
    });
    println!("gateway / bare axum = {:.0} %", 100.0 * ratio);
    stop.store(true, Ordering::Relaxed);
    let _ = stand_in.join();
    let _ = std::fs::remove_dir_all(&folder);
}

/// Sends what servo and controller would send, at their rates.
fn stand_in_for_servo_and_controller(
    deployment: Deployment,
    stop: Arc<AtomicBool>,
) -> std::thread::JoinHandle<()> {
    let (ready, wait) = std::sync::mpsc::channel();
    let thread = std::thread::spawn(move || {
        let mut owner = deployment.own().expect("shared memory of our own");
        owner.create(&["t1"]).expect("services");
        let mut servo = ServoPorts::open(&deployment, "t1").expect("the servo's ports");
        let mut controller = ControllerPorts::open(&deployment, "t1").expect("the controller's ports");
        let _ = ready.send(());
        let mut ticker = Ticker::new(1_000_000);
        let mut angle = 0.0;
        while !stop.load(Ordering::Relaxed) {
            let mut telemetry =
                Telemetry { time_ns: monotonic_ns(), timing: ticker.timing, ..Telemetry::default() };
            angle += 0.05;
            telemetry.signals.shaft_angle_rad = angle;
            telemetry.signals.shaft_speed_rad_s = 50.0 + angle.sin();
            telemetry.signals.thrust_n = 80.0 + angle.cos();
            telemetry.signals.current_a = 5.0 + 0.1 * angle.sin();
            servo.telemetry.send(telemetry).expect("sent");
            if ticker.timing.ticks.is_multiple_of(4) {
                let mut state =
                    ControllerState { law: Text::new("velocity_servo"), ..ControllerState::default() };
                state.estimates.thrust_n = 80.0;
                controller.state.send(state).expect("sent");
            }
            ticker.wait();
        }
    });
    wait.recv().expect("the stand-in starts");
    thread
}

fn configuration(folder: &Path, bind: SocketAddr) -> Config {
    let rig = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../config/thrusters/whitcomb-yoerger-1999.toml");
    let text = format!(
        "[gateway]\nbind = \"{bind}\"\nrecordings = {:?}\n[thrusters.t1]\nrig = {rig:?}\namplifier = \"simulated\"\n",
        folder.join("recordings"),
    );
    Config::parse(&text, None).expect("a valid configuration")
}

fn free_address() -> SocketAddr {
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a free port");
    listener.local_addr().expect("its address")
}

async fn bare_axum(body: Vec<u8>) -> SocketAddr {
    let listener = TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = listener.local_addr().expect("its address");
    let body = axum::body::Bytes::from(body);
    let handler = move || async move { ([("content-type", "application/json")], body.clone()) };
    std::thread::spawn(move || {
        let listener = listener.into_std().expect("a listener");
        let runtime = tokio::runtime::Builder::new_multi_thread()
            .worker_threads(2)
            .enable_all()
            .build()
            .expect("a runtime");
        runtime.block_on(async move {
            let listener = TcpListener::from_std(listener).expect("a listener");
            let router = axum::Router::new().route("/v1/thrusters/{id}", axum::routing::get(handler));
            axum::serve(listener, router).await.expect("it serves");
        });
    });
    address
}

async fn wait_until_answered(address: SocketAddr, path: &str) {
    let end = Instant::now() + Duration::from_secs(10);
    while Instant::now() < end {
        if let Ok(mut stream) = TcpStream::connect(address).await
            && exchange(&mut stream, &request(path), &mut Vec::new()).await.is_some()
        {
            tokio::time::sleep(Duration::from_millis(300)).await; // telemetry has arrived by then
            return;
        }
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    panic!("{address} does not answer");
}

async fn body_of(address: SocketAddr, path: &str) -> Vec<u8> {
    let mut stream = TcpStream::connect(address).await.expect("a connection");
    let mut answer = Vec::new();
    let body_at = exchange(&mut stream, &request(path), &mut answer).await.expect("an answer");
    answer.split_off(body_at)
}

fn request(path: &str) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\nHost: bench\r\n\r\n").into_bytes()
}

/// Answered requests a second over all connections.
async fn load(address: SocketAddr, path: &str) -> f64 {
    let answered = Arc::new(AtomicU64::new(0));
    let (start, end) = (Instant::now(), Instant::now() + Duration::from_secs(SECONDS));
    let clients: Vec<_> = (0..CONNECTIONS)
        .map(|_| {
            let (request, answered) = (request(path), Arc::clone(&answered));
            tokio::spawn(async move {
                let mut stream = TcpStream::connect(address).await.expect("a connection");
                let mut answer = Vec::with_capacity(16 * 1024);
                while Instant::now() < end {
                    exchange(&mut stream, &request, &mut answer).await.expect("an answer");
                    answered.fetch_add(1, Ordering::Relaxed);
                }
            })
        })
        .collect();
    for client in clients {
        client.await.expect("a client that ends well");
    }
    answered.load(Ordering::Relaxed) as f64 / start.elapsed().as_secs_f64()
}

/// Sends a request and reads its whole answer; where the body starts. `None` unless it is a 200.
async fn exchange(stream: &mut TcpStream, request: &[u8], answer: &mut Vec<u8>) -> Option<usize> {
    answer.clear();
    stream.write_all(request).await.ok()?;
    loop {
        if stream.read_buf(answer).await.ok()? == 0 {
            return None;
        }
        let Some(head) = answer.windows(4).position(|four| four == b"\r\n\r\n") else { continue };
        let text = std::str::from_utf8(&answer[..head]).ok()?.to_ascii_lowercase();
        let length: usize = text.split("content-length: ").nth(1)?.lines().next()?.trim().parse().ok()?;
        if answer.len() >= head + 4 + length {
            return text.starts_with("http/1.1 200").then_some(head + 4);
        }
    }
}
