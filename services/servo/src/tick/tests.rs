//! What commands, requests, silence and sick devices do to the pure step.

use super::*;
use crate::settings::Limits;
use kort_proto::messages::Header;
use proptest::prelude::*;

const MS: u64 = 1_000_000;

fn settings() -> Settings {
    Settings {
        period_ns: MS,
        command_timeout_ns: 14 * MS,
        limits: Limits {
            kind: DriveKind::Current,
            drive_max: 9.0,
            current_a: 9.0,
            trip_current_a: 11.0,
            continuous_current_a: 9.0,
            thermal_time_constant_s: 60.0,
            speed_rad_s: 80.0,
            trip_speed_rad_s: 95.0,
            full_drive_s: 0.001,
            supply_v: (f64::NEG_INFINITY, f64::INFINITY),
            temperature_c: f64::INFINITY,
            missing_ticks: 3,
            frozen_s: 10.0,
            spike_rad_s: 1e9,
            winding: (f64::NAN, 1.2),
            shaft: crate::guard::tests::limits().shaft,
            water: crate::water::Water::UNKNOWN,
        },
    }
}

/// A servo with a controller that repeats itself every tick.
struct Bench {
    servo: Servo,
    now_ns: u64,
    sequence: u64,
    session: u64,
}

impl Bench {
    fn new() -> Self {
        Self { servo: Servo::new(settings(), 1000 * MS), now_ns: 1000 * MS, sequence: 0, session: 900 * MS }
    }

    fn command(&mut self, drive: f64) -> Command {
        self.sequence += 1;
        Command {
            header: Header { sequence: self.sequence, stamp_ns: self.now_ns, session: self.session },
            drive,
            ..Command::default()
        }
    }

    fn tick(&mut self, command: Option<&Command>) -> Option<f64> {
        self.now_ns += MS;
        let measured = Signals { current_a: 0.0, shaft_speed_rad_s: 0.0, ..Signals::UNKNOWN };
        if let Some(command) = command {
            self.servo.take_command(command, self.now_ns);
        }
        self.servo.tick(&Inputs { now_ns: self.now_ns, ticks: 1, measured: &measured, devices: 0 })
    }

    fn drive(&mut self, drive: f64) -> Option<f64> {
        let command = self.command(drive);
        self.tick(Some(&command))
    }

    fn ask(&mut self, kind: RequestKind) -> Outcome {
        let header = Header { sequence: 1, stamp_ns: self.now_ns, session: 950 * MS };
        let request = Request { header, kind: kind as u32, ..Request::default() };
        Outcome::from_u32(self.servo.request(&request, self.now_ns).unwrap().outcome).unwrap()
    }

    fn armed() -> Self {
        let mut bench = Self::new();
        bench.drive(0.0);
        assert_eq!(bench.ask(RequestKind::Arm), Outcome::Done);
        bench
    }
}

#[test]
fn starts_disarmed_at_zero_and_needs_a_controller_at_zero_to_arm() {
    let mut bench = Bench::new();
    assert_eq!(bench.tick(None), None);
    assert_eq!(bench.ask(RequestKind::Arm), Outcome::Refused, "no controller");
    assert_eq!(bench.drive(3.0), None, "a command before arming");
    assert_eq!(bench.ask(RequestKind::Arm), Outcome::Refused, "controller not at zero");
    bench.drive(0.0);
    assert_eq!(bench.ask(RequestKind::Arm), Outcome::Done);
    assert_eq!(bench.drive(3.0), Some(3.0));
}

/// The controller answers a disarming after it has sent the command that follows from it: whoever then asks to arm is
/// heard behind that command, in the same tick too.
#[test]
fn an_arming_counts_behind_the_command_it_came_with() {
    let mut bench = Bench::armed();
    bench.drive(3.0);
    assert_eq!(bench.ask(RequestKind::Disarm), Outcome::Done);
    let (still, rest) = (bench.command(3.0), bench.command(0.0));
    bench.servo.take_command(&still, bench.now_ns);
    assert_eq!(bench.ask(RequestKind::Arm), Outcome::Refused, "it still asks for something");
    bench.servo.take_command(&rest, bench.now_ns);
    assert_eq!(bench.ask(RequestKind::Arm), Outcome::Done);
    assert_eq!(bench.tick(None), Some(0.0));
}

#[test]
fn silence_and_repeats_end_at_zero_and_are_latched() {
    for repeat in [false, true] {
        let mut bench = Bench::armed();
        let last = bench.command(3.0);
        assert_eq!(bench.tick(Some(&last)), Some(3.0));
        let mut ticks = 0;
        while bench.tick(repeat.then_some(&last)).is_some() {
            ticks += 1;
            assert!(ticks < 20, "never stopped");
        }
        assert!(ticks >= 10, "stopped after {ticks} ms already");
        assert_eq!(bench.servo.faults(), Fault::CommandTimeout.bit());
        assert_eq!(bench.drive(3.0), None, "a controller that comes back");
        assert_eq!(bench.ask(RequestKind::Arm), Outcome::Refused);
        assert_eq!(bench.ask(RequestKind::ClearFaults), Outcome::Done);
        assert_eq!(bench.drive(3.0), None, "cleared, but not armed");
    }
}

#[test]
fn another_controller_process_is_not_followed() {
    let mut bench = Bench::armed();
    bench.drive(3.0);
    bench.session = bench.now_ns;
    assert_eq!(bench.drive(3.0), None);
    assert_eq!(bench.servo.faults(), Fault::ControllerRestarted.bit());
}

#[test]
fn stop_disarms_without_a_fault() {
    let mut bench = Bench::armed();
    bench.drive(3.0);
    let stop = Command { stop: 1, ..bench.command(3.0) };
    assert_eq!(bench.tick(Some(&stop)), None);
    assert_eq!(bench.servo.faults(), 0);
    assert_eq!(bench.drive(3.0), None);
}

#[test]
fn a_stalled_loop_and_a_sick_drive_trip() {
    let mut bench = Bench::armed();
    let measured = Signals { current_a: 0.0, shaft_speed_rad_s: 0.0, ..Signals::UNKNOWN };
    bench.now_ns += 30 * MS;
    let command = bench.command(3.0);
    bench.servo.take_command(&command, bench.now_ns);
    let inputs = Inputs { now_ns: bench.now_ns, ticks: 30, measured: &measured, devices: 0 };
    assert_eq!(bench.servo.tick(&inputs), None);
    assert_eq!(bench.servo.faults(), Fault::LoopStalled.bit());
    let mut bench = Bench::armed();
    let inputs =
        Inputs { now_ns: bench.now_ns, ticks: 1, measured: &measured, devices: Fault::AmplifierFault.bit() };
    assert_eq!(bench.servo.tick(&inputs), None);
    assert_eq!(bench.servo.faults(), Fault::AmplifierFault.bit());
    assert_eq!(bench.ask(RequestKind::ClearFaults), Outcome::Refused, "the drive still says so");
    bench.drive(0.0);
    assert_eq!(bench.ask(RequestKind::ClearFaults), Outcome::Done);
}

#[test]
fn an_old_request_is_not_acted_upon() {
    let mut bench = Bench::new();
    bench.drive(0.0);
    for stamp_ns in [999 * MS, bench.now_ns - REQUEST_LIFE_NS - 1] {
        let header = Header { sequence: 1, stamp_ns, session: 1 };
        let request = Request { header, kind: RequestKind::Arm as u32, ..Request::default() };
        let reply = bench.servo.request(&request, bench.now_ns).expect("it is told so");
        assert_eq!(reply.outcome, Outcome::Refused as u32);
    }
    assert!(!bench.servo.armed());
}

#[test]
fn an_old_disarming_is_acted_upon() {
    let mut bench = Bench::armed();
    let header = Header { sequence: 9, stamp_ns: bench.now_ns - REQUEST_LIFE_NS - 1, session: 1 };
    let request = Request { header, kind: RequestKind::Disarm as u32, ..Request::default() };
    let reply = bench.servo.request(&request, bench.now_ns).expect("an answer");
    assert_eq!(reply.outcome, Outcome::Done as u32);
    assert!(!bench.servo.armed());
}

fn any_command() -> impl Strategy<Value = (f64, u32, u64, i64, u32)> {
    let drive = prop_oneof![
        Just(f64::NAN),
        Just(f64::INFINITY),
        Just(f64::NEG_INFINITY),
        Just(9.0),
        -20.0..20.0f64,
        -1e300..1e300
    ];
    (drive, 0u32..6, 0u64..50, -100i64..100, 0u32..2)
}

proptest! {
    #[test]
    fn no_stream_of_commands_drives_beyond_the_limits(
        stream in prop::collection::vec(any_command(), 1..100), arm_at in 0usize..50
    ) {
        let mut bench = Bench::new();
        for (i, (drive, kind, sequence, offset_ms, stop)) in stream.into_iter().enumerate() {
            if i == arm_at {
                bench.drive(0.0);
                bench.ask(RequestKind::Arm);
            }
            let stamp_ns = bench.now_ns.saturating_add_signed(offset_ms * MS as i64);
            let header = Header { sequence: bench.sequence + sequence, stamp_ns, session: bench.session };
            let command = Command { header, drive, kind, stop, ..Command::default() };
            if let Some(out) = bench.tick(Some(&command)) {
                prop_assert!(out.is_finite() && out.abs() <= 9.0);
                // What acts is a command that was sound and new when it came.
                prop_assert!(out == 0.0 || i > arm_at || i == arm_at);
            }
            bench.sequence += sequence;
        }
    }
}

#[test]
fn an_end_that_nobody_asked_for_is_latched_with_what_was_before() {
    // Its own.
    let mut bench = Bench::armed();
    bench.drive(3.0);
    bench.servo.end();
    assert_eq!(bench.drive(3.0), None);
    assert_eq!(bench.servo.faults(), Fault::ServoRestarted.bit());
    assert_eq!(bench.servo.telemetry(0, &Signals::UNKNOWN).tripped.drive, 3.0);
    // The controller's; where the lease has ended the same command without its end is a stop in good order.
    for (stop, faults) in [(Command::ENDS, Fault::ControllerRestarted.bit()), (Command::STOPS, 0)] {
        let mut bench = Bench::armed();
        bench.drive(3.0);
        let last = Command { stop, ..bench.command(0.0) };
        assert_eq!(bench.tick(Some(&last)), None);
        assert_eq!(bench.servo.faults(), faults);
    }
    // Of one that is disarmed nobody asked anything.
    let mut bench = Bench::new();
    bench.servo.end();
    let last = Command { stop: Command::ENDS, ..bench.command(0.0) };
    bench.tick(Some(&last));
    assert_eq!(bench.servo.faults(), 0);
}

#[test]
fn a_controller_that_had_faults_latched_takes_none_of_them_along() {
    for (first, second, faults) in [
        (Command::STOPS, 0, Fault::ControllerRestarted.bit()),
        (Command::STOPS, Command::STOPS, 0),
        (Command::ENDS, 0, 0),
        (0, 0, 0),
    ] {
        let mut bench = Bench::new();
        let stopped = Command { stop: first, ..bench.command(0.0) };
        bench.tick(Some(&stopped));
        bench.session += 50 * MS;
        let successor = Command { stop: second, ..bench.command(0.0) };
        bench.tick(Some(&successor));
        assert_eq!(bench.servo.faults(), faults, "{first}, {second}");
    }
}
