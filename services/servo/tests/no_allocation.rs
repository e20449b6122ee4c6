//! After start the servo allocates nothing: a counting global allocator watches the tick, the
//! simulated drive, the answers to requests, and receiving and waking. Sending is iceoryx2's: its
//! loan takes one small box (`Rc` in `SampleMutUninit::new`), freed within the call and so always
//! served from the thread's own cache; the test holds it to just that.
#![cfg(feature = "process")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

use kort_emulators::vesc::Make;
use kort_emulators::{Bench as Emulator, Vesc};
use kort_proto::config::Config;
use kort_proto::messages::{Command, Request, RequestKind};
use kort_proto::transport::{ControllerPorts, Deployment, GatewayPorts, ServoPorts, monotonic_ns};
use kort_servo::devices::{At, Devices};
use kort_servo::drives;
use kort_servo::settings::Settings;
use kort_servo::tick::{Inputs, Servo};
use kort_thruster::rig::Rig;

struct Counting;

thread_local! {
    static COUNT: Cell<u64> = const { Cell::new(0) };
}

// SAFETY: hands everything to the system's allocator; the counter is a plain thread-local.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.with(|c| c.set(c.get() + 1));
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }
    unsafe fn dealloc(&self, at: *mut u8, layout: Layout) {
        COUNT.with(|c| c.set(c.get() + 1));
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(at, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn the_loop_allocates_nothing_after_start() {
    let config = Config::parse(include_str!("../../../config/kort.toml"), None).unwrap();
    let thruster = config.thruster("t1").unwrap();
    let rig = Rig::from_toml(&config.rig_text("t1", thruster).unwrap().1).unwrap();
    let settings = Settings::new(&config, "t1", thruster, &rig).unwrap();
    let drive = drives::choose(&config, "t1", thruster, &rig).unwrap().start("t1", 0).unwrap();
    let mut devices = Devices::new(drive, Vec::new(), monotonic_ns());
    let folder = tempfile::tempdir().unwrap();
    let deployment = Deployment::new(Some(&folder.path().join("shm")));
    let mut owner = deployment.own().unwrap();
    owner.create(&["t1"]).unwrap();
    let mut ports = ServoPorts::open(&deployment, "t1").unwrap();
    let mut controller = ControllerPorts::open(&deployment, "t1").unwrap();
    let mut gateway = GatewayPorts::open(&deployment, "t1").unwrap();
    let mut servo = Servo::new(settings, monotonic_ns());

    let mut armed_ticks = 0;
    for i in 0..3000u64 {
        // Peers allocate as they like; only the servo's part is counted.
        if i % 4 == 0 {
            let drive = if servo.armed() { 3.0 } else { 0.0 };
            controller.command.send(Command { drive, ..Command::default() }).unwrap();
        }
        if i % 100 == 50 {
            let kind = [RequestKind::Arm, RequestKind::Arm, RequestKind::Disarm, RequestKind::ClearFaults]
                [i as usize / 100 % 4];
            gateway.request.send(Request { id: i, kind: kind as u32, ..Request::default() }).unwrap();
        }
        let before = COUNT.with(Cell::get);
        let now_ns = monotonic_ns();
        let shown = devices.show(At { now_ns, ticks: 1 });
        let measured = shown.signals;
        let requests: [_; 4] = std::array::from_fn(|_| ports.request.next());
        if let Some(command) = ports.command.latest() {
            servo.take_command(&command, now_ns);
        }
        let mut reply = None;
        for request in requests.iter().flatten() {
            reply = servo.request(request, now_ns);
        }
        let inputs = Inputs { now_ns, ticks: 1, measured: &measured, devices: shown.faults };
        devices.drive(now_ns, servo.tick(&inputs));
        let telemetry = servo.telemetry(now_ns, &measured);
        let sending = COUNT.with(Cell::get);
        let _ = ports.telemetry.send(telemetry);
        let sent = COUNT.with(Cell::get);
        ports.waker.wake();
        let after = COUNT.with(Cell::get);
        armed_ticks += u64::from(servo.armed());
        // The first ticks connect the ports to their peers.
        if i > 200 {
            assert_eq!((after - sent, sending - before), (0, 0), "tick {i}");
            assert!(sent - sending <= 2, "one box, freed again, at most");
        }
        if let Some(reply) = reply {
            ports.reply.send(reply).unwrap();
        }
        while gateway.reply.next().is_some() {}
    }
    assert!(armed_ticks > 500, "armed for {armed_ticks} ticks only");
}

/// A drive on a wire: its thread allocates as it likes, the tick's end of it does not.
#[test]
fn the_tick_of_a_drive_on_a_wire_allocates_nothing() {
    let rig = Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap();
    let emulator = Emulator::start(Vesc::new(Make::default(), &rig)).unwrap();
    let wired = format!("\"vesc\"\ndrive = {{ port = {:?}, pole_pairs = 7 }}", emulator.port());
    let text = include_str!("../../../config/kort.toml")
        .replace("amplifier = \"simulated\"", &format!("amplifier = {wired}"));
    let config = Config::parse(&text, None).unwrap();
    let thruster = config.thruster("t1").unwrap();
    let drive = drives::choose(&config, "t1", thruster, &rig).unwrap().start("t1", 0).unwrap();
    let mut devices = Devices::new(drive, Vec::new(), monotonic_ns());
    let mut readings = 0;
    for _ in 0..500 {
        let before = COUNT.with(Cell::get);
        let now_ns = monotonic_ns();
        let shown = devices.show(At { now_ns, ticks: 1 });
        devices.drive(now_ns, Some(1.0));
        assert_eq!(COUNT.with(Cell::get) - before, 0);
        readings += u32::from(shown.signals.shaft_speed_rad_s.is_finite());
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
    assert!(readings > 10, "{readings} readings in half a second");
    assert!(emulator.driven().is_some(), "it was never driven: {:?}", emulator.truth());
}
