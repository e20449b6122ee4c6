//! The controller's promises about setpoints, losses and switches of law, on virtual time.

use kort_control::{ControllerConfig, LawKind};
use kort_proto::faults::Fault;
use kort_proto::limits::Limit;
use kort_proto::messages::{
    Command, Header, Outcome, Parameter, Request, RequestKind, Setpoint, SetpointKind, Telemetry,
};
use kort_proto::signals::Signals;
use kort_proto::text::Text;
use kort_thruster::rig::Rig;
use proptest::prelude::*;

use crate::tick::Tick;

mod retaken;

const PERIOD: u64 = 4_000_000;
const START: u64 = 1_000_000_000;
const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");

/// A controller with a servo and a gateway that answer as told.
struct Bench {
    tick: Tick,
    now: u64,
    sequence: u64,
    armed: bool,
    armed_at: u64,
    servo_speaks: bool,
    servo_faults: u64,
    gateway_speaks: bool,
    gateway_session: u64,
    setpoint: Setpoint,
    thrust_n: f64,
}

impl Bench {
    fn new() -> Self {
        let rig = Rig::from_toml(RIG).unwrap();
        Self {
            tick: Tick::new(&rig, &ControllerConfig::default(), PERIOD, START).unwrap(),
            now: START,
            sequence: 0,
            armed: false,
            armed_at: 0,
            servo_speaks: true,
            servo_faults: 0,
            gateway_speaks: true,
            gateway_session: START - 5,
            setpoint: Setpoint { lease_until_ns: u64::MAX, ..Setpoint::default() },
            thrust_n: f64::NAN,
        }
    }

    fn step(&mut self) -> Command {
        self.now += PERIOD;
        self.sequence += 1;
        let header = |session| Header { sequence: self.sequence, stamp_ns: self.now, session };
        if self.servo_speaks {
            let signals = Signals {
                shaft_speed_rad_s: 20.0,
                current_a: 1.0,
                thrust_n: self.thrust_n,
                ..Signals::UNKNOWN
            };
            let telemetry = Telemetry {
                header: header(START - 9),
                signals,
                armed: u32::from(self.armed),
                armed_at_ns: self.armed_at,
                faults: self.servo_faults,
                drive_max: 9.0,
                ..Telemetry::default()
            };
            self.tick.take_telemetry(&telemetry, self.now);
        }
        if self.gateway_speaks {
            self.tick
                .take_setpoint(&Setpoint { header: header(self.gateway_session), ..self.setpoint }, self.now);
        }
        let command = self.tick.tick(self.now);
        if command.stop != 0 {
            self.armed = false;
        }
        command
    }

    fn arm(&mut self) {
        self.step();
        self.armed = true;
        self.armed_at = self.now;
        self.step();
    }

    fn give(&mut self, kind: u32, value: f64) {
        self.setpoint.generation += 1;
        self.setpoint.given_at_ns = self.now + 1;
        self.setpoint.kind = kind;
        self.setpoint.value = value;
    }

    fn thrusting() -> Self {
        let mut bench = Self::new();
        bench.arm();
        bench.give(SetpointKind::Thrust as u32, 50.0);
        for _ in 0..50 {
            bench.step();
        }
        assert!(bench.step().drive > 0.5);
        bench
    }

    fn ask(&mut self, request: Request) -> (Outcome, String) {
        let header = Header { sequence: 1, stamp_ns: self.now, session: START };
        let reply = self.tick.request(&Request { header, ..request }, self.now).unwrap();
        (Outcome::from_u32(reply.outcome).unwrap(), reply.message.as_str().to_owned())
    }
}

/// A slow sensor's reading is held between readings; one that has fallen silent is not measured.
#[test]
fn a_silent_force_sensor_is_not_taken_for_its_last_word() {
    let mut bench = Bench::new();
    bench.tick = Tick::new(
        &Rig::from_toml(RIG).unwrap(),
        &ControllerConfig::with_law(LawKind::ThrustPi),
        PERIOD,
        START,
    )
    .unwrap();
    bench.arm();
    bench.give(SetpointKind::Thrust as u32, 50.0);
    bench.thrust_n = 30.0;
    for _ in 0..25 {
        bench.step();
    }
    bench.thrust_n = f64::NAN;
    let mut drives = [0.0; 500];
    drives.fill_with(|| bench.step().drive);
    assert!(drives[40] > drives[0] + 1e-3, "held between readings: the integral still runs");
    let (held, silent) = (drives[40] - drives[0], drives[499] - drives[250]);
    assert!(-held < silent && silent < 0.02 * held, "silent: what it gave fades, {held} {silent}");
}

#[test]
fn a_setpoint_given_before_the_arming_never_counts() {
    let mut bench = Bench::new();
    bench.step();
    bench.give(SetpointKind::Thrust as u32, 50.0);
    bench.step();
    bench.arm();
    for _ in 0..100 {
        assert_eq!(bench.step().drive, 0.0);
    }
    bench.give(SetpointKind::Thrust as u32, 50.0);
    bench.step();
    assert!(bench.step().drive > 0.0);
    // Disarmed and armed again: the same setpoint, still repeated by the gateway, is spent.
    bench.armed = false;
    assert_eq!(bench.step().drive, 0.0);
    bench.arm();
    for _ in 0..100 {
        assert_eq!(bench.step().drive, 0.0);
    }
}

#[test]
fn a_silent_gateway_ramps_to_zero_within_half_a_second_and_is_latched() {
    let mut bench = Bench::thrusting();
    bench.gateway_speaks = false;
    let silent = bench.now;
    let mut asked = Vec::new();
    while bench.step().stop == 0 {
        asked.push(bench.tick.state().setpoint_value);
    }
    assert!(bench.now - silent <= 500_000_000 + 2 * PERIOD, "{} ms", (bench.now - silent) / 1_000_000);
    assert!(asked[..24].iter().all(|n| *n == 50.0), "a hiccup is none: {asked:?}");
    assert!(asked.windows(2).all(|w| w[1] <= w[0]) && asked[60] < 40.0, "a ramp: {asked:?}");
    assert_eq!(bench.tick.state().faults, Fault::GatewayLost.bit());
    bench.gateway_speaks = true;
    for _ in 0..20 {
        let command = bench.step();
        assert_eq!((command.drive, command.stop != 0), (0.0, true), "latched until cleared");
    }
    assert_eq!(
        bench.ask(Request { kind: RequestKind::ClearFaults as u32, ..Request::default() }).0,
        Outcome::Done
    );
    bench.arm();
    for _ in 0..20 {
        assert_eq!(bench.step().drive, 0.0, "the old setpoint is not resumed");
    }
}

#[test]
fn a_gateway_that_hiccups_stops_nothing() {
    let mut bench = Bench::thrusting();
    for silence in [5, 10, 20] {
        bench.gateway_speaks = false;
        for _ in 0..silence {
            assert_eq!(bench.step().stop, 0);
        }
        bench.gateway_speaks = true;
        for _ in 0..20 {
            assert_eq!(bench.step().stop, 0);
        }
    }
    assert_eq!((bench.tick.state().faults, bench.tick.state().setpoint_value), (0, 50.0));
}

#[test]
fn asked_to_rest_it_ramps_down_and_holds_zero_whoever_commands() {
    let mut bench = Bench::thrusting();
    assert_eq!(bench.ask(Request { kind: RequestKind::Rest as u32, ..Request::default() }).0, Outcome::Done);
    bench.give(SetpointKind::Thrust as u32, 80.0);
    for _ in 0..110 {
        assert_eq!(bench.step().stop, 0);
    }
    let command = bench.step();
    assert_eq!((command.stop, command.thrust_cmd_n), (0, 0.0), "held at zero, braking");
    bench.armed = false;
    bench.step();
    bench.arm();
    bench.give(SetpointKind::Thrust as u32, 20.0);
    bench.step();
    assert!(bench.step().drive > 0.0, "after a new arming setpoints count again");
}

#[test]
fn faults_of_a_predecessor_stop_until_they_are_cleared() {
    let mut bench = Bench::new();
    bench.tick = bench.tick.with_latched(Fault::GatewayLost.bit());
    bench.arm();
    assert_eq!(bench.step().stop, 1);
    assert_eq!(bench.tick.state().faults, Fault::GatewayLost.bit());
}

#[test]
fn a_servo_replaced_under_way_is_latched() {
    let mut bench = Bench::thrusting();
    let header = Header { sequence: 1, stamp_ns: bench.now + 1, session: bench.now };
    let fresh = Telemetry { header, drive_max: 9.0, ..Telemetry::default() };
    bench.tick.take_telemetry(&fresh, bench.now + 1);
    assert_eq!(bench.tick.state().faults, Fault::ServoLost.bit());
}

/// A client may arm so soon after the start that the servo's word overtakes the gateway's first setpoint.
#[test]
fn an_arming_faster_than_the_first_setpoint_is_no_replaced_gateway() {
    let mut bench = Bench::new();
    bench.gateway_speaks = false;
    bench.step();
    bench.arm();
    bench.gateway_speaks = true;
    bench.give(SetpointKind::Thrust as u32, 50.0);
    for _ in 0..50 {
        assert_eq!(bench.step().stop, 0);
    }
    assert_eq!(bench.tick.state().faults, 0);
    assert!(bench.step().drive > 0.0, "the setpoint is followed");
}

#[test]
fn a_replaced_gateway_and_a_silent_servo_stop() {
    let mut bench = Bench::thrusting();
    bench.gateway_session = bench.now;
    let periods = (1..).find(|_| bench.step().stop != 0).unwrap();
    assert!((70..=80).contains(&periods), "ramped down: {periods}");
    assert_eq!(bench.tick.state().faults, Fault::GatewayRestarted.bit());
    let mut bench = Bench::thrusting();
    bench.servo_speaks = false;
    let periods = (1..).find(|_| bench.step().stop != 0).unwrap();
    assert!(periods <= 12, "{periods}");
    assert_eq!(bench.tick.state().faults, Fault::ServoLost.bit());
}

#[test]
fn the_end_of_a_lease_ramps_down_within_half_a_second_then_stops() {
    let mut bench = Bench::thrusting();
    bench.setpoint.lease_until_ns = bench.now;
    let ended = bench.now;
    let mut asked = Vec::new();
    loop {
        let command = bench.step();
        if command.stop != 0 {
            assert_eq!(command.drive, 0.0);
            break;
        }
        assert!(bench.tick.state().limits & Limit::LeaseRamp.bit() != 0);
        asked.push(command.thrust_cmd_n);
    }
    assert!(bench.now - ended <= 500_000_000);
    assert!(asked.len() > 50 && asked.windows(2).all(|w| w[1] < w[0]), "{asked:?}");
    // A new lease and a new setpoint do not save the ramp: the thruster is disarmed now.
    bench.setpoint.lease_until_ns = u64::MAX;
    bench.give(SetpointKind::Thrust as u32, 50.0);
    assert_eq!(bench.step().drive, 0.0);
}

#[test]
fn a_refused_setpoint_counts_once_however_often_it_is_sent() {
    let mut bench = Bench::thrusting();
    for refused in 1..=3 {
        bench.give(SetpointKind::Thrust as u32, f64::NAN);
        for _ in 0..20 {
            bench.step();
        }
        assert_eq!(bench.tick.state().setpoints_invalid, refused);
    }
    assert!(bench.step().drive > 0.5, "the setpoint before stays in force");
}

#[test]
fn a_switch_of_law_is_bumpless_and_all_or_nothing() {
    let mut bench = Bench::thrusting();
    for law in LawKind::ALL {
        if law.needs_thrust() {
            continue; // this bench has no force sensor
        }
        let before = bench.step().drive;
        let request = Request {
            kind: RequestKind::SetController as u32,
            law: Text::new(law.name()),
            ..Request::default()
        };
        assert_eq!(bench.ask(request), (Outcome::Done, format!("{} runs", law.name())));
        let after = bench.step().drive;
        assert!((after - before).abs() < 0.5, "{}: {before} to {after} A", law.name());
        for _ in 0..100 {
            bench.step();
        }
    }
    let mut request = Request {
        kind: RequestKind::SetController as u32,
        law: Text::new("static_map"),
        parameter_count: 1,
        ..Request::default()
    };
    request.parameters[0] =
        Parameter { name: Text::new("phase_margin_deg"), value: f64::NAN, ..Parameter::default() };
    let law = bench.tick.state().law;
    let (outcome, words) = bench.ask(request);
    assert_eq!(outcome, Outcome::Invalid);
    assert!(words.contains("30 to 85"), "{words}");
    assert_eq!(bench.tick.state().law, law, "nothing was changed");
    let unknown = Request { law: Text::new("velocity"), parameter_count: 0, ..request };
    assert!(bench.ask(unknown).1.contains("known are static_map"));
}

/// Another servo, started by itself, knows nothing of what the one before it had latched, nor that it drove.
#[test]
fn what_a_servo_takes_along_is_left_behind_as_its_loss() {
    let mut bench = Bench::new();
    bench.step();
    assert_eq!(bench.tick.leaves_behind(), 0);
    bench.arm();
    assert_eq!(bench.tick.leaves_behind(), Fault::ServoLost.bit(), "it drove");
    bench.armed = false;
    bench.step();
    assert_eq!(bench.tick.leaves_behind(), 0);
    bench.servo_faults = Fault::OverCurrent.bit();
    bench.step();
    assert_eq!(bench.tick.leaves_behind(), Fault::ServoLost.bit());
    let command = bench.step();
    assert_eq!(bench.tick.last_command(command).stop, Command::ENDS);
}

proptest! {
    #[test]
    fn no_setpoint_makes_the_drive_unsound(
        given in prop::collection::vec((0u32..5, prop_oneof![
            Just(f64::NAN), Just(f64::INFINITY), Just(f64::NEG_INFINITY), -1e300..1e300f64, -200.0..200.0f64
        ], 0u64..3), 1..40)
    ) {
        let mut bench = Bench::new();
        bench.arm();
        for (kind, value, hold) in given {
            let before = bench.tick.state();
            bench.give(kind, value);
            for _ in 0..=hold {
                let command = bench.step();
                prop_assert!(command.drive.is_finite() && command.drive.abs() <= 9.0);
            }
            let after = bench.tick.state();
            let sound = match SetpointKind::from_u32(kind) {
                Some(SetpointKind::Zero) => true,
                Some(SetpointKind::Thrust) => value.abs() <= after.thrust_max_n,
                Some(SetpointKind::Speed) => value.abs() <= after.speed_max_rad_s,
                None => false,
            };
            prop_assert_eq!(after.setpoints_invalid > before.setpoints_invalid, !sound);
        }
    }
}
