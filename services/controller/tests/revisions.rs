//! Another revision of the rig under way: no step of the drive, and none that the drive cannot follow.

use kort_control::{ControllerConfig, LawKind};
use kort_controller::tick::{Revision, Tick};
use kort_proto::messages::{DriveKind, Header, Setpoint, SetpointKind, Telemetry};
use kort_proto::signals::Signals;
use kort_thruster::rig::Rig;

const RIG: &str = include_str!("../../../config/thrusters/whitcomb-yoerger-1999.toml");
const PERIOD: u64 = 4_000_000;
const START: u64 = 1_000_000_000;

/// A controller whose law has no loop, so that what it drives is what its model says, under 50 N.
struct Driving {
    tick: Tick,
    ticks: u64,
}

impl Driving {
    fn start() -> Self {
        let config = ControllerConfig::with_law(LawKind::StaticMap);
        let tick = Tick::new(&Rig::from_toml(RIG).unwrap(), &config, PERIOD, START).unwrap();
        let mut driving = Self { tick, ticks: 0 };
        assert!(driving.run(500) > 1.0, "it drives");
        driving
    }

    /// The drive after some ticks, A.
    fn run(&mut self, ticks: u64) -> f64 {
        let mut drive = f64::NAN;
        for _ in 0..ticks {
            self.ticks += 1;
            let now = START + self.ticks * PERIOD;
            let header = Header { sequence: self.ticks, stamp_ns: now, session: START - 9 };
            let signals = Signals { shaft_speed_rad_s: 36.0, ..Signals::UNKNOWN };
            let (armed, armed_at_ns, drive_max) = (u32::from(self.ticks > 2), START, 9.0);
            let telemetry =
                Telemetry { header, signals, armed, armed_at_ns, drive_max, ..Telemetry::default() };
            self.tick.take_telemetry(&telemetry, now);
            let setpoint = Setpoint {
                header,
                generation: 1,
                given_at_ns: START + 1,
                lease_until_ns: u64::MAX,
                kind: SetpointKind::Thrust as u32,
                value: 50.0,
                ..Setpoint::default()
            };
            self.tick.take_setpoint(&setpoint, now);
            drive = self.tick.tick(now).drive;
        }
        drive
    }
}

fn revision(text: &str, number: u64) -> Revision {
    Revision::new(&Rig::from_toml(text).unwrap(), PERIOD, number).unwrap()
}

#[test]
fn another_revision_is_no_step_and_neither_is_the_way_back() {
    let mut driving = Driving::start();
    let rubs = format!("{RIG}\n[[effects]]\neffect = \"coulomb_friction\"\ncoulomb_torque_n_m = 1.5\n");
    for (text, number, sign) in [(rubs.as_str(), 7, 1.0), (RIG, 8, -1.0)] {
        let before = driving.run(1);
        assert_eq!(driving.tick.adopt(&mut revision(text, number)), Ok(()));
        let next = driving.run(1);
        assert!((next - before).abs() < 0.2, "revision {number}: {before} to {next} A");
        assert_eq!(driving.tick.state().rig_revision, number);
        // 1.5 N m at 1.25 N m/A is what a shaft that rubs needs more, and comes within the fading time.
        let more = sign * (driving.run(500) - before);
        assert!((0.8..1.6).contains(&more), "revision {number}: {more} A");
    }
}

#[test]
fn a_drive_of_another_kind_is_refused_and_nothing_changes() {
    let mut driving = Driving::start();
    let before = driving.run(1);
    let speed = RIG.replace("kind = \"current\"", "kind = \"speed\"");
    assert_eq!(driving.tick.adopt(&mut revision(&speed, 9)), Err(DriveKind::Current));
    assert_eq!(driving.tick.state().rig_revision, 0);
    assert!((driving.run(1) - before).abs() < 1e-6, "it drives on as before");
}
