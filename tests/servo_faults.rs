//! The servo alone as a real process, with this test as its controller: nothing unsound ever
//! reaches the drive.

mod common;

use std::time::Duration;

use common::bench::Bench;
use common::{PERIOD_NS, Site, kill, wait};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, DriveKind, Outcome, RequestKind, Telemetry};
use kort_proto::transport::{ControllerPorts, GatewayPorts};

fn largest(rows: &[Telemetry]) -> f64 {
    rows.iter().map(|t| t.signals.current_cmd_a.abs()).fold(0.0, f64::max)
}

#[test]
fn a_sound_command_drives_and_the_log_says_what_is_not_permitted() {
    let mut bench = Bench::start();
    bench.arm();
    let rows = bench.send(100, |c, _| c.command.send(Command { drive: 2.0, ..Command::default() }).unwrap());
    assert_eq!(largest(&rows), 2.0);
    assert!(rows.last().unwrap().signals.shaft_speed_rad_s > 1.0, "the shaft turns");
    let log = bench.site.log();
    assert!(log.contains("servo runs, disarmed"), "{log}");
}

#[test]
fn unsound_commands_never_reach_the_drive_and_are_latched() {
    let mut bench = Bench::start();
    for (drive, kind) in [
        (f64::NAN, 0),
        (f64::INFINITY, 0),
        (f64::NEG_INFINITY, 0),
        (9.5, 0),
        (-1e300, 0),
        (1.0, 1),
        (1.0, 77),
    ] {
        bench.arm();
        let rows =
            bench.send(10, |c, _| c.command.send(Command { drive, kind, ..Command::default() }).unwrap());
        assert_eq!(largest(&rows), 0.0, "drive {drive} of kind {kind}");
        assert!(rows.iter().all(|t| t.signals.current_cmd_a.is_finite()));
        assert_eq!(rows.last().unwrap().faults, Fault::CommandInvalid.bit());
        let (outcome, words) = bench.ask(RequestKind::Arm);
        assert_eq!(outcome, Outcome::Refused);
        assert!(words.contains("command_invalid (code 5)"), "{words}");
        assert_eq!(bench.ask(RequestKind::ClearFaults).0, Outcome::Done);
    }
}

#[test]
fn silence_ends_at_zero_within_five_controller_periods() {
    let mut bench = Bench::start();
    bench.arm();
    bench.send(50, |c, _| c.command.send(Command { drive: 3.0, ..Command::default() }).unwrap());
    let rows = bench.send(300, |_, _| {});
    let zero = rows.iter().find(|t| t.armed == 0).expect("disarmed");
    assert!(zero.time_ns - zero.command_stamp_ns <= 5 * PERIOD_NS + 10_000_000);
    assert_eq!(zero.faults, Fault::CommandTimeout.bit());
    assert_eq!(zero.signals.current_cmd_a, 0.0);
    // A controller that comes back is not followed.
    let rows = bench.send(20, |c, _| c.command.send(Command { drive: 3.0, ..Command::default() }).unwrap());
    assert_eq!(largest(&rows), 0.0);
}

#[test]
fn another_controller_is_not_followed() {
    let mut bench = Bench::start();
    // Opened beforehand, so that it takes over faster than the command time-out notices.
    let second = ControllerPorts::open(&bench.site.deployment(), "t1").unwrap();
    bench.arm();
    bench.send(20, |c, _| c.command.send(Command { drive: 3.0, ..Command::default() }).unwrap());
    bench.controller = second;
    let rows = bench.send(20, |c, _| c.command.send(Command { drive: 3.0, ..Command::default() }).unwrap());
    assert_ne!(rows.last().unwrap().faults & Fault::ControllerRestarted.bit(), 0);
    assert_eq!(rows.last().unwrap().signals.current_cmd_a, 0.0);
}

#[test]
fn sigterm_sets_the_drive_to_zero_before_the_process_ends() {
    let mut bench = Bench::start();
    bench.arm();
    bench.send(20, |c, _| c.command.send(Command { drive: 3.0, ..Command::default() }).unwrap());
    kill(bench.servo.id(), "TERM");
    let status = wait("the end", || bench.servo.try_wait().unwrap());
    assert_eq!(status.code(), Some(0));
    let last = std::iter::from_fn(|| bench.gateway.telemetry.next()).last().unwrap();
    assert_eq!((last.armed, last.signals.current_cmd_a), (0, 0.0));
}

#[test]
fn forty_starts_under_the_axe_leave_nothing_behind() {
    // A servo that owns its shared memory is killed at every instant of its start; the next one
    // must come up without help.
    let site = Site::new();
    for i in 0u64..40 {
        let mut servo = site.spawn("servo");
        std::thread::sleep(Duration::from_micros(i * 1500));
        servo.kill().unwrap();
        servo.wait().unwrap();
    }
    let mut servo = site.spawn("servo");
    let deployment = site.deployment();
    wait("the last one to run", || {
        let ports = GatewayPorts::open(&deployment, "t1").ok()?;
        std::thread::sleep(Duration::from_millis(50));
        ports.telemetry.next().map(drop)
    });
    servo.kill().unwrap();
    servo.wait().unwrap();
}

/// A drive with a speed loop of its own tells no current: it arms, and is guarded by the speed it does tell.
#[test]
fn a_speed_drive_that_tells_no_current_arms_and_is_guarded_by_its_speed() {
    let site = Site::new();
    let config = std::fs::read_to_string(site.config()).unwrap();
    let config = config.replace("whitcomb-yoerger-1999.toml", "speed-drive.toml").replace(
        "{ full_drive_s = 0.005 }",
        "{ full_drive_s = 0.005, speed_rad_s = 60.0, trip_speed_rad_s = 61.0 }",
    );
    std::fs::write(site.config(), config).unwrap();
    let mut bench = Bench::start_at(site);
    let speed = |drive: f64| Command { drive, kind: DriveKind::Speed as u32, ..Command::default() };
    bench.zero = speed(0.0);
    bench.arm();
    let rows = bench.send(500, |ports, _| ports.command.send(speed(30.0)).unwrap());
    assert!(rows.iter().all(|t| t.signals.current_a.is_nan()), "the drive tells no current");
    let last = rows.last().unwrap();
    assert!(last.armed == 1 && last.faults == 0, "{last:?}");
    assert!((last.signals.shaft_speed_rad_s - 30.0).abs() < 3.0, "{last:?}");
}

/// The cores named in the configuration are those of the loop; one that is not there is said, and the loop runs on.
#[test]
fn the_loop_stays_on_its_cores() {
    let allowed = |process: &str| {
        let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap();
        let list = status.lines().find_map(|line| line.strip_prefix("Cpus_allowed_list:")).unwrap();
        list.trim().to_owned()
    };
    let own = allowed("self");
    let last = own.rsplit([',', '-']).next().unwrap();
    for cores in [last.to_owned(), format!("{last}, 1023")] {
        let site = Site::new();
        let config = std::fs::read_to_string(site.config()).unwrap();
        let config = config.replace("rate_hz = 500 }", &format!("rate_hz = 500, cores = [{cores}] }}"));
        std::fs::write(site.config(), config).unwrap();
        let bench = Bench::start_at(site);
        assert_eq!(allowed(&bench.servo.id().to_string()), last);
        assert_eq!(
            bench.site.log().contains("not all are there"),
            cores.contains("1023"),
            "{}",
            bench.site.log()
        );
    }
}
