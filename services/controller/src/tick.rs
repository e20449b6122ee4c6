//! The controller's pure step: which setpoint counts, what a loss leads to, and the law under it.

use kort_control::limits::LimitSet;
use kort_control::{Controller, ControllerConfig, Measurement, ModelError, Output, Reference};
use kort_proto::faults::Fault;
use kort_proto::limits::{FIRST_OF_CONTROL, Limit};
use kort_proto::messages::{Command, DriveKind, Fresh, Freshness, Setpoint, SetpointKind, Telemetry};
use kort_proto::signals::Signals;
use kort_thruster::rig::{AmplifierKind, Rig};

use crate::slew::{Slew, rise_s};

mod end;
mod request;
mod revision;
mod state;
use end::Ending;
pub use revision::Revision;

/// Silent controller periods after which a peer counts as lost.
const GATEWAY_PERIODS: u64 = 3;
/// A gateway may be silent this long before the setpoint is ramped down: it serves a network, and a hiccup of
/// it is no reason to stop. With a shorter ramp all is over within 500 ms of its last word, at 50 Hz too.
const GATEWAY_SILENCE_NS: u64 = 100_000_000;
const SERVO_PERIODS: u64 = 10;
/// A reading stands that long for what its sensor would say: the slow ones are read at 20 Hz. After
/// that the value is not measured, and laws and observers go on without it.
const READING_LIFE_NS: u64 = 250_000_000;

/// State of the controller between setpoint and law. Starts at zero.
#[derive(Debug)]
pub struct Tick {
    controller: Controller,
    config: ControllerConfig,
    rig_revision: u64,
    kind: DriveKind,
    period_ns: u64,
    started_ns: u64,
    gateway: Freshness,
    gateway_stamp_ns: u64,
    servo: Freshness,
    servo_stamp_ns: u64,
    lease_until_ns: u64,
    /// Generation of the newest message, accepted or not.
    asked: u64,
    setpoint: Option<Accepted>,
    ending: Option<Ending>,
    slew: Slew,
    /// Time from zero to the largest setpoint, s; `None` takes the law's own, see [`crate::slew`].
    rise_s: Option<f64>,
    armed: bool,
    servo_faults: u64,
    armed_at_ns: u64,
    drive_max: f64,
    measured: Signals,
    /// When each of them was last read.
    read_ns: [u64; Signals::COUNT],
    last_ns: u64,
    latched: u64,
    limits: u64,
    invalid: u64,
    /// Session and generation of the setpoint refused last: it comes again with every heartbeat.
    refused: Option<(u64, u64)>,
    output: Output,
    in_force: f64,
    /// Until when somebody else commands the servo, on CLOCK_MONOTONIC, ns.
    aside_until_ns: u64,
}

/// A setpoint that counts.
#[derive(Clone, Copy, Debug)]
struct Accepted {
    kind: SetpointKind,
    value: f64,
    session: u64,
    generation: u64,
}

impl Tick {
    /// A controller at rest. `started_ns` is now on CLOCK_MONOTONIC: nothing sent before counts.
    ///
    /// # Errors
    /// [`ModelError`] if no controller can be built for the rig.
    pub fn new(
        rig: &Rig,
        config: &ControllerConfig,
        period_ns: u64,
        started_ns: u64,
    ) -> Result<Self, ModelError> {
        Ok(Self {
            controller: Controller::new(rig, config, period_ns as f64 * 1e-9)?,
            config: *config,
            rig_revision: 0,
            kind: drive_kind(rig),
            period_ns,
            started_ns,
            gateway: Freshness::default(),
            gateway_stamp_ns: 0,
            servo: Freshness::default(),
            servo_stamp_ns: 0,
            lease_until_ns: 0,
            asked: 0,
            setpoint: None,
            ending: None,
            slew: Slew::default(),
            rise_s: Some(0.0),
            armed: false,
            servo_faults: 0,
            armed_at_ns: 0,
            drive_max: 0.0,
            measured: Signals::UNKNOWN,
            read_ns: [0; Signals::COUNT],
            last_ns: started_ns,
            latched: 0,
            limits: 0,
            invalid: 0,
            refused: None,
            output: Output::default(),
            in_force: 0.0,
            aside_until_ns: 0,
        })
    }

    /// With setpoints that move no faster than from zero to the largest in `rise_s`; `None` takes the time that
    /// suits the law. Without this call they step.
    pub fn with_rise(self, rise_s: Option<f64>) -> Self {
        Self { rise_s, ..self }
    }

    /// Takes a telemetry sample; call for every one, oldest first.
    pub fn take_telemetry(&mut self, telemetry: &Telemetry, now_ns: u64) {
        let life_ns = SERVO_PERIODS * self.period_ns;
        let sender = self.servo.check(&telemetry.header, now_ns, life_ns);
        if sender == Fresh::No {
            return;
        }
        self.servo_stamp_ns = telemetry.header.stamp_ns;
        let armed = telemetry.armed != 0;
        if sender == Fresh::NewSession && self.armed {
            // Replaced while it drove: nobody asked for that stop.
            self.trip(Fault::ServoLost);
        }
        if !armed || sender == Fresh::NewSession || telemetry.armed_at_ns != self.armed_at_ns {
            self.forget();
        }
        self.armed = armed;
        self.servo_faults = telemetry.faults;
        self.armed_at_ns = telemetry.armed_at_ns;
        self.drive_max = if telemetry.drive_max.is_finite() { telemetry.drive_max.max(0.0) } else { 0.0 };
        // A slow sensor shows a value only on some ticks: keep the newest of each.
        let mut held = self.measured.values();
        for ((value, held), read_ns) in
            telemetry.signals.values().into_iter().zip(&mut held).zip(&mut self.read_ns)
        {
            if value.is_finite() {
                *read_ns = now_ns;
                *held = value;
            } else if now_ns.saturating_sub(*read_ns) > READING_LIFE_NS {
                *held = f64::NAN;
            }
        }
        self.measured = Signals::from_values(held);
        // A needed sensor that is gone must not look alive; between readings of a drive on a wire it is not gone.
        let life_ns = telemetry.shaft_life_ns;
        let gone = life_ns == 0 || telemetry.shaft_age_ns > life_ns;
        if gone && !telemetry.signals.shaft_speed_rad_s.is_finite() {
            self.measured.shaft_speed_rad_s = f64::NAN;
        }
    }

    /// Takes the newest setpoint message.
    pub fn take_setpoint(&mut self, message: &Setpoint, now_ns: u64) {
        let sender = self.gateway.check(&message.header, now_ns, self.gateway_timeout_ns());
        if sender == Fresh::No {
            return;
        }
        // A session is named by when it began. One that is new here but older than the arming is no
        // successor: its arming was merely faster than its first setpoint.
        if sender == Fresh::NewSession && self.armed && message.header.session > self.armed_at_ns {
            self.end(now_ns, Some(Fault::GatewayRestarted));
        }
        self.gateway_stamp_ns = message.header.stamp_ns;
        self.lease_until_ns = message.lease_until_ns;
        self.asked = message.generation;
        let kind = SetpointKind::from_u32(message.kind);
        // Only a setpoint given under a living lease, after the arming.
        let counts = self.armed
            && self.ending.is_none_or(|ending| ending.gives_way_to(kind))
            && message.given_at_ns > self.armed_at_ns
            && message.given_at_ns <= message.header.stamp_ns
            && now_ns < message.lease_until_ns;
        if !counts || self.setpoint.is_some_and(|s| s.generation == message.generation) {
            return;
        }
        let model = self.controller.model();
        let largest = match kind {
            Some(SetpointKind::Thrust) => model.thrust_max_n * (1.0 + 1e-9),
            Some(SetpointKind::Speed) => model.speed_max_rad_s * (1.0 + 1e-9),
            Some(SetpointKind::Zero) => f64::INFINITY,
            None => f64::NAN,
        };
        let value = if kind == Some(SetpointKind::Zero) { 0.0 } else { message.value };
        // Written so that a NaN on either side is refused; the setpoint before stays in force.
        match kind {
            Some(kind) if value.is_finite() && value.abs() <= largest => {
                let session = message.header.session;
                self.end_ramp();
                self.setpoint = Some(Accepted { kind, value, session, generation: message.generation });
            }
            _ => {
                let refused = Some((message.header.session, message.generation));
                if self.refused != refused {
                    self.invalid = self.invalid.wrapping_add(1);
                    self.refused = refused;
                }
            }
        }
    }

    /// One tick: the command for the servo. Its header is the sender's business.
    pub fn tick(&mut self, now_ns: u64) -> Command {
        let dt_s = now_ns.saturating_sub(self.last_ns) as f64 * 1e-9;
        self.last_ns = now_ns;
        if self.armed {
            if now_ns.saturating_sub(self.servo_stamp_ns) > SERVO_PERIODS * self.period_ns {
                self.trip(Fault::ServoLost);
            }
            // A gateway that has not spoken since the arming is given as long as one that went silent.
            let last_word = self.gateway_stamp_ns.max(self.armed_at_ns);
            if now_ns.saturating_sub(last_word) > self.gateway_timeout_ns().max(GATEWAY_SILENCE_NS) {
                self.end(now_ns, Some(Fault::GatewayLost));
            }
            if now_ns >= self.lease_until_ns.max(self.armed_at_ns + self.gateway_timeout_ns()) {
                self.end(now_ns, None);
            }
        }
        let (reference, stop) = self.reference(now_ns, dt_s);
        self.output = self.controller.tick(&self.measurement(), reference, dt_s);
        let mut drive = match self.kind {
            DriveKind::Current => self.output.command.current_a,
            DriveKind::Voltage => self.output.command.voltage_v.unwrap_or(0.0),
            DriveKind::Speed => self.output.command.speed_rad_s.unwrap_or(0.0),
            DriveKind::Duty => 0.0,
        };
        self.limits |= bits(self.output.limits);
        if !drive.is_finite() {
            self.trip(Fault::ControlNotFinite);
            drive = 0.0;
        }
        if drive.abs() > self.drive_max {
            self.limits |= Limit::Current.bit();
            drive = drive.clamp(-self.drive_max, self.drive_max);
        }
        let stop = stop || self.latched != 0;
        if stop || reference == Reference::Off {
            drive = 0.0;
        }
        Command {
            telemetry_stamp_ns: self.servo_stamp_ns,
            drive,
            thrust_cmd_n: if let Reference::Thrust(n) = reference { n } else { f64::NAN },
            speed_cmd_rad_s: if let Reference::Speed(w) = reference { w } else { f64::NAN },
            kind: self.kind as u32,
            stop: if stop { Command::STOPS } else { 0 },
            ..Command::default()
        }
    }

    /// What the law is asked for now, and whether the servo must stop.
    fn reference(&mut self, now_ns: u64, dt_s: f64) -> (Reference, bool) {
        self.limits = 0;
        self.in_force = 0.0;
        if !self.armed || self.latched != 0 {
            self.slew.reset();
            return (Reference::Off, false);
        }
        let mut share = 1.0;
        if let Some(ending) = self.ending {
            // Also where it is over at once: whoever sees the stop is told why.
            self.limits |= Limit::LeaseRamp.bit();
            let nothing = self.setpoint.is_none_or(|s| s.value == 0.0);
            if !ending.hold && (nothing || ending.is_over(now_ns)) {
                let stop = self.end_over(ending.cause, now_ns);
                return (Reference::Off, stop);
            }
            share = ending.share(now_ns);
        }
        let Some(setpoint) = self.setpoint else {
            self.slew.reset();
            return (Reference::Off, false);
        };
        self.in_force = self.slewed(setpoint, dt_s) * share;
        let reference = match setpoint.kind {
            SetpointKind::Zero => Reference::Off,
            SetpointKind::Thrust => Reference::Thrust(self.in_force),
            SetpointKind::Speed => Reference::Speed(self.in_force),
        };
        (reference, false)
    }

    /// The setpoint on its way from the one before.
    fn slewed(&mut self, setpoint: Accepted, dt_s: f64) -> f64 {
        let model = self.controller.model();
        let (full, from) = match setpoint.kind {
            SetpointKind::Thrust => (model.thrust_max_n, self.output.estimate.thrust_n.value),
            SetpointKind::Speed => (model.speed_max_rad_s, self.measured.shaft_speed_rad_s),
            SetpointKind::Zero => {
                self.slew.reset();
                return 0.0;
            }
        };
        if self.ending.is_some() {
            // The ramp down starts from what is in force, not from what was still on its way.
            return self.slew.step(setpoint.kind, self.slew.value(), full, 0.0, from, dt_s).0;
        }
        let rise_s = self.rise_s.unwrap_or_else(|| rise_s(self.config.law));
        let (value, moving) = self.slew.step(setpoint.kind, setpoint.value, full, rise_s, from, dt_s);
        if moving {
            self.limits |= Limit::SetpointRise.bit();
        }
        value
    }

    /// The law with its observer and estimator.
    pub fn controller(&self) -> &Controller {
        &self.controller
    }

    /// What the last tick gave.
    pub fn output(&self) -> &Output {
        &self.output
    }

    fn measurement(&self) -> Measurement {
        let there = |value: f64| Some(value).filter(|v| v.is_finite());
        let m = &self.measured;
        Measurement {
            shaft_speed_rad_s: there(m.shaft_speed_rad_s),
            current_a: there(m.current_a),
            thrust_n: there(m.thrust_n),
            flow_m_s: there(m.flow_m_s),
            ambient_m_s: there(m.ambient_m_s),
            supply_v: there(m.supply_v),
            shaft_angle_rad: there(m.shaft_angle_rad),
        }
    }

    fn gateway_timeout_ns(&self) -> u64 {
        GATEWAY_PERIODS * self.period_ns
    }

    fn trip(&mut self, fault: Fault) {
        self.latched |= fault.bit();
        self.forget();
    }

    /// No setpoint, no lease's end: as at start. What counts afterwards must be given afterwards.
    fn forget(&mut self) {
        self.setpoint = None;
        self.ending = None;
    }
}

/// The control crate's limits in the bits of [`Limit`]; both list them in the same order.
fn bits(limits: LimitSet) -> u64 {
    u64::from(limits.0) << FIRST_OF_CONTROL
}

/// How the rig's drive is commanded.
fn drive_kind(rig: &Rig) -> DriveKind {
    match rig.amplifier.kind {
        AmplifierKind::Current => DriveKind::Current,
        AmplifierKind::Voltage => DriveKind::Voltage,
        AmplifierKind::Speed => DriveKind::Speed,
    }
}
