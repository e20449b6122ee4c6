//! The production ticks on virtual time: servo and controller with the messages they exchange, an
//! operator who sets thrust, and clears faults and arms again after half a second.
//!
//! As in the live service, a command acts one servo tick after the telemetry it answers.

use kort_control::{Controller, ControllerConfig, ModelError, Output};
use kort_controller::tick::Tick;
use kort_proto::messages::{Command, Header, Request, RequestKind, Setpoint, SetpointKind};
use kort_proto::signals::Signals;
use kort_servo::settings::{Limits, Settings};
use kort_servo::tick::{Inputs, Servo};
use kort_soak::{Chain, Driven};
use kort_thruster::rig::{AmplifierKind, Rig};

/// Virtual time starts here, ns: sessions are told apart by when they began.
const START_NS: u64 = 1_000_000_000;
/// The operator looks that long at a fault before acting, s.
const OPERATOR_S: f64 = 0.5;

/// Controller, servo and operator of one thruster.
pub struct ProductionChain {
    rig: Rig,
    config: ControllerConfig,
    period_ns: u64,
    now_ns: u64,
    servo: Servo,
    controller: Tick,
    controller_session: u64,
    sequence: u64,
    command: Option<Command>,
    setpoint: Setpoint,
    /// The setpoint was given while armed: one that came with the arming does not count yet.
    given_armed: bool,
    disarmed_s: f64,
    /// Fault bits that the servo has latched since start, and how often it went off by itself.
    trips: u32,
    was_armed: bool,
}

impl Chain for ProductionChain {
    /// At rest, not yet armed: the operator arms in the first ticks.
    fn start(rig: &Rig, config: &ControllerConfig, period_s: f64) -> Result<Self, ModelError> {
        let period_ns = (period_s * 1e9).round() as u64;
        let controller = Tick::new(rig, config, period_ns, START_NS)?;
        let servo = Servo::new(settings(rig, controller.controller(), period_ns), START_NS);
        Ok(Self {
            rig: rig.clone(),
            config: *config,
            period_ns,
            now_ns: START_NS,
            servo,
            controller,
            controller_session: START_NS,
            sequence: 0,
            command: None,
            setpoint: Setpoint::default(),
            given_armed: false,
            disarmed_s: OPERATOR_S,
            trips: 0,
            was_armed: false,
        })
    }

    fn controller(&self) -> &Controller {
        self.controller.controller()
    }

    fn output(&self) -> &Output {
        self.controller.output()
    }

    fn trips(&self) -> u32 {
        self.trips
    }

    fn restart(&mut self) {
        if let Ok(fresh) = Tick::new(&self.rig, &self.config, self.period_ns, self.now_ns) {
            self.controller = fresh;
            self.controller_session = self.now_ns;
        }
    }

    fn tick(&mut self, measured: &Signals, thrust_n: f64, alive: bool) -> Driven {
        self.now_ns += self.period_ns;
        self.sequence += 1;
        let now = self.now_ns;
        // A speed drive guards its own current and tells none: the servo's guard is given none that flows.
        let mut guarded = *measured;
        if self.rig.amplifier.kind == AmplifierKind::Speed && guarded.current_a.is_nan() {
            guarded.current_a = 0.0;
        }
        if let Some(command) = self.command.take() {
            self.servo.take_command(&command, now);
        }
        let drive = self.servo.tick(&Inputs { now_ns: now, ticks: 1, measured: &guarded, devices: 0 });
        self.operate(alive, thrust_n);
        if alive {
            let mut telemetry = self.servo.telemetry(now, measured);
            telemetry.header = self.header(START_NS);
            self.controller.take_telemetry(&telemetry, now);
            self.setpoint.header = self.header(START_NS);
            self.controller.take_setpoint(&self.setpoint, now);
            let mut command = self.controller.tick(now);
            command.header = self.header(self.controller_session);
            self.command = Some(command);
        }
        Driven { command: drive.unwrap_or(0.0), armed: drive.is_some() }
    }
}

impl ProductionChain {
    fn header(&self, session: u64) -> Header {
        Header { sequence: self.sequence, stamp_ns: self.now_ns, session }
    }

    /// Sets thrust; after a fault clears it, arms, and sets thrust anew.
    fn operate(&mut self, alive: bool, thrust_n: f64) {
        let now = self.now_ns;
        let armed = self.servo.armed();
        if self.was_armed && !armed {
            self.trips += 1;
        }
        self.was_armed = armed;
        if armed {
            self.disarmed_s = 0.0;
        } else {
            self.disarmed_s += self.period_ns as f64 * 1e-9;
            if alive && self.disarmed_s >= OPERATOR_S {
                // Tried again every few ticks until the cause is gone and a controller speaks.
                self.disarmed_s -= 4.0 * self.period_ns as f64 * 1e-9;
                for kind in [RequestKind::ClearFaults, RequestKind::Arm] {
                    let request =
                        Request { header: self.header(START_NS), kind: kind as u32, ..Request::default() };
                    self.servo.request(&request, now);
                    self.controller.request(&request, now);
                }
                self.was_armed = self.servo.armed();
            }
        }
        // A setpoint counts if it was given after the arming; `armed` is as the servo ticked.
        if self.setpoint.value != thrust_n || !armed || !self.given_armed {
            self.given_armed = armed;
            self.setpoint.generation += 1;
            self.setpoint.given_at_ns = now;
            self.setpoint.kind = SetpointKind::Thrust as u32;
            self.setpoint.value = thrust_n;
        }
        self.setpoint.lease_until_ns = now + 1_000_000_000;
    }
}

/// The servo's settings at the defaults of `kort.toml`, with speed limits wide enough for a shaft
/// that races without load to be the law's problem first.
fn settings(rig: &Rig, controller: &Controller, period_ns: u64) -> Settings {
    let model = controller.nominal();
    let speed_rad_s = 1.75 * model.speed_max_rad_s;
    let drive_max = match rig.amplifier.kind {
        AmplifierKind::Current => model.current_limit_a,
        AmplifierKind::Voltage => rig.amplifier.supply_v.unwrap_or(f64::INFINITY),
        AmplifierKind::Speed => model.speed_max_rad_s,
    };
    let period_s = period_ns as f64 * 1e-9;
    Settings {
        period_ns,
        command_timeout_ns: period_ns * 7 / 2,
        limits: Limits::usual(rig, drive_max, model.current_limit_a, speed_rad_s, period_s),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use kort_thruster::rig::Rig;

    const RIG: &str = include_str!("../../../../config/thrusters/whitcomb-yoerger-1999.toml");

    /// A reference that never changes is followed from the first ticks, and again after a fault.
    #[test]
    fn a_constant_setpoint_counts_after_every_arming() {
        let rig = Rig::from_toml(RIG).unwrap();
        let mut chain = ProductionChain::start(&rig, &ControllerConfig::default(), 1e-3).unwrap();
        let still = Signals { shaft_speed_rad_s: 0.0, current_a: 0.0, ..Signals::UNKNOWN };
        let drives = |chain: &mut ProductionChain, ticks: u32| {
            (0..ticks).map(|_| chain.tick(&still, 50.0, true).command).fold(0.0, f64::max)
        };
        assert!(drives(&mut chain, 20) > 1.0);
        for _ in 0..20 {
            chain.tick(&still, 50.0, false);
        }
        assert_eq!((chain.trips(), drives(&mut chain, 100)), (1, 0.0), "off until the operator acts");
        assert!(drives(&mut chain, 600) > 1.0);
    }
}
