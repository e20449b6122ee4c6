//! What is asked of every real drive, whatever it speaks.

use std::time::{Duration, Instant};

use kort_emulators::{Bench as Emulator, Mischief};
use kort_proto::faults::Fault;
use kort_proto::messages::{Command, Outcome, RequestKind, Telemetry};
use kort_thruster::rig::Rig;
use serde_json::json;

use crate::common::bench::Bench;
use crate::common::{PERIOD_NS, Site, Stack, kill, wait};

/// Added to every bound: what a machine shared with others may hold a process up.
const SLACK: Duration = Duration::from_nanos(2 * PERIOD_NS);

/// How long a reading stands in these tests, longer than by default: what a pseudo terminal carries waits for a
/// kernel's worker without priority, which a busy machine holds up.
const LIFE_MS: u64 = 300;
/// Time-out of the drive in these tests, as long for the same reason.
const TIMEOUT_MS: u64 = 300;
/// The rig of most of them, which is driven by current.
const RIG: &str = "whitcomb-yoerger-1999";
/// A reading's life, and some exchanges: silence is noticed.
pub const SILENCE: Duration = Duration::from_millis(LIFE_MS + 30);
/// `checks.frozen_s`, and an exchange: readings that repeat themselves are noticed.
pub const FROZEN: Duration = Duration::from_millis(500 + 20);
/// Faults that a machine makes which stands still.
const HELD_UP: u64 = Fault::DriveLost.bit()
    | Fault::SensorNotFinite.bit()
    | Fault::AmplifierFault.bit()
    // A watchdog outside the drive that took the enable away guards nothing until it is seen to act again.
    | Fault::DriveUnguarded.bit()
    | Fault::CommandTimeout.bit()
    | Fault::LoopStalled.bit();
/// A rig that the repository describes.
pub fn rig(name: &str) -> Rig {
    let file = format!("{}/config/thrusters/{name}.toml", env!("CARGO_MANIFEST_DIR"));
    Rig::from_toml(&std::fs::read_to_string(file).unwrap()).unwrap()
}

/// One kind of drive under test.
pub struct Case {
    /// Name in `amplifier`.
    pub kind: &'static str,
    /// Keys of `drive` beside where it is.
    pub keys: &'static str,
    /// Those that say where it is.
    pub place: fn(&Emulator) -> String,
    /// Drive that makes the shaft turn, in the unit of the drive.
    pub drive: f64,
    /// The command that carries it.
    pub command: Command,
    /// The rig it drives.
    pub rig: &'static str,
    /// A thrust that the rig reaches well.
    pub thrust_n: f64,
    /// Its own time-out.
    pub timeout_ms: u64,
    /// What makes it ready anew after a stop, where that takes its time.
    pub revive: fn(&Emulator),
}

impl Case {
    /// A drive that takes current.
    pub fn new(kind: &'static str, keys: &'static str) -> Self {
        let command = Command::default();
        Self {
            kind,
            keys,
            place: |emulator| format!("port = {:?}", emulator.port()),
            drive: 4.0,
            command,
            rig: RIG,
            thrust_n: 60.0,
            timeout_ms: TIMEOUT_MS,
            revive: |_| (),
        }
    }

    /// After this the drive itself has taken the torque away; it may look at it every 10 ms only.
    pub fn timeout(&self) -> Duration {
        Duration::from_millis(self.timeout_ms + 10)
    }

    /// A servo on this drive.
    pub fn servo(&self, emulator: &Emulator) -> Bench {
        let mut bench = Bench::start_at(self.site(emulator));
        bench.zero = self.command;
        bench
    }

    pub fn site(&self, emulator: &Emulator) -> Site {
        let keys = format!(
            "{}, reading_life_ms = {LIFE_MS}, timeout_ms = {}, {}",
            (self.place)(emulator),
            self.timeout_ms,
            self.keys
        );
        let site = Site::new().with_drive(self.kind, &keys);
        if self.rig != RIG {
            // A speed told in whole turns a minute may well repeat itself.
            let limits = "limits = { full_drive_s = 0.5, speed_rad_s = 500.0 }\nchecks = { frozen_s = 10.0 }";
            let config = std::fs::read_to_string(site.config()).unwrap();
            let config = config.replace(RIG, self.rig).replace("limits = { full_drive_s = 0.005 }", limits);
            std::fs::write(site.config(), config).unwrap();
        }
        site
    }

    fn driving(&self) -> Command {
        Command { drive: self.drive, ..self.command }
    }

    /// The whole service: lease, arm, a thrust, a recording whose columns tell what is true.
    pub fn serves(&self, emulator: &Emulator) {
        let thrust_n = self.thrust_n;
        let mut stack = Stack::start_at(self.site(emulator));
        let recordings = "/v1/recordings";
        let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
        let url = format!("http://127.0.0.1:{}{recordings}", stack.site.port);
        let started = agent.post(&url).send_json(json!({"name": self.kind, "rate_hz": 500})).unwrap();
        assert_eq!(started.status(), 201);
        stack.command(thrust_n, 60_000);
        wait("the thrust", || {
            let truth = emulator.truth();
            ((truth.thrust_n - thrust_n).abs() < 0.2 * thrust_n).then_some(())
        });
        std::thread::sleep(Duration::from_secs(2));
        // A single reading may lie off by what a busy machine holds an emulator up; a wrong unit or sign stays.
        wait("what is told to be true", || {
            let (truth, state) = (emulator.truth(), stack.state().expect("a state"));
            let told = |name: &str| state["measured"][name].as_f64().unwrap_or(f64::NAN);
            let near = |name: &str, truth: f64| (told(name) - truth).abs() < 0.1 * truth.abs() + 0.1;
            let true_of_both =
                near("shaft_speed_rad_s", truth.shaft_speed_rad_s) && near("current_a", truth.current_a);
            true_of_both.then_some(())
        });
        let truth = emulator.truth();
        agent.delete(&url).call().unwrap();
        let csv = stack.text(&format!("{recordings}/{}?format=csv", self.kind)).expect("the recording");
        let mut lines = csv.lines().map(|line| line.split(',').collect::<Vec<_>>());
        let head = lines.next().expect("a head");
        let at = |name: &str| head.iter().position(|column| *column == name).expect("a column");
        let (time, speed) = (at("time_s"), at("shaft_speed_rad_s"));
        let rows: Vec<(f64, Option<f64>)> =
            lines.map(|cells| (cells[time].parse().expect("a time"), cells[speed].parse().ok())).collect();
        // Between two answers of the drive nothing was sampled, and the cell says so.
        let sampled: Vec<f64> = rows.iter().filter_map(|row| row.1).collect();
        let seconds = rows.last().expect("rows").0 - rows[0].0;
        let rate_hz = sampled.len() as f64 / seconds;
        assert!((50.0..=205.0).contains(&rate_hz), "{rate_hz} readings a second, asked for 200");
        let mut last: Vec<f64> = sampled.iter().rev().take(50).copied().collect();
        last.sort_by(f64::total_cmp);
        let median = last[last.len() / 2];
        assert!(
            (median - truth.shaft_speed_rad_s).abs() < 0.1 * truth.shaft_speed_rad_s,
            "{median} for {truth:?}"
        );
    }

    /// Arms, and drives until the shaft turns; a machine that held somebody up trips it, and it is armed again.
    pub fn turn(&self, bench: &mut Bench, emulator: &Emulator) {
        let end = Instant::now() + Duration::from_secs(20);
        loop {
            let armed = self.drive_for(bench, 10).last().is_some_and(|row| row.armed != 0);
            if armed && emulator.truth().command != 0.0 && emulator.truth().shaft_speed_rad_s > 2.0 {
                return;
            }
            assert!(Instant::now() < end, "the shaft does not turn: {:?}", emulator.truth());
            if !armed && bench.ask(RequestKind::ClearFaults).0 == Outcome::Done {
                bench.arm();
            }
        }
    }

    /// Sends the driving command for some servo ticks.
    pub fn drive_for(&self, bench: &mut Bench, ticks: usize) -> Vec<Telemetry> {
        bench.send(ticks, |ports, _| ports.command.send(self.driving()).unwrap())
    }

    /// The motor is at zero within the bound and stays there, the fault is latched, nothing resumes; mended, it
    /// takes a clear and an arm to drive again.
    pub fn ends_at_zero(
        &self,
        bench: &mut Bench,
        emulator: &Emulator,
        faults: &[Fault],
        bound: Duration,
        cause: impl Fn(),
        mend: impl Fn(),
    ) {
        let any: u64 = faults.iter().map(|fault| fault.bit()).sum();
        // A machine that holds the emulator, or this test, up for longer than it may trips the servo: once more.
        let took = (0..6).find_map(|_| {
            self.turn(bench, emulator);
            self.drive_for(bench, 100);
            let began = Instant::now();
            cause();
            let trip = |row: &Telemetry| row.armed == 0;
            let last = wait("the servo to trip", || self.drive_for(bench, 10).into_iter().find(trip));
            if last.faults & any == 0 {
                assert_eq!(last.faults & !HELD_UP, 0, "{:#x} is not one of {faults:?}", last.faults);
                mend();
                return None;
            }
            // Of a drive that is away no sensor is said to be broken.
            assert_eq!(last.faults & Fault::SensorNotFinite.bit(), 0, "{:#x}", last.faults);
            wait("zero at the motor", || {
                self.drive_for(bench, 5);
                (emulator.truth().command == 0.0).then_some(())
            });
            Some(emulator.driven().expect("it drove").saturating_duration_since(began))
        });
        let took = took.unwrap_or_else(|| panic!("never one of {faults:?}"));
        println!("{} {faults:?}: zero at the motor after {} ms", self.kind, took.as_millis());
        assert!(took <= bound + SLACK, "{took:?} beyond {bound:?}");
        mend();
        // A controller that goes on commanding is not followed, mended or not.
        let driven = emulator.driven();
        self.drive_for(bench, 200);
        assert_eq!(emulator.driven(), driven, "it drove again by itself");
        wait("the fault to be cleared", || {
            (bench.ask(RequestKind::ClearFaults).0 == Outcome::Done).then_some(())
        });
        self.drive_for(bench, 20);
        assert_eq!(emulator.driven(), driven, "it drove again, cleared but not armed");
        self.turn(bench, emulator);
    }

    /// Everything that can happen to a wire; what turned bits and repeated answers show as is the protocol's.
    pub fn endures_its_wire(
        &self,
        emulator: &Emulator,
        flipped: &[Fault],
        stale: &[Fault],
        frozen: Duration,
        harmless: &[Mischief],
    ) {
        let mut bench = self.servo(emulator);
        let lost: &[Fault] = &[Fault::DriveLost];
        for (mischief, faults, bound) in [
            (Mischief::Silent, lost, SILENCE),
            (Mischief::Garbage, lost, SILENCE),
            (Mischief::Truncated, lost, SILENCE),
            (Mischief::Flipped, flipped, SILENCE),
            (Mischief::Stale, stale, frozen),
            (Mischief::Unplugged, lost, self.timeout()),
        ] {
            println!("{mischief:?}");
            self.ends_at_zero(
                &mut bench,
                emulator,
                faults,
                bound,
                || emulator.spoil(mischief),
                || {
                    emulator.spoil(Mischief::None);
                    (self.revive)(emulator);
                },
            );
        }
        let log = bench.site.log();
        assert!(log.contains("nothing came for") && log.contains("though bytes come"), "{log}");
        // What loses nothing stops nothing.
        for mischief in harmless {
            let read = (0..6).find_map(|_| {
                self.turn(&mut bench, emulator);
                emulator.spoil(*mischief);
                let rows = self.drive_for(&mut bench, 300);
                emulator.spoil(Mischief::None);
                let read = rows.iter().filter(|row| row.signals.shaft_speed_rad_s.is_finite()).count();
                rows.iter().all(|row| row.faults == 0).then_some(read as f64 / rows.len() as f64)
            });
            let read = read.unwrap_or_else(|| panic!("{mischief:?} is no fault"));
            assert!(read > 0.05, "{mischief:?}: readings in {read} of the ticks");
        }
    }

    /// A reset, and a fault of the drive's own, of which the log has these words. A reset takes that fault along.
    pub fn resets_and_reports(&self, emulator: &Emulator, code: u32, words: &str) {
        let mut bench = self.servo(emulator);
        let reset = [Fault::DriveRestarted, Fault::DriveLost];
        self.ends_at_zero(&mut bench, emulator, &reset, SILENCE, || emulator.restart(), || ());
        let fault = [Fault::AmplifierFault];
        let report = || emulator.report(code);
        let mend = || {
            emulator.report(0);
            (self.revive)(emulator);
        };
        self.ends_at_zero(&mut bench, emulator, &fault, SILENCE, report, mend);
        assert!(bench.site.log().contains(words), "{}", bench.site.log());
        self.ends_at_zero(&mut bench, emulator, &fault, SILENCE, report, || emulator.restart());
    }

    /// It reaches the drive asked for, on a rig of another kind; a machine that stands still trips it: then once more.
    pub fn follows(&self, emulator: &Emulator) {
        let mut bench = self.servo(emulator);
        let there = (0..6).any(|_| {
            self.turn(&mut bench, emulator);
            self.drive_for(&mut bench, 500);
            (emulator.truth().command - self.drive).abs() < 0.01 * self.drive
        });
        assert!(there, "{}: {:?}", self.rig, emulator.truth());
    }

    /// A servo that is killed or stands still: the drive's own time-out ends it.
    pub fn outlives_its_servo(&self, emulator: &Emulator) {
        for signal in ["STOP", "KILL"] {
            let mut bench = self.servo(emulator);
            self.turn(&mut bench, emulator);
            let began = Instant::now();
            kill(bench.servo.id(), signal);
            wait("zero at the motor", || (emulator.truth().command == 0.0).then_some(()));
            let took = emulator.driven().expect("it drove").saturating_duration_since(began);
            println!("{} SIG{signal}: zero at the motor after {} ms", self.kind, took.as_millis());
            let bound = self.timeout();
            assert!(took <= bound + SLACK, "SIG{signal}: {took:?} beyond {bound:?}");
            kill(bench.servo.id(), "KILL");
            (self.revive)(emulator);
        }
    }

    /// Its own time-out cannot be confirmed: nobody arms it.
    pub fn cannot_be_armed(&self, emulator: &Emulator, words: &str) {
        let mut bench = self.servo(emulator);
        let log = wait("the reason", || Some(bench.site.log()).filter(|log| log.contains(words)));
        assert!(log.contains("hint:"), "{log}");
        bench.send(20, |ports, _| ports.command.send(self.command).unwrap());
        let (outcome, answer) = bench.ask(RequestKind::Arm);
        assert_eq!(outcome, Outcome::Refused, "{answer}");
        assert!(answer.contains("drive_unguarded (code 17)"), "{answer}");
        bench.send(20, |ports, _| ports.command.send(self.command).unwrap());
        // It answers, so it is not lost, and what it is not asked for no sensor owes.
        let (outcome, answer) = bench.ask(RequestKind::ClearFaults);
        assert_eq!(outcome, Outcome::Refused);
        assert!(answer.ends_with("still there: drive_unguarded (code 17)"), "{answer}");
        assert!(emulator.driven().is_none(), "it was driven");
    }
}
