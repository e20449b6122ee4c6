//! A stand on virtual time: the production servo, and behind it a thruster that is not as its rig says.

use kort_proto::messages::{Command, DriveKind, Header, Request, RequestKind};
use kort_proto::signals::Signals;
use kort_scenario::Measuring;
use kort_servo::drives::kind_of;
use kort_servo::settings::{Limits, Settings};
use kort_servo::tick::{Inputs, Servo};
use kort_thruster::models::ModelName;
use kort_thruster::plant::{Plant, Tick};
use kort_thruster::rig::{AmplifierKind, Rig};

use super::concealed::{Concealed, Trouble};

/// Virtual time starts here, ns.
const START_NS: u64 = 1_000_000_000;
/// Servo period, ns.
pub const PERIOD_NS: u64 = 1_000_000;

/// The stand.
pub struct Stand {
    plant: Plant,
    measuring: Measuring,
    servo: Servo,
    concealed: Concealed,
    kind: DriveKind,
    torque_measured: bool,
    now_ns: u64,
    sequence: u64,
    command: Command,
    applied: f64,
    way_rad: f64,
}

impl Stand {
    /// At rest. The servo believes the rig, the shaft what is concealed.
    pub fn new(rig: &Rig, concealed: Concealed, drive_max: f64, speed_max_rad_s: f64, seed: u64) -> Self {
        let tick_s = PERIOD_NS as f64 * 1e-9;
        let effects = concealed.effects();
        let scale = kort_scenario::scale(rig, &concealed.parameters, drive_max, tick_s, 60.0);
        let current_a =
            if rig.amplifier.current_limit_a.is_finite() { rig.amplifier.current_limit_a } else { 10_000.0 };
        let limits = Limits::usual(rig, drive_max, current_a, speed_max_rad_s, tick_s);
        let settings = Settings { period_ns: PERIOD_NS, command_timeout_ns: 20 * PERIOD_NS, limits };
        Self {
            plant: Plant::new(ModelName::Model2, rig, &concealed.parameters, &effects, tick_s)
                .with_encoder_quantised(true),
            measuring: Measuring::new(&rig.sensors, scale, 1.0, seed),
            servo: Servo::new(settings, START_NS),
            kind: kind_of(rig),
            torque_measured: rig.sensors.torque_transducer,
            concealed,
            now_ns: START_NS,
            sequence: 0,
            command: Command::default(),
            applied: 0.0,
            way_rad: 0.0,
        }
    }

    /// All the way that the shaft went in truth, to and fro, rad.
    pub fn way_rad(&self) -> f64 {
        self.way_rad
    }

    /// Faults that the servo latched.
    pub fn faults(&self) -> u64 {
        self.servo.faults()
    }

    /// Is the drive on?
    pub fn armed(&self) -> bool {
        self.servo.armed()
    }

    /// Arms the servo, which must have heard a command.
    pub fn arm(&mut self) {
        let header = Header { sequence: self.sequence, stamp_ns: self.now_ns, session: START_NS };
        let request = Request { header, kind: RequestKind::Arm as u32, ..Request::default() };
        self.servo.request(&request, self.now_ns);
    }

    /// One tick: this drive is asked for; what the servo tells comes back, with its instant, s.
    pub fn tick(&mut self, drive: f64) -> (f64, Signals) {
        self.now_ns += PERIOD_NS;
        self.sequence += 1;
        let tick_s = PERIOD_NS as f64 * 1e-9;
        let at_s = (self.now_ns - START_NS) as f64 * 1e-9;
        let before = self.plant.truth().shaft_angle_rad;
        let trouble = self.concealed.trouble;
        let reaches = match trouble {
            Some(Trouble::BlockedShaft) => 0.0,
            Some(Trouble::MotorReversed) => -self.applied,
            _ => self.applied,
        };
        self.plant.step(&Tick { time_s: at_s - tick_s, command: reaches, ..Tick::default() });
        self.way_rad += (self.plant.truth().shaft_angle_rad - before).abs();
        let shown = self.show(at_s);
        self.servo.take_command(&self.command, self.now_ns);
        let acting = self.servo.tick(&Inputs { now_ns: self.now_ns, ticks: 1, measured: &shown, devices: 0 });
        self.applied = acting.unwrap_or(0.0);
        let telemetry = self.servo.telemetry(self.now_ns, &shown);
        // What is asked now the servo hears with its next tick.
        self.command = Command {
            header: Header { sequence: self.sequence, stamp_ns: self.now_ns, session: START_NS },
            drive,
            kind: self.kind as u32,
            thrust_cmd_n: f64::NAN,
            speed_cmd_rad_s: f64::NAN,
            ..Command::default()
        };
        (at_s, telemetry.signals)
    }

    fn show(&mut self, at_s: f64) -> Signals {
        let read = self.measuring.read(at_s, &self.plant.sensed());
        let mut shown = Signals {
            shaft_angle_rad: read.shaft_angle_rad,
            shaft_speed_rad_s: read.shaft_speed_rad_s,
            thrust_n: read.thrust_n + self.concealed.zero_n,
            flow_m_s: read.flow_m_s + self.concealed.zero_m_s,
            ..Signals::UNKNOWN
        };
        if self.kind != DriveKind::Speed {
            shown.current_a = read.current_a;
        }
        if self.torque_measured {
            shown.torque_n_m = read.torque_n_m + self.concealed.zero_n_m;
        }
        match self.concealed.trouble {
            Some(Trouble::EncoderReversed) => {
                shown.shaft_angle_rad = -shown.shaft_angle_rad;
                shown.shaft_speed_rad_s = -shown.shaft_speed_rad_s;
            }
            Some(Trouble::DeadSensor) => {
                (shown.shaft_angle_rad, shown.shaft_speed_rad_s) = (0.0, 0.0);
            }
            Some(Trouble::ThrustReversed) => shown.thrust_n = -shown.thrust_n,
            // A drive measures its current in its own sense.
            Some(Trouble::MotorReversed) => shown.current_a = -shown.current_a,
            Some(Trouble::BlockedShaft) if self.kind == DriveKind::Current => shown.current_a += self.applied,
            Some(Trouble::BlockedShaft) | None => (),
        }
        shown
    }
}

/// Largest drive of a rig's amplifier and the shaft speed at which it ends, as a deployment would limit them.
pub fn limits(rig: &Rig) -> (f64, f64) {
    let parameters = kort_thruster::parameters::Parameters::stated(rig);
    let drive = match rig.amplifier.kind {
        AmplifierKind::Current => {
            Some(rig.amplifier.current_limit_a).filter(|a| a.is_finite()).unwrap_or(10.0)
        }
        AmplifierKind::Voltage => rig.amplifier.supply_v.unwrap_or(10.0),
        AmplifierKind::Speed => rig
            .amplifier
            .supply_v
            .map_or(100.0, |v| v / parameters.get(kort_thruster::parameters::Parameter::TorqueConstantNmA)),
    };
    let scale = kort_scenario::scale(rig, &parameters, drive, PERIOD_NS as f64 * 1e-9, 60.0);
    (drive, 1.75 * scale.shaft_speed_rad_s)
}
