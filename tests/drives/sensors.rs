//! Instruments beside the drive: a force cell that prints lines, a channel of Industrial I/O.

use std::path::Path;
use std::time::Instant;

use kort_emulators::{Bench as Emulator, Mischief, Printer};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, Outcome, RequestKind, Telemetry};

use crate::common::bench::Bench;
use crate::common::in_real_time;
use crate::common::{Site, wait};

const KGF_N: f64 = 9.806_65;

/// A servo with the simulated drive and one instrument.
fn servo(instrument: &str) -> Bench {
    let site = Site::new();
    site.add("[thrusters.t1]", &format!("sensors = {{ own = {{ {instrument} }} }}"));
    Bench::start_at(site)
}

/// With so little torque that no thrust contradicts it.
fn drive(bench: &mut Bench, ticks: usize) -> Vec<Telemetry> {
    bench.send(ticks, |ports, _| ports.command.send(Command { drive: 0.8, ..Command::default() }).unwrap())
}

/// Readings of the thrust in the rows.
fn thrusts(rows: &[Telemetry]) -> Vec<f64> {
    rows.iter().map(|row| row.signals.thrust_n).filter(|thrust| thrust.is_finite()).collect()
}

/// Time from the first row to the last.
fn seconds(rows: &[Telemetry]) -> f64 {
    let (first, last) = (rows.first().expect("rows"), rows.last().expect("rows"));
    (last.time_ns - first.time_ns) as f64 * 1e-9
}

fn trips(bench: &mut Bench) -> Telemetry {
    let last = wait("the servo to trip", || drive(bench, 10).into_iter().find(|row| row.armed == 0));
    assert_eq!(last.faults, Fault::SensorLost.bit(), "{last:?}");
    assert_eq!(last.signals.current_cmd_a, 0.0);
    last
}

fn arms_again(bench: &mut Bench) {
    wait("the fault to be cleared", || {
        (bench.ask(RequestKind::ClearFaults).0 == Outcome::Done).then_some(())
    });
    bench.arm();
}

#[test]
fn a_force_cell_that_prints_is_believed_over_the_drives_own_and_missed_when_it_is_silent() {
    in_real_time(|| {
        let cell = Emulator::start(Printer::new(2.5, 50.0)).unwrap();
        let keys = |required: bool| {
            format!(
                "kind = \"serial_line\", port = {:?}, reading_life_ms = 300, required = {required}, \
             signals = {{ thrust_n = {{ column = 2, unit = \"kgf\", scale = -1.0, offset = 1.0 }} }}",
                cell.port()
            )
        };
        let mut bench = servo(&keys(true));
        bench.arm();
        let rows = drive(&mut bench, 500);
        let read = thrusts(&rows);
        // 50 lines a second; the simulated drive would show its own on every one of 500 ticks.
        let rate_hz = read.len() as f64 / seconds(&rows);
        assert!((15.0..=60.0).contains(&rate_hz), "{rate_hz} readings a second");
        assert!(read.iter().all(|thrust| (thrust - (1.0 - 2.5 * KGF_N)).abs() < 1e-9), "{read:?}");
        for mischief in [Mischief::Silent, Mischief::Garbage, Mischief::Unplugged] {
            cell.spoil(mischief);
            trips(&mut bench);
            cell.spoil(Mischief::None);
            arms_again(&mut bench);
            assert!(drive(&mut bench, 50).iter().all(|row| row.armed != 0), "{mischief:?}");
        }
        drop(bench);
        // One that can be done without.
        let mut bench = servo(&keys(false));
        bench.arm();
        cell.spoil(Mischief::Silent);
        let rows = drive(&mut bench, 500);
        assert!(rows.last().unwrap().armed != 0, "{:?}", rows.last());
        assert!(thrusts(&rows[250..]).is_empty(), "what is not measured is shown");
    });
}

#[test]
fn a_channel_of_industrial_io_is_read_and_missed_when_it_is_gone() {
    in_real_time(|| {
        let device = tempfile::tempdir().unwrap();
        let put = |name: &str, text: &str| std::fs::write(device.path().join(name), text).unwrap();
        put("in_voltage0_raw", "1000\n");
        put("in_voltage0_scale", "0.5\n");
        let keys = |path: &Path| {
            format!(
                "kind = \"iio\", path = {path:?}, rate_hz = 100, reading_life_ms = 300, \
             signals = {{ thrust_n = {{ channel = \"in_voltage0\", scale = 0.02, offset = -3.0 }} }}"
            )
        };
        let mut bench = servo(&keys(device.path()));
        bench.arm();
        let rows = drive(&mut bench, 500);
        let read = thrusts(&rows);
        let rate_hz = read.len() as f64 / seconds(&rows);
        assert!((30.0..=115.0).contains(&rate_hz), "{rate_hz} readings a second");
        assert!(
            read.iter().all(|thrust| (thrust - 7.0).abs() < 1e-9),
            "500 mV at 0.02 N/mV less 3 N: {read:?}"
        );
        std::fs::remove_file(device.path().join("in_voltage0_raw")).unwrap();
        trips(&mut bench);
        let log = wait("the reason", || Some(bench.site.log()).filter(|log| log.contains("in_voltage0_raw")));
        assert!(log.contains("hint:"), "{log}");
        put("in_voltage0_raw", "1100\n");
        arms_again(&mut bench);
        let read = thrusts(&drive(&mut bench, 200));
        assert!(read.iter().all(|thrust| (thrust - 8.0).abs() < 1e-9) && !read.is_empty(), "{read:?}");
    });
}

/// A force cell that needs its line asked for would be silent without: it is asked, and at its rate.
#[test]
fn an_instrument_is_asked_at_its_rate() {
    in_real_time(|| {
        let cell = Emulator::start(Printer::new(1.0, 20.0)).unwrap();
        let keys = format!(
            "kind = \"serial_line\", port = {:?}, ask = \"R\\n\", rate_hz = 20, signals = {{ thrust_n = {{ column = 2, unit = \"kgf\" }} }}",
            cell.port()
        );
        let mut bench = servo(&keys);
        bench.arm();
        let (before, began) = (cell.heard(), Instant::now());
        drive(&mut bench, 1000);
        let asked_hz = (cell.heard() - before) as f64 / 2.0 / began.elapsed().as_secs_f64();
        assert!((5.0..=22.0).contains(&asked_hz), "asked {asked_hz} times a second");
    });
}
