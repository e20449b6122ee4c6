//! What a drive on a wire says of itself, from its emulator through its protocol and its thread to the tick: a fault is
//! there while the drive has it, and ends with it, by itself or by a reset.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use kort_emulators::{
    Adapter, Amplifier, ArduSub, Bench, Cia402, Device, Mischief, Moteus, ODrive, Printer, Truth, Vesc,
    ardusub, cia402, iio, moteus, odrive, vesc,
};
use kort_proto::config::Config;
use kort_proto::faults::Fault;
use kort_proto::transport::monotonic_ns;
use kort_servo::devices::{At, Devices};
use kort_servo::{drives, sensors};
use kort_thruster::rig::Rig;

/// How long anything may take on a busy machine.
const PATIENCE: Duration = Duration::from_secs(30);

/// A drive on its emulator, as the servo's loop has it.
struct Loop {
    emulator: Bench,
    devices: Devices,
}

/// The configuration of a thruster on this emulator.
fn config(kind: &str, keys: &str, emulator: &Bench) -> Config {
    let drive = format!("\"{kind}\"\ndrive = {{ port = {:?}, {keys} }}", emulator.port());
    let text = include_str!("../../../config/kort.toml")
        .replace("amplifier = \"simulated\"", &format!("amplifier = {drive}"));
    Config::parse(&text, None).unwrap()
}

fn rig() -> Rig {
    Rig::from_toml(include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml")).unwrap()
}

impl Loop {
    fn new(kind: &str, keys: &str, emulator: Bench, rig: &Rig) -> Self {
        let config = config(kind, &format!("reading_life_ms = 300, timeout_ms = 510, {keys}"), &emulator);
        let thruster = config.thruster("t1").unwrap();
        let drive = drives::choose(&config, "t1", thruster, rig).unwrap().start("t1", 0).unwrap();
        Self { emulator, devices: Devices::new(drive, Vec::new(), monotonic_ns()) }
    }

    /// Ticks, with the output on at zero while nothing is wrong, until the faults shown now, and those shown on the
    /// way, are as wanted.
    fn until(&mut self, what: &str, wanted: impl Fn(u64, u64) -> bool) {
        let (end, mut seen) = (Instant::now() + PATIENCE, 0);
        loop {
            let now_ns = monotonic_ns();
            let faults = self.devices.show(At { now_ns, ticks: 1 }).faults;
            self.devices.drive(now_ns, (faults == 0).then_some(0.0));
            seen |= faults;
            if wanted(faults, seen) {
                return;
            }
            assert!(Instant::now() < end, "waited in vain for {what}: {faults:#x}");
            std::thread::sleep(Duration::from_millis(1));
        }
    }
}

#[test]
fn a_drives_own_fault_ends_with_it_and_with_a_reset() {
    let rig = rig();
    let vesc = Bench::start(Vesc::new(vesc::Make::default(), &rig)).unwrap();
    let odrive = Bench::start(ODrive::new(odrive::Make::default(), &rig)).unwrap();
    let moteus = Bench::start(Moteus::new(moteus::Make::default(), &rig)).unwrap();
    let cia402 = Bench::start(Adapter::new(Cia402::new(cia402::Make::default(), &rig))).unwrap();
    let vehicle = Rig::from_toml(include_str!("../../../config/thrusters/t200-vehicle.toml")).unwrap();
    let mavlink = Bench::start(ArduSub::new(ardusub::Make::default(), &vehicle)).unwrap();
    let own = |faults: u64| faults & Fault::AmplifierFault.bit() != 0;
    for (kind, keys, emulator, code) in [
        ("vesc", "pole_pairs = 7", vesc, 4),
        ("odrive", "baud = 115200", odrive, 0x40),
        ("moteus", "address = 1", moteus, 33),
        ("cia402", "units_per_turn = 4096", cia402, 0x4310),
        ("mavlink", "motor = 3", mavlink, 9),
    ] {
        let rig = if kind == "mavlink" { &vehicle } else { &rig };
        let mut servo = Loop::new(kind, keys, emulator, rig);
        servo.until(&format!("{kind} to be ready"), |now, _| now == 0);
        servo.emulator.report(code);
        servo.until(&format!("the fault of {kind}"), |_, seen| own(seen));
        servo.emulator.report(0);
        servo.until(&format!("the end of {kind}'s fault"), |now, _| now == 0);
        servo.emulator.report(code);
        servo.until(&format!("the fault of {kind} again"), |_, seen| own(seen));
        servo.emulator.restart();
        let reset = Fault::DriveRestarted.bit() | Fault::DriveLost.bit();
        servo.until(&format!("{kind} after its reset"), |now, seen| now == 0 && seen & reset != 0);
    }
}

/// A drive behind a slow line: its answers go out one after the other, and each takes its time.
struct Late<D> {
    device: D,
    takes_s: f64,
    waiting: VecDeque<(f64, Vec<u8>)>,
    /// Most answers that waited at once.
    most: Arc<AtomicUsize>,
}

impl<D: Device> Device for Late<D> {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        for answer in self.device.hear(now_s, bytes) {
            let before_s = self.waiting.back().map_or(now_s, |last| last.0.max(now_s));
            self.waiting.push_back((before_s + self.takes_s, answer));
        }
        self.most.fetch_max(self.waiting.len(), Ordering::Relaxed);
        Vec::new()
    }
    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        let mut said = self.device.live(now_s);
        let due = self.waiting.partition_point(|(at_s, _)| *at_s <= now_s);
        said.extend(self.waiting.drain(..due).map(|(_, answer)| answer));
        said
    }
    fn restart(&mut self, now_s: f64) {
        self.device.restart(now_s);
    }
    fn report(&mut self, code: u32) {
        self.device.report(code);
    }
    fn truth(&self) -> Truth {
        self.device.truth()
    }
}

/// A drive that is slower than the exchange is asked as often as it answers, and what it tells is as old as its question.
#[test]
fn late_answers_do_not_pile_up_and_are_told_by_their_age() {
    const TAKES: Duration = Duration::from_millis(10);
    let (rig, most) = (rig(), Arc::new(AtomicUsize::new(0)));
    fn bench<D: Device + 'static>(device: D, most: &Arc<AtomicUsize>) -> Bench {
        let (takes_s, most) = (TAKES.as_secs_f64(), Arc::clone(most));
        Bench::start(Late { device, takes_s, waiting: VecDeque::new(), most }).unwrap()
    }
    let vesc = bench(Vesc::new(vesc::Make::default(), &rig), &most);
    let odrive = bench(ODrive::new(odrive::Make::default(), &rig), &most);
    // An ODrive's answer is six lines.
    for (kind, keys, lines, emulator) in
        [("vesc", "pole_pairs = 7", 1, vesc), ("odrive", "baud = 115200", 6, odrive)]
    {
        let mut servo = Loop::new(kind, keys, emulator, &rig);
        servo.until(&format!("{kind} to be ready"), |now, _| now == 0);
        most.store(0, Ordering::Relaxed);
        let mut readings = 0;
        let end = Instant::now() + PATIENCE;
        while readings < 40 && Instant::now() < end {
            let now_ns = monotonic_ns();
            let shown = servo.devices.show(At { now_ns, ticks: 1 });
            servo.devices.drive(now_ns, Some(0.0));
            if shown.signals.shaft_speed_rad_s.is_finite() {
                readings += 1;
                let age = Duration::from_nanos(shown.shaft_age_ns);
                assert!(age >= TAKES, "{kind}: a reading of {age:?} took {TAKES:?} to come");
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        assert_eq!(readings, 40, "{kind}");
        let most = most.load(Ordering::Relaxed);
        assert!(most <= 2 * lines, "{kind}: {most} lines piled up");
    }
}

/// A wire that holds up all that a drive says, one thing behind the other; more and more, if it is too narrow.
struct Held<D> {
    device: D,
    /// Held up for so long, s, and so much more a second from when it says so.
    for_s: f64,
    grows: Arc<AtomicBool>,
    grew_s: f64,
    before_s: f64,
    waiting: VecDeque<(f64, Vec<u8>)>,
}

impl<D: Device> Held<D> {
    fn hold(&mut self, now_s: f64, said: Vec<Vec<u8>>) {
        let at_s = now_s + self.for_s + self.grew_s;
        self.waiting.extend(said.into_iter().map(|one| (at_s, one)));
    }
}

impl<D: Device> Device for Held<D> {
    fn hear(&mut self, now_s: f64, bytes: &[u8]) -> Vec<Vec<u8>> {
        let said = self.device.hear(now_s, bytes);
        self.hold(now_s, said);
        Vec::new()
    }
    fn live(&mut self, now_s: f64) -> Vec<Vec<u8>> {
        let passed_s = now_s - std::mem::replace(&mut self.before_s, now_s);
        self.grew_s += if self.grows.load(Ordering::Relaxed) { 0.5 * passed_s } else { 0.0 };
        let said = self.device.live(now_s);
        self.hold(now_s, said);
        let due = self.waiting.iter().take_while(|(at_s, _)| *at_s <= now_s).count();
        self.waiting.drain(..due).map(|(_, one)| one).collect()
    }
    fn restart(&mut self, now_s: f64) {
        self.device.restart(now_s);
    }
    fn report(&mut self, code: u32) {
        self.device.report(code);
    }
    fn truth(&self) -> Truth {
        self.device.truth()
    }
}

/// Drives that go on talking whether they are understood or not: what comes later than the next exchange is as old as it is,
/// and a wire that falls ever further behind ends in `drive_lost` once the readings' life is over.
#[test]
fn what_comes_late_from_a_drive_that_talks_on_is_told_by_its_age_too() {
    const FOR: Duration = Duration::from_millis(23);
    let life = Duration::from_millis(300);
    fn bench<D: Device + 'static>(device: D, grows: &Arc<AtomicBool>) -> Bench {
        let (for_s, grows) = (FOR.as_secs_f64(), Arc::clone(grows));
        Bench::start(Held { device, for_s, grows, grew_s: 0.0, before_s: 0.0, waiting: VecDeque::new() })
            .unwrap()
    }
    let vehicle = Rig::from_toml(include_str!("../../../config/thrusters/t200-vehicle.toml")).unwrap();
    let signed = ardusub::Make { telemetry: ardusub::Telemetry::Signed, ..Default::default() };
    for (kind, keys, rig) in [
        ("cia402", "units_per_turn = 4096", &rig()),
        ("mavlink", "motor = 3", &vehicle),
        ("mavlink signed", "motor = 3", &vehicle),
    ] {
        let grows = Arc::new(AtomicBool::new(false));
        let emulator = match kind {
            "cia402" => bench(Adapter::new(Cia402::new(cia402::Make::default(), rig)), &grows),
            "mavlink" => bench(ArduSub::new(ardusub::Make::default(), rig), &grows),
            _ => bench(ArduSub::new(signed.clone(), rig), &grows),
        };
        let mut servo = Loop::new(kind.split(' ').next().unwrap(), keys, emulator, rig);
        servo.until(&format!("{kind} to be ready"), |now, _| now == 0);
        let (mut readings, mut ages) = (0, Vec::new());
        let end = Instant::now() + PATIENCE;
        while ages.len() < 100 && Instant::now() < end {
            let now_ns = monotonic_ns();
            let shown = servo.devices.show(At { now_ns, ticks: 1 });
            servo.devices.drive(now_ns, None);
            if shown.signals.shaft_speed_rad_s.is_finite() {
                readings += 1;
                // The first come before any answer has told what the clocks are apart.
                ages.extend((readings > 50).then_some(Duration::from_nanos(shown.shaft_age_ns)));
            }
            std::thread::sleep(Duration::from_millis(1));
        }
        ages.sort();
        assert_eq!(ages.len(), 100, "{kind}");
        assert!(
            ages[0] >= FOR - Duration::from_millis(1),
            "{kind}: {FOR:?} on the way, told as {:?}",
            ages[0]
        );
        assert!(ages[50] < FOR * 3, "{kind}: {FOR:?} on the way, told as {:?}", ages[50]);
        // Half a second a second: the life is over after 0.6 s of that.
        grows.store(true, Ordering::Relaxed);
        let began = Instant::now();
        servo.until(&format!("{kind} to be lost"), |_, seen| seen & Fault::DriveLost.bit() != 0);
        let within = life * 2 + Duration::from_millis(500);
        assert!(began.elapsed() < within, "{kind}: {:?} until it was lost", began.elapsed());
    }
}

/// An instrument that keeps the start waiting does not make the servo silent to the drive, however short a reading's life.
#[test]
fn a_slow_instrument_does_not_cost_the_drive_its_first_ticks() {
    let instrument = Bench::start(Printer::new(1.0, 10.0)).unwrap();
    instrument.spoil(Mischief::Silent);
    let emulator = Bench::start(Vesc::new(vesc::Make::default(), &rig())).unwrap();
    let mut config = config("vesc", "pole_pairs = 7", &emulator);
    let cell = format!(
        "kind = \"serial_line\"\nport = {:?}\nsignals = {{ flow_m_s = {{ column = 1, unit = \"m/s\" }} }}",
        instrument.port()
    );
    let cell = cell.parse().unwrap();
    config.thrusters.get_mut("t1").unwrap().sensors.insert("meter".into(), cell);
    let thruster = config.thruster("t1").unwrap();
    let drive = drives::choose(&config, "t1", thruster, &rig()).unwrap();
    let sensors = sensors::choose(&config, "t1", thruster, &rig()).unwrap();
    // A drive that waited would have asked anew every 0.25 s, and be confirmed for the last fifth of that.
    let speaks = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(630));
        instrument.spoil(Mischief::None);
        instrument
    });
    let mut devices = Devices::start(drive, sensors, "t1", 0).unwrap();
    let _instrument = speaks.join();
    assert_eq!(devices.show(At { now_ns: monotonic_ns(), ticks: 1 }).faults, 0);
}

/// A loop that stands still while the thread behind the drive lives on gives no pulse: a DAC keeps its volts, and the watchdog
/// in the amplifier's enable takes the torque away. What comes back by itself then drives nothing.
#[test]
fn an_amplifier_whose_ticks_stop_loses_its_enable() {
    let emulator = Bench::start_in_folder(Amplifier::new(iio::Make::default(), &rig())).unwrap();
    let at = |file: &str| emulator.port().join(file);
    let drive = format!(
        "\"iio\"\ndrive = {{ dac = {:?}, gain_a_per_v = 2.0, limit_v = 10.0, watchdog = {:?}, enabled = {:?}, timeout_ms = 300, \
         current = {{ adc = {:?}, gain_a_per_v = 2.0 }}, counter = {{ count = {:?}, counts_per_turn = 4096 }} }}",
        at("iio:device0/out_voltage0"),
        at("leds/watchdog/brightness"),
        at("gpio/enabled/value"),
        at("iio:device1/in_voltage0"),
        at("counter0/count0")
    );
    let text = include_str!("../../../config/kort.toml")
        .replace("amplifier = \"simulated\"", &format!("amplifier = {drive}"));
    let config = Config::parse(&text, None).unwrap();
    let drive = drives::choose(&config, "t1", config.thruster("t1").unwrap(), &rig()).unwrap();
    let mut devices = Devices::new(drive.start("t1", 0).unwrap(), Vec::new(), monotonic_ns());
    let mut tick = |drive: Option<f64>| {
        let faults = devices.show(At { now_ns: monotonic_ns(), ticks: 1 }).faults;
        devices.drive(monotonic_ns(), drive.filter(|_| faults == 0));
        std::thread::sleep(Duration::from_millis(1));
        faults
    };
    let end = Instant::now() + PATIENCE;
    // A tick that a busy machine held up switches off in good order: then it is driven once more.
    while tick(Some(1.0)) != 0 || emulator.truth().command < 0.9 {
        assert!(Instant::now() < end, "it is never driven: {:?}", emulator.truth());
    }
    let stopped = Instant::now();
    while emulator.truth().command != 0.0 {
        assert!(Instant::now() < end, "it drives on: {:?}", emulator.truth());
        std::thread::sleep(Duration::from_millis(1));
    }
    let took = emulator.driven().unwrap().saturating_duration_since(stopped);
    assert!(took < Duration::from_millis(300), "{took:?}");
    // The first ticks after it find the enable fallen.
    let driven = emulator.driven();
    let mut seen = 0;
    for _ in 0..100 {
        seen |= tick(Some(1.0));
    }
    assert!(seen & Fault::AmplifierFault.bit() != 0, "{seen:#x}");
    assert_eq!(emulator.driven(), driven, "it drove again by itself");
}
