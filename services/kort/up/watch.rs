//! What the supervisor hears of one thruster through shared memory: that its processes beat, and how it stands.

use std::time::{Duration, Instant, SystemTime};

use kort_proto::events::Before;
use kort_proto::faults::Fault;
use kort_proto::limits::Limit;
use kort_proto::messages::{Request, RequestKind, Trip};
use kort_proto::transport::{Deployment, Latched, Stood, SupervisorPorts, monotonic_ns};

use super::role::Heritage;

/// Ports that cannot be opened are tried again this often.
const REOPEN_EVERY: Duration = Duration::from_millis(100);
/// A stop that is no older came of the end of a process that is found ended now.
const JUST_NOW: Duration = Duration::from_millis(200);
/// Thrust that counts as none, share of the largest.
const THRUST_SMALL: f64 = 0.03;
/// Shaft speed that counts as none, share of the largest.
const SPEED_SMALL: f64 = 0.08;

/// One thruster under watch.
pub struct Watch {
    id: String,
    ports: Option<SupervisorPorts>,
    tried: Option<Instant>,
    /// How it stood when it was last heard.
    pub stood: Stood,
    tripped: Trip,
    ramping: bool,
    thrust_max_n: f64,
    speed_max_rad_s: f64,
    heard: Option<Instant>,
    armed_at: Option<Instant>,
}

/// Who beat since the last look.
#[derive(Clone, Copy, Debug, Default)]
pub struct Beats {
    /// The servo sent telemetry.
    pub servo: bool,
    /// The controller sent its state.
    pub controller: bool,
    /// The gateway sent its setpoint.
    pub gateway: bool,
}

impl Watch {
    /// Starts from how the thruster stood when it was last heard, perhaps under another supervisor.
    pub fn new(id: &str, stood: Stood) -> Self {
        Self {
            id: id.to_owned(),
            ports: None,
            tried: None,
            stood,
            tripped: Trip::default(),
            ramping: false,
            thrust_max_n: f64::NAN,
            speed_max_rad_s: f64::NAN,
            heard: None,
            armed_at: None,
        }
    }

    /// The thruster.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Reads what came since the last look.
    pub fn look(&mut self, deployment: &Deployment) -> Beats {
        let generation = deployment.generation();
        if self.ports.as_ref().is_some_and(|ports| Some(ports.generation) != generation) {
            self.ports = None;
        }
        if self.ports.is_none() && self.tried.is_none_or(|at| at.elapsed() >= REOPEN_EVERY) {
            self.tried = Some(Instant::now());
            self.ports = SupervisorPorts::open(deployment, &self.id).ok();
        }
        let Some(ports) = &self.ports else { return Beats::default() };
        let mut beats = Beats::default();
        // First: a ramp is known before its samples are looked at, and its last ones come when its end is known already.
        let was_ramping = self.ramping;
        if let Some(state) = ports.state.latest() {
            beats.controller = true;
            self.stood.controller_faults = state.faults;
            self.ramping = state.limits & Limit::LeaseRamp.bit() != 0;
            self.thrust_max_n = state.thrust_max_n;
            self.speed_max_rad_s = state.speed_max_rad_s;
        }
        while let Some(telemetry) = ports.telemetry.next() {
            beats.servo = true;
            self.heard = Some(Instant::now());
            let there = |value: f64, last: Option<f64>| Some(value).filter(|v| v.is_finite()).or(last);
            self.stood.armed = telemetry.armed != 0;
            self.stood.servo_faults = telemetry.faults;
            self.stood.thrust_n = there(telemetry.signals.thrust_n, self.stood.thrust_n);
            self.stood.shaft_speed_rad_s =
                there(telemetry.signals.shaft_speed_rad_s, self.stood.shaft_speed_rad_s);
            self.tripped = telemetry.tripped;
            if self.stood.armed {
                self.armed_at = self.heard;
            }
            if self.stood.armed && !was_ramping && !self.ramping {
                let (thrust_n, shaft_speed_rad_s) = (self.stood.thrust_n, self.stood.shaft_speed_rad_s);
                self.stood.driven = Some(Before { thrust_n, shaft_speed_rad_s });
            }
        }
        if beats.servo {
            self.stood.heard = Some(Stood::time(SystemTime::now()));
        }
        beats.gateway = ports.setpoint.latest().is_some();
        if beats.servo || beats.controller {
            self.note_latched(None);
        }
        beats
    }

    /// Notes when each latched fault came, now if not `at` another time, and forgets those that were cleared.
    fn note_latched(&mut self, at: Option<&str>) {
        let faults = self.stood.servo_faults | self.stood.controller_faults;
        let latched = &mut self.stood.latched;
        latched.retain(|known| Fault::in_set(faults).any(|fault| fault.code() == known.code));
        for fault in Fault::in_set(faults) {
            if latched.iter().all(|known| known.code != fault.code()) {
                let stopped = Some(&self.tripped).filter(|trip| trip.at_ns != 0);
                latched.push(Latched {
                    code: fault.code(),
                    since: at.map_or_else(|| Stood::time(SystemTime::now()), str::to_owned),
                    before: (self.stood.driven.filter(|_| fault.is_ramped()))
                        .or(stopped.map(|trip| Before::of(trip.thrust_n, trip.shaft_speed_rad_s))),
                });
            }
        }
    }

    /// What the successor of a process takes over.
    pub fn heritage(&mut self, role: &str) -> Heritage {
        match role {
            "servo" => {
                self.servo_ended();
                Heritage { latched: self.stood.servo_faults, tripped: self.tripped }
            }
            "controller" => Heritage { latched: self.stood.controller_faults, tripped: Trip::default() },
            _ => Heritage::default(),
        }
    }

    /// The servo has ended: its successor starts disarmed, and if it was armed, that is a stop nobody asked for. It is as old
    /// as the servo's last word: where the whole service died, that is long before anybody is told.
    pub fn servo_ended(&mut self) {
        if self.stood.armed {
            self.tripped = self.last_word();
            self.stood.servo_faults |= Fault::ServoRestarted.bit();
            let heard = self.stood.heard.clone();
            self.note_latched(heard.as_deref());
        }
        self.stood.armed = false;
    }

    /// What the thruster did just before a process of it ended while it was armed: by now that end may have stopped it.
    pub fn driven_till_now(&self) -> Option<Before> {
        let Stood { armed, servo_faults, controller_faults, thrust_n, shaft_speed_rad_s, driven, .. } =
            &self.stood;
        let stopped =
            servo_faults | controller_faults != 0 && self.armed_at.is_some_and(|at| at.elapsed() < JUST_NOW);
        if *armed {
            return Some(Before { thrust_n: *thrust_n, shaft_speed_rad_s: *shaft_speed_rad_s });
        }
        driven.filter(|_| stopped)
    }

    /// What the thruster did when it was last heard, as a stop of then.
    fn last_word(&self) -> Trip {
        let heard = self.stood.heard.as_deref().and_then(|time| humantime::parse_rfc3339(time).ok());
        let ago = heard.and_then(|time| SystemTime::now().duration_since(time).ok()).unwrap_or_default();
        let ago_ns = u64::try_from(ago.as_nanos()).unwrap_or(u64::MAX);
        Trip {
            // Zero says that there was no stop; the machine itself may have been started since.
            at_ns: monotonic_ns().saturating_sub(ago_ns).max(1),
            thrust_n: self.stood.thrust_n.unwrap_or(f64::NAN),
            shaft_speed_rad_s: self.stood.shaft_speed_rad_s.unwrap_or(f64::NAN),
            drive: f64::NAN,
        }
    }

    /// Asks servo or controller for something.
    pub fn ask(&mut self, kind: RequestKind) {
        if let Some(ports) = &mut self.ports {
            let _ = ports.request.send(Request { kind: kind as u32, ..Request::default() });
        }
    }

    /// Is the servo heard?
    pub fn speaks(&self) -> bool {
        self.heard.is_some_and(|at| at.elapsed() < Duration::from_millis(300))
    }

    /// Is there practically no thrust any more? Shaft speed decides where thrust is not measured.
    pub fn at_rest(&self) -> bool {
        let small = |value: Option<f64>, most: f64, share: f64, floor: f64| {
            value.is_none_or(|value| value.abs() <= if most.is_finite() { share * most } else { floor })
        };
        small(self.stood.thrust_n, self.thrust_max_n, THRUST_SMALL, 2.0)
            && small(self.stood.shaft_speed_rad_s, self.speed_max_rad_s, SPEED_SMALL, 5.0)
    }

    /// Thrust and shaft speed in words.
    pub fn words(&self) -> String {
        let text = |value: Option<f64>, unit: &str| match value {
            Some(value) => format!("{value:.1} {unit}"),
            None => format!("{unit} not measured"),
        };
        format!("{}, {}", text(self.stood.thrust_n, "N"), text(self.stood.shaft_speed_rad_s, "rad/s"))
    }
}
