//! The bridge: shared memory on one side, latest values, windows and commands on the other.
//!
//! iceoryx2's ports belong to one thread and know no async, so this thread owns them. It sends every
//! thruster's setpoint anew each heartbeat: silence means the gateway is gone, and the controller
//! then goes to zero by itself.

mod held;
mod pending;
mod pulse;
mod told;

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, mpsc};
use std::time::{Duration, Instant};

use kort_proto::events::{Before, EventKind};
use kort_proto::faults::Fault;
use kort_proto::limits::Limit;
use kort_proto::messages::{RequestKind, Setpoint as SetpointMessage, SetpointKind, Telemetry, Trip};
use kort_proto::transport::{Deployment, GatewayPorts, Ticker, TransportError, monotonic_ns, realtime};

use crate::events::Events;
use crate::heard::AWAY_AFTER;
use crate::record::Recorder;
use crate::ring::Feed;
use crate::tally::Tally;
use crate::thruster::{Ask, Thruster};
use crate::view::Setpoint;
use held::Held;
use pending::Pending;
pub use pulse::{Bell, Pulse};

/// Ports that cannot be opened, or that belong to a past generation, are tried again this often.
const REOPEN_EVERY: Duration = Duration::from_millis(100);

/// While a request is under way its answer is looked for this often, whatever the heartbeat: a stop waits for no tick.
const ERRAND_EVERY: Duration = Duration::from_millis(2);
/// And for so long after the last one, until what was done shows in the telemetry too.
const ERRANDS_FOR: Duration = Duration::from_millis(100);

/// Below servo and controller, above everything that may wait.
const PRIORITY: i32 = 60;

/// One thruster's way through shared memory.
pub struct Link {
    /// Desk and latest values.
    pub thruster: Arc<Thruster>,
    /// Windows and counters for the metrics.
    pub tally: Arc<Tally>,
    /// Requests from the routes.
    pub asks: mpsc::Receiver<Ask>,
    /// Period of the heartbeat.
    pub heartbeat: Duration,
    /// The event log.
    pub events: Arc<Events>,
    /// The last minutes.
    pub ring: Feed,
}

/// Runs until `stop` is set; the bell wakes it.
pub fn run(
    deployment: &Deployment,
    links: Vec<Link>,
    recorder: &Recorder,
    pulse: &Pulse,
    bell: &Bell,
    stop: &AtomicBool,
) {
    bell.hang();
    for warning in realtime(PRIORITY, false) {
        tracing::warn!("{warning}");
    }
    let period = links.iter().map(|link| link.heartbeat).min().unwrap_or(Duration::from_millis(4));
    let mut bridges: Vec<Bridge> = links.into_iter().map(|link| Bridge::new(link, deployment)).collect();
    let mut ticker = Ticker::new(period.as_nanos() as u64);
    while !stop.load(Ordering::Relaxed) {
        let woke_ns = monotonic_ns();
        for bridge in &mut bridges {
            bridge.tick(deployment, recorder, pulse);
            bridge.link.tally.gateway(&ticker.timing, bridge.link.thruster.heard().own_faults);
        }
        ticker.worked(woke_ns);
        run_errands(&mut bridges, recorder, ticker.next_ns());
        ticker.wait();
    }
    // What was done since the last tick.
    bridges.iter().for_each(|bridge| bridge.link.thruster.tell_notes(Instant::now()));
}

/// Until the next tick: hands on requests that come, and looks for what came of them.
fn run_errands(bridges: &mut [Bridge], recorder: &Recorder, until_ns: u64) {
    loop {
        let left = Duration::from_nanos(until_ns.saturating_sub(monotonic_ns()));
        if left.is_zero() {
            return;
        }
        let now = Instant::now();
        let busy = bridges.iter().any(|bridge| bridge.errands_until.is_some_and(|until| until > now));
        std::thread::park_timeout(if busy { ERRAND_EVERY.min(left) } else { left });
        for bridge in bridges.iter_mut() {
            bridge.errand(recorder);
        }
    }
}

struct Bridge {
    link: Link,
    deployment: Deployment,
    ports: Option<GatewayPorts>,
    checked: Option<Instant>,
    complaint: String,
    pending: Vec<Pending>,
    next_ask: u64,
    last_servo_sequence: (u64, u64),
    held: Held,
    /// Latched faults of servo and controller as last heard; none before the first word.
    latched: [Option<u64>; 2],
    /// The last stop that nobody asked for, by the servo's word.
    tripped: Trip,
    mismatch_path: u32,
    /// What the thruster did when it was last heard armed.
    before: Option<Before>,
    /// And before it was ramped down: a lost gateway's stop begins there.
    before_ramp: Option<Before>,
    ramping: bool,
    /// When it was last heard ramped down, or its controller was told that nobody commands it.
    ramped: Option<Instant>,
    /// As the servo said last, and whether somebody asked since the arming for its end.
    armed: bool,
    disarm_asked: bool,
    /// The calibration that armed it, if one did.
    calibrates: Option<String>,
    /// Until when answers are looked for between two ticks.
    errands_until: Option<Instant>,
}

impl Bridge {
    fn new(link: Link, deployment: &Deployment) -> Bridge {
        Bridge {
            link,
            deployment: deployment.clone(),
            ports: None,
            checked: None,
            complaint: String::new(),
            pending: Vec::new(),
            next_ask: 1,
            last_servo_sequence: (0, 0),
            held: Held::default(),
            latched: [None; 2],
            tripped: Trip::default(),
            mismatch_path: 0,
            before: None,
            before_ramp: None,
            ramping: false,
            ramped: None,
            armed: false,
            disarm_asked: false,
            calibrates: None,
            errands_until: None,
        }
    }

    fn tick(&mut self, deployment: &Deployment, recorder: &Recorder, pulse: &Pulse) {
        let now = Instant::now();
        self.link.thruster.tell_notes(now);
        if self.checked.is_none_or(|at| now.duration_since(at) >= REOPEN_EVERY) {
            self.checked = Some(now);
            self.link.thruster.hear(|_| {}); // silence too is news: what was rendered is no longer so
            self.keep_open(deployment);
        }
        let Some(mut ports) = self.ports.take() else {
            self.link.thruster.looked(now, false);
            return self.refuse(now);
        };
        self.receive(&ports, recorder, now);
        let asked =
            self.send_asks(&mut ports, now).and_then(|()| self.ask_again(&mut ports, deployment, now));
        let sent = asked.and_then(|()| match pulse.alive() {
            true => ports.setpoint.send(self.setpoint(now)),
            false => Ok(()),
        });
        self.answer_overdue(now);
        match sent {
            Ok(()) => self.ports = Some(ports),
            Err(error) => self.complain(error),
        }
    }

    /// Between two ticks: requests go out and answers come in; nothing is asked of the thruster.
    fn errand(&mut self, recorder: &Recorder) {
        let now = Instant::now();
        let Some(mut ports) = self.ports.take() else { return };
        let sent = self.send_asks(&mut ports, now);
        if self.errands_until.is_some_and(|until| until > now) {
            self.receive(&ports, recorder, now);
        }
        match sent {
            Ok(()) => self.ports = Some(ports),
            Err(error) => self.complain(error),
        }
    }

    /// Opens the ports of the deployment's present generation.
    fn keep_open(&mut self, deployment: &Deployment) {
        let generation = deployment.generation();
        if let Some(ports) = &self.ports {
            if generation == Some(ports.generation) {
                return;
            }
            if let (None, Err(error @ TransportError::OpenFiles { .. })) =
                (generation, deployment.generation_of_our_version())
            {
                // What is open works on; only what comes next cannot be read.
                return self.complain(error);
            }
        }
        self.ports = None;
        match GatewayPorts::open(deployment, &self.link.thruster.id) {
            Ok(ports) => {
                tracing::info!(
                    thruster = self.link.thruster.id,
                    generation = ports.generation,
                    "shared memory is open"
                );
                self.complaint.clear();
                self.ports = Some(ports);
            }
            Err(error) => self.complain(error),
        }
    }

    /// Says what is wrong once, not at every try.
    fn complain(&mut self, error: TransportError) {
        let words = error.to_string();
        if words != self.complaint {
            tracing::warn!(thruster = self.link.thruster.id, "{words}");
            self.complaint = words;
        }
    }

    fn receive(&mut self, ports: &GatewayPorts, recorder: &Recorder, now: Instant) {
        let mut last: Option<Telemetry> = None;
        while let Some(telemetry) = ports.telemetry.next() {
            let (session, sequence) = (telemetry.header.session, telemetry.header.sequence);
            let known = self.last_servo_sequence;
            if session < known.0 || (session == known.0 && sequence <= known.1) {
                continue;
            }
            let lost = if session == known.0 { sequence - known.1 - 1 } else { 0 };
            self.last_servo_sequence = (session, sequence);
            self.link.tally.telemetry(&telemetry, lost);
            recorder.offer(&self.link.thruster.id, &telemetry, lost);
            self.link.ring.take(&telemetry);
            self.held.take(&telemetry);
            // On a line of its own: the log is written without the trial's lock.
            let worse = self.link.thruster.trial().take(&telemetry);
            if let Some(worse) = worse {
                let id = &self.link.thruster.id;
                self.link.events.tell(EventKind::RigWorse, Some(id), "gateway", worse.words());
            }
            if telemetry.armed != 0 {
                let shown = self.held.fill(telemetry).signals;
                self.before = Some(Before::of(shown.thrust_n, shown.shaft_speed_rad_s));
                self.before_ramp = self.before_ramp.filter(|_| self.ramping).or(self.before);
            }
            self.tripped = telemetry.tripped;
            self.tell_tripped(0, telemetry.faults);
            last = Some(telemetry);
        }
        // The servo's word dates what the controller has latched: it comes first, if it comes at all.
        let dated = self.latched[0].is_some() || self.link.thruster.heard().silence(now) >= AWAY_AFTER;
        let state = ports.state.latest().filter(|_| dated);
        if let Some(state) = &state {
            self.link.tally.controller(state);
            self.ramping = state.limits & Limit::LeaseRamp.bit() != 0;
            self.ramped = if self.ramping { Some(now) } else { self.ramped };
            self.tell_tripped(1, state.faults);
            self.tell_mismatch(state);
            if let Some(telemetry) = &last {
                self.link.ring.believe(telemetry.time_ns, state);
            }
        }
        // Once the faults of both are known.
        if let Some(telemetry) = &last {
            self.tell_disarmed(telemetry);
        }
        let thruster = &self.link.thruster;
        thruster.looked(now, last.is_some());
        if last.is_some() || state.is_some() {
            thruster.hear(|heard| {
                if let Some(telemetry) = last {
                    heard.servo = Some((now, self.held.fill(telemetry)));
                }
                if let Some(state) = state {
                    heard.controller = Some((now, state));
                }
            });
        }
        while let Some(reply) = ports.reply.next() {
            if reply.to_session == ports.request.session() {
                let _ = self.pending.iter_mut().any(|pending| pending.take(&reply));
            }
        }
        let (complete, waiting) = std::mem::take(&mut self.pending).into_iter().partition(Pending::complete);
        self.pending = waiting;
        complete.into_iter().for_each(Pending::finish);
    }

    fn send_asks(&mut self, ports: &mut GatewayPorts, now: Instant) -> Result<(), TransportError> {
        while let Ok(mut ask) = self.link.asks.try_recv() {
            ask.request.id = self.next_ask;
            self.next_ask += 1;
            self.errands_until = Some(now + ask.within.min(ERRANDS_FOR));
            let request = ask.request;
            self.disarm_asked |= request.kind == RequestKind::Disarm as u32;
            self.pending.push(Pending::new(ask, now));
            ports.request.send(request)?;
        }
        Ok(())
    }

    /// Sends again what is not answered, through ports opened anew: most likely a connection did not come about.
    fn ask_again(
        &mut self,
        ports: &mut GatewayPorts,
        deployment: &Deployment,
        now: Instant,
    ) -> Result<(), TransportError> {
        let due: Vec<_> = self.pending.iter_mut().filter_map(|pending| pending.again(now)).collect();
        if due.is_empty() {
            return Ok(());
        }
        let thruster = self.link.thruster.id.clone();
        if let Err(error) = ports.reconnect_requests(deployment, &thruster) {
            self.complain(error);
        }
        for (request, silent) in due {
            let id = request.id;
            tracing::warn!(thruster, "no answer by the {} to request {id}: sent again", silent.name());
            ports.request.send(request)?;
        }
        Ok(())
    }

    /// Without ports nobody can be asked. Where they are merely in use, a request that comes meanwhile waits for them.
    fn refuse(&mut self, now: Instant) {
        self.link.asks.try_iter().for_each(drop);
        self.answer_overdue(now);
    }

    fn answer_overdue(&mut self, now: Instant) {
        let (over, waiting) =
            std::mem::take(&mut self.pending).into_iter().partition(|pending| pending.overdue(now));
        self.pending = waiting;
        over.into_iter().for_each(Pending::finish);
    }

    /// What the desk asks for now. A disarmed thruster is asked for nothing, so that arming starts at rest.
    fn setpoint(&mut self, now: Instant) -> SetpointMessage {
        let heard = self.link.thruster.heard();
        let mut desk = self.link.thruster.desk();
        desk.expire(now);
        // Nothing is lost here: a setpoint is accepted only once this thread has heard the arming.
        if !heard.armed(now) {
            desk.rest(now, "the drive is not armed");
        }
        if let Some(fault) = Fault::in_set(heard.faults(now)).next() {
            desk.end_excitation_at_zero(now, Some(fault.name()));
        }
        desk.advance(now);
        let (kind, value) = match desk.setpoint() {
            Some(Setpoint::ThrustN(value)) => (SetpointKind::Thrust, value),
            Some(Setpoint::SpeedRadS(value)) => (SetpointKind::Speed, value),
            None => (SetpointKind::Zero, 0.0),
        };
        // At zero its controller disarms it within one tick, of which this thread may hear nothing.
        if heard.armed(now) && desk.lease.current(now).is_none() {
            self.ramped = Some(now);
        }
        let lease_until_ns =
            desk.lease.current(now).map_or(0, |lease| monotonic_ns() + lease.expires_in_ms(now) * 1_000_000);
        let ago_ns = |at: Instant| u64::try_from(now.duration_since(at).as_nanos()).unwrap_or(u64::MAX);
        SetpointMessage {
            generation: desk.generation(),
            given_at_ns: desk.given().map_or(0, |at| monotonic_ns().saturating_sub(ago_ns(at))),
            lease_until_ns,
            kind: kind as u32,
            value,
            ..SetpointMessage::default()
        }
    }
}
