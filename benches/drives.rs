//! Every drive beside the simulated one, through its emulator: the loop's period, the age of the shaft speed at the tick, and how
//! long a command takes to the motor.
//!
//! `cargo bench --bench drives [-- SECONDS]`
//!
//! - period: from one tick's wake-up to the next's, by the servo's own clock;
//! - age: of the newest shaft speed when the guard looks at it;
//! - command: from the controller's send until the drive has it. A controller at 250 Hz changes the drive by a little with each
//!   command, and the emulator notes when each arrived; for the simulated drive the tick that took it counts.
//!
//! An emulator's wire takes no time: what is measured is kort and the system under it, not a UART.

#[path = "../tests/common/mod.rs"]
mod common;

use std::time::{Duration, Instant};

use common::Site;
use common::bench::Bench;
use kort_emulators::vesc::Make;
use kort_emulators::{
    Adapter, Amplifier, ArduSub, Bench as Emulator, Cia402, Moteus, ODrive, Vesc, ardusub, cia402, iio,
    moteus, odrive,
};
use kort_proto::messages::{Command, DriveKind, Outcome, RequestKind, Telemetry};
use kort_proto::transport::{Ticker, monotonic_ns};
use kort_thruster::rig::Rig;

const COMMAND_NS: u64 = 4_000_000;
/// Time from arming until the drive has what it is commanded, ns: an enable takes its time to come, and the command comes in over
/// `full_drive_s` then. A share of it is no step of the stairs, though it may look like an earlier one.
const COMING_IN_NS: u64 = 300_000_000;
/// Steps of the drive until it begins anew.
const STEPS: u64 = 100;

/// The drives that are commanded, one after the other.
#[derive(Clone, Copy)]
struct Stairs {
    kind: DriveKind,
    first: f64,
    /// Smallest step that the protocol carries.
    step: f64,
}

const AMPERES: Stairs = Stairs { kind: DriveKind::Current, first: 0.5, step: 0.01 };
/// A microsecond of pulse width on 16 V.
const VOLTS: Stairs = Stairs { kind: DriveKind::Voltage, first: 2.0, step: 0.04 };

fn main() {
    let seconds: u64 = std::env::args().find_map(|a| a.parse().ok()).unwrap_or(10);
    println!("{seconds} s each; microseconds p50 / p99 / p99.9 / max\n");
    let rig =
        Rig::from_toml(include_str!("../config/thrusters/whitcomb-yoerger-1999.toml")).expect("a sound rig");
    let wired = |kind: &str, keys: &str, emulator: Emulator| {
        let keys = format!("port = {:?}, rate_hz = 500, reading_life_ms = 200, {keys}", emulator.port());
        (Site::new().with_drive(kind, &keys), emulator)
    };
    measure("simulated", Site::new(), None, AMPERES, seconds);
    let vesc = Emulator::start(Vesc::new(Make::default(), &rig)).expect("a pseudo terminal");
    let (site, emulator) = wired("vesc", "pole_pairs = 7", vesc);
    measure("vesc", site, Some(emulator), AMPERES, seconds);
    let odrive = Emulator::start(ODrive::new(odrive::Make::default(), &rig)).expect("a pseudo terminal");
    let (site, emulator) = wired("odrive", "timeout_ms = 100", odrive);
    measure("odrive", site, Some(emulator), AMPERES, seconds);
    let moteus = Emulator::start(Moteus::new(moteus::Make::default(), &rig)).expect("a pseudo terminal");
    let (site, emulator) = wired("moteus", "timeout_ms = 100", moteus);
    measure("moteus", site, Some(emulator), AMPERES, seconds);
    let cia402 = Adapter::new(Cia402::new(cia402::Make::default(), &rig));
    let cia402 = Emulator::start(cia402).expect("a pseudo terminal");
    let (site, emulator) = wired("cia402", "timeout_ms = 100, units_per_turn = 4096", cia402);
    measure("cia402", site, Some(emulator), AMPERES, seconds);
    let vehicle = Rig::from_toml(include_str!("../config/thrusters/t200-vehicle.toml")).expect("a sound rig");
    let vehicle = ArduSub::new(ardusub::Make::default(), &vehicle);
    let (site, emulator) =
        wired("mavlink", "timeout_ms = 510, motor = 3", Emulator::start(vehicle).expect("a pseudo terminal"));
    let text = std::fs::read_to_string(site.config()).expect("a configuration");
    let text = text.replace("whitcomb-yoerger-1999", "t200-vehicle");
    std::fs::write(site.config(), text).expect("a configuration");
    measure("mavlink", site, Some(emulator), VOLTS, seconds);
    let emulator = Emulator::start_in_folder(Amplifier::new(iio::Make::default(), &rig)).expect("a folder");
    let at = |file: &str| emulator.port().join(file);
    let keys = format!(
        "dac = {:?}, gain_a_per_v = 2.0, limit_v = 10.0, watchdog = {:?}, enabled = {:?}, timeout_ms = 200, rate_hz = 500, reading_life_ms = 200, \
         current = {{ adc = {:?}, gain_a_per_v = 2.0 }}, counter = {{ count = {:?}, counts_per_turn = 4096 }}",
        at("iio:device0/out_voltage0"),
        at("leds/watchdog/brightness"),
        at("gpio/enabled/value"),
        at("iio:device1/in_voltage0"),
        at("counter0/count0")
    );
    measure("iio", Site::new().with_drive("iio", &keys), Some(emulator), AMPERES, seconds);
}

fn measure(name: &str, site: Site, emulator: Option<Emulator>, stairs: Stairs, seconds: u64) {
    // As it is run: at 1 kHz, with the real-time rights that there are.
    site.add("[thrusters.t1]", "servo = { rate_hz = 1000 }");
    let text = std::fs::read_to_string(site.config()).expect("a configuration");
    let text =
        text.replacen("servo = { rate_hz = 500 }\n", "", 1).replacen("rate_hz = 10,", "rate_hz = 250,", 1);
    std::fs::write(site.config(), text).expect("a configuration");
    let mut bench = Bench::start_at(site);
    let command = Command { kind: stairs.kind as u32, ..Command::default() };
    bench.zero = command;
    let mut ticker = Ticker::new(COMMAND_NS);
    let end = Instant::now() + Duration::from_secs(seconds);
    let (mut sent, mut rows): (Vec<(u64, f64)>, Vec<Telemetry>) = (Vec::new(), Vec::new());
    let (mut armed, mut armings): (bool, Vec<u64>) = (false, Vec::new());
    for n in 0u64.. {
        if Instant::now() > end {
            break;
        }
        if !armed {
            // Trips of a busy machine are part of it; then it is armed again.
            bench.ask(RequestKind::ClearFaults);
            let asked_ns = monotonic_ns();
            armed = bench.ask(RequestKind::Arm).0 == Outcome::Done;
            armings.extend(armed.then_some(asked_ns));
        }
        let drive = stairs.first + (n % STEPS) as f64 * stairs.step;
        let now_ns = monotonic_ns();
        bench.controller.command.send(Command { drive, ..command }).expect("sent");
        sent.push((now_ns, drive));
        while let Some(row) = bench.gateway.telemetry.next() {
            armed = row.armed != 0;
            rows.push(row);
        }
        ticker.wait();
    }
    let periods = rows.windows(2).filter(|w| w[1].header.sequence == w[0].header.sequence + 1);
    let woke_ns = |row: &Telemetry| row.time_ns + row.timing.lateness_ns;
    print_row(name, "period", periods.map(|w| woke_ns(&w[1]).saturating_sub(woke_ns(&w[0]))).collect());
    print_row(name, "age", rows.iter().filter(|row| row.armed != 0).map(|row| row.shaft_age_ns).collect());
    let arrived: Vec<(u64, f64)> = match &emulator {
        Some(emulator) => emulator.commands(),
        None => {
            rows.iter().map(|row| (row.time_ns + row.timing.lateness_ns, row.signals.current_cmd_a)).collect()
        }
    };
    let coming_in = |at_ns: u64| {
        let last = armings.iter().rev().find(|arming| **arming <= at_ns);
        last.is_none_or(|arming| at_ns - arming < COMING_IN_NS)
    };
    let arrived: Vec<_> = arrived.into_iter().filter(|(at_ns, _)| !coming_in(*at_ns)).collect();
    print_row(name, "command", latencies(&sent, &arrived, stairs.step));
    let overruns = rows.last().map_or(0, |row| row.timing.overruns);
    println!("{name:>10}  ticks left out: {overruns} of {}\n", rows.len());
    let _ = bench.servo.kill();
}

/// For every command that arrived, how long it took. A drive slower than the controller leaves some out.
fn latencies(sent: &[(u64, f64)], arrived: &[(u64, f64)], step: f64) -> Vec<u64> {
    let mut took = Vec::new();
    let (mut from, mut last) = (0, f64::NAN);
    for (at_ns, drive) in arrived {
        if *drive == last || !drive.is_finite() {
            continue;
        }
        last = *drive;
        let same = |(_, sent): &(u64, f64)| (sent - drive).abs() < 0.4 * step;
        // Half of the stairs before it a step looks like another one.
        let oldest_ns = at_ns.saturating_sub(STEPS / 2 * COMMAND_NS);
        from = from.max(sent.partition_point(|(sent_ns, _)| *sent_ns < oldest_ns));
        if let Some(place) = sent.iter().skip(from).take(STEPS as usize / 2).position(same) {
            from += place;
            took.extend(at_ns.checked_sub(sent[from].0));
        }
    }
    took
}

fn print_row(name: &str, what: &str, mut ns: Vec<u64>) {
    ns.sort_unstable();
    let at = |share: f64| {
        ns.get(((ns.len().saturating_sub(1)) as f64 * share).round() as usize)
            .map_or(f64::NAN, |n| *n as f64 * 1e-3)
    };
    println!(
        "{name:>10}  {what:<8} {:9.1} {:9.1} {:9.1} {:9.1}   ({} samples)",
        at(0.5),
        at(0.99),
        at(0.999),
        at(1.0),
        ns.len()
    );
}
