//! One thruster as the gateway sees it: what it asks (the desk) and what it last heard.

mod analysis;
mod calibration;
mod command;
mod faults;
mod kept_law;
mod law;
mod told;

use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::time::{Duration, Instant};

use axum::body::Bytes;
use kept_law::KeptLaw;
use kort_proto::events::EventKind;
use kort_proto::faults::{Fault, Names};
use kort_proto::limits::Limit;
use kort_proto::messages::{ControllerState, Outcome, Process, Reply, Request, RequestKind};
use kort_proto::signals::Kind as SignalKind;
use tokio::sync::oneshot;

use crate::analysis::{AnalysisKind, Underway};
use crate::bus::Bell;
use crate::calibration::CalibrationInfo;
use crate::desk::Desk;
use crate::events::Events;
use crate::excitation::ExcitationStep;
use crate::heard::Heard;
use crate::problem::{Kind, Problem};
use crate::rig::Trial;
use crate::view::{
    Estimated, LeaseView, LimitView, MismatchView, ParameterEstimate, Setpoint, SetpointRange, ThrusterState,
    Values,
};

/// Servo and controller answer a request within this time, or are taken to be away.
pub const ANSWER_WITHIN: Duration = Duration::from_millis(700);

/// A request on its way to servo and controller.
#[derive(Debug)]
pub struct Ask {
    /// The message; the bus numbers it.
    pub request: Request,
    /// Who must answer.
    pub expects: Vec<Process>,
    /// And within which time.
    pub within: Duration,
    /// Where the answers go; fewer than expected if time ran out, and dropped if nobody can be asked.
    pub answer: oneshot::Sender<Vec<Reply>>,
}

/// One thruster; shared by routes and bus.
#[derive(Debug)]
pub struct Thruster {
    /// Name in the configuration.
    pub id: String,
    range: Mutex<SetpointRange>,
    desk: Mutex<Desk>,
    heard: Mutex<Heard>,
    asks: mpsc::SyncSender<Ask>,
    /// Wakes the bus for a request.
    bell: Arc<Bell>,
    events: Arc<Events>,
    /// Held by whoever hands the desk's notes on: they are told in the order in which they were noted.
    telling: Mutex<()>,
    rendered: Mutex<(Rendered, Bytes)>,
    /// The diagnosis or the fit that runs.
    analysis: Mutex<Option<Underway>>,
    /// The calibration that runs, and when it began.
    calibration: Mutex<Option<(CalibrationInfo, Instant)>>,
    trial: Mutex<Trial>,
    /// Held by whoever has the controller run another law.
    law: tokio::sync::Mutex<KeptLaw>,
}

/// What a rendered state was made of: sample, desk, and whether the servo was silent.
type Rendered = (u64, u64, bool);

/// A poisoned lock holds plain data that is still whole: no update here can stop half-way.
pub fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Thruster {
    /// A thruster nobody commands; the receiver belongs to the bus.
    pub fn new(
        id: &str,
        range: SetpointRange,
        mut heard: Heard,
        bell: Arc<Bell>,
        events: Arc<Events>,
    ) -> (Thruster, mpsc::Receiver<Ask>) {
        let (asks, inbox) = mpsc::sync_channel(64);
        // Nobody else keeps the gateway's own fault: the log says that it was not cleared.
        let failed = events.latched(id, Fault::RecordingFailed);
        heard.own_faults |= failed.map_or(0, |_| Fault::RecordingFailed.bit());
        let thruster = Thruster {
            id: id.to_owned(),
            range: Mutex::new(range),
            desk: Mutex::new(Desk::new(id)),
            heard: Mutex::new(heard),
            asks,
            bell,
            events,
            telling: Mutex::default(),
            analysis: Mutex::default(),
            calibration: Mutex::default(),
            trial: Mutex::new(Trial::new(range.thrust_n)),
            law: tokio::sync::Mutex::default(),
            rendered: Mutex::new(((u64::MAX, u64::MAX, false), Bytes::new())),
        };
        (thruster, inbox)
    }

    /// Largest setpoints.
    pub fn range(&self) -> SetpointRange {
        *lock(&self.range)
    }

    /// Another revision of the rig allows other setpoints.
    pub fn set_range(&self, range: SetpointRange) {
        *lock(&self.range) = range;
    }

    /// How the thrust fares under the revision of the rig in force.
    pub fn trial(&self) -> MutexGuard<'_, Trial> {
        lock(&self.trial)
    }

    /// The desk, for the bus and the metrics.
    pub fn desk(&self) -> MutexGuard<'_, Desk> {
        lock(&self.desk)
    }

    /// What was heard last.
    pub fn heard(&self) -> Heard {
        *lock(&self.heard)
    }

    /// The bus heard something.
    pub fn hear(&self, update: impl FnOnce(&mut Heard)) {
        let mut heard = lock(&self.heard);
        update(&mut heard);
        heard.version += 1;
    }

    /// The bus listened for the servo; something came, or nothing.
    pub fn looked(&self, now: Instant, came: bool) {
        lock(&self.heard).looked(now, came);
    }

    /// Are servo and controller heard?
    pub fn ready(&self) -> Result<(), Problem> {
        let away = match self.heard().alive(Instant::now()) {
            (true, true) => return Ok(()),
            (false, true) => "the servo is",
            (true, false) => "the controller is",
            (false, false) => "servo and controller are",
        };
        Err(Problem::new(Kind::NotReady, format!("{away} not heard for thruster {}", self.id))
            .hint("`kort up` restarts a process that died; its log says why it did"))
    }

    /// Arms, at rest. `who` asks, for the event log; `lease` must be the one in force.
    pub async fn arm(&self, who: &str, lease: Option<&str>) -> Result<(), Problem> {
        let now = Instant::now();
        // Without a lease the controller has it disarmed at once.
        self.desk().check(lease, now)?;
        self.ready()?;
        self.not_calibrated()?;
        none_latched(self.heard().faults(now))?;
        if !self.heard().armed(now) {
            self.desk().rest(now, "it was armed anew");
            // The servo arms only under a controller that asks for nothing: one that has not heard yet of a disarming
            // a moment ago is told. Its answer comes behind the command that asks for nothing.
            self.ask(request(RequestKind::Disarm), &[Process::Controller], Kind::Refused).await?;
        }
        self.ask(request(RequestKind::Arm), &[Process::Servo], Kind::Refused).await?;
        self.settle(|heard, now| heard.armed(now)).await;
        self.did(who, lease, EventKind::Armed, "armed");
        Ok(())
    }

    /// Disarms; the controller need not be there.
    pub async fn disarm(&self, who: &str) -> Result<(), Problem> {
        self.stop(&format!("{who} disarmed")).await?;
        self.did(who, None, EventKind::Disarmed, "disarmed");
        Ok(())
    }

    /// The same; who asked tells the event log.
    pub async fn stop(&self, why: &str) -> Result<(), Problem> {
        self.desk().rest(Instant::now(), why);
        self.ask(request(RequestKind::Disarm), &[Process::Servo], Kind::Refused).await?;
        self.settle(|heard, now| !heard.armed(now)).await;
        self.desk().rest(Instant::now(), why);
        Ok(())
    }

    /// Clears latched faults.
    pub async fn clear_faults(&self, who: &str, lease: Option<&str>) -> Result<(), Problem> {
        self.desk().may(lease, Instant::now())?;
        self.ready()?;
        let heard = self.heard();
        let before = heard.faults(Instant::now()) | heard.own_faults;
        self.ask(
            request(RequestKind::ClearFaults),
            &[Process::Servo, Process::Controller],
            Kind::FaultLatched,
        )
        .await?;
        self.settle(|heard, now| heard.faults(now) == 0).await;
        self.hear(|heard| heard.own_faults = 0);
        match before {
            0 => self.desk().done(lease, Instant::now()),
            before => self.did(who, lease, EventKind::FaultsCleared, &format!("cleared {}", Names(before))),
        }
        Ok(())
    }

    /// The thruster's state, rendered at most once for each sample heard.
    pub fn state_json(&self) -> Bytes {
        let now = Instant::now();
        let heard = self.heard_version();
        let mut rendered = lock(&self.rendered);
        let key = {
            let mut desk = self.desk();
            desk.expire(now);
            (heard, desk.version(), self.heard().servo_silent(now))
        };
        if rendered.0 != key {
            *rendered = (key, serde_json::to_vec(&self.state(now)).unwrap_or_default().into());
        }
        rendered.1.clone()
    }

    fn heard_version(&self) -> u64 {
        lock(&self.heard).version
    }

    fn state(&self, now: Instant) -> ThrusterState {
        let heard = self.heard();
        let (telemetry, controller) = (heard.telemetry(now), heard.controller(now));
        let signals = telemetry.map(|t| t.signals).unwrap_or_default();
        let desk = self.desk();
        ThrusterState {
            id: self.id.clone(),
            armed: heard.shown_armed(now),
            controller: controller.map(|c| c.law.as_str().to_owned()),
            observer: controller.map(|c| c.observer.as_str().to_owned()).filter(|name| !name.is_empty()),
            estimator: controller.map(|c| c.estimator.as_str().to_owned()).filter(|name| !name.is_empty()),
            rig_revision: controller.map(|c| kort_proto::revision::name(c.rig_revision)),
            estimator_frozen: controller.is_some_and(|c| c.estimator_frozen != 0),
            setpoint: desk.setpoint().unwrap_or(Setpoint::ThrustN(0.0)),
            range: self.range(),
            commanded: Values::of_signals(SignalKind::Command, &signals),
            measured: Values::of_signals(SignalKind::Measured, &signals),
            estimated: Estimated {
                values: Values::of_estimates(&controller.map(|c| c.estimates).unwrap_or_default()),
                parameters: controller.map(estimates).unwrap_or_default(),
            },
            mismatch: controller.map(MismatchView::of),
            diagnosis: self.analysis(AnalysisKind::Diagnosis, now),
            fit: self.analysis(AnalysisKind::Fit, now),
            calibration: self.calibration(now),
            revision_trial: self.trial().view(),
            excitation: desk.playing().map(|playing| ExcitationStep {
                name: playing.signal.name.clone(),
                elapsed_s: playing.elapsed_s(now),
                duration_s: playing.signal.duration_s,
            }),
            faults: Fault::in_set(heard.shown_faults(now))
                .map(|fault| self.fault_view(fault, &heard, now))
                .collect(),
            limits: Limit::in_set(heard.limits(now))
                .map(|limit| LimitView {
                    name: limit.name(),
                    meaning: limit.meaning(),
                    setting: limit.setting(),
                })
                .collect(),
            lease: desk.lease.current(now).map(|lease| LeaseView {
                holder: lease.holder.clone(),
                expires_in_ms: lease.expires_in_ms(now),
            }),
            time_s: heard.servo.map_or(0.0, |(_, t)| t.time_ns as f64 * 1e-9),
            age_s: heard.servo.map(|(at, _)| now.saturating_duration_since(at).as_secs_f64()),
        }
    }

    /// Sends a request and waits for everybody's answer.
    async fn ask(&self, request: Request, expects: &[Process], refused: Kind) -> Result<(), Problem> {
        self.ask_within(request, expects, refused, ANSWER_WITHIN).await
    }

    /// As [`Self::ask`], for what may take its time.
    pub async fn ask_within(
        &self,
        request: Request,
        expects: &[Process],
        refused: Kind,
        within: Duration,
    ) -> Result<(), Problem> {
        let (answer, answers) = oneshot::channel();
        let ask = Ask { request, expects: expects.to_vec(), within, answer };
        if self.asks.try_send(ask).is_err() {
            let detail =
                "as many requests as this thruster takes at once wait already; this one was not sent";
            return Err(Problem::new(Kind::Overloaded, detail).hint("ask again in a second"));
        }
        self.bell.ring();
        let Ok(replies) = answers.await else {
            let detail = "there is no way to servo and controller: their shared memory is not open";
            return Err(Problem::new(Kind::NotReady, detail).hint("`kort up` opens it; its log says why not"));
        };
        if let Some(reply) = replies.iter().find(|reply| reply.outcome != Outcome::Done as u32) {
            let kind = if reply.outcome == Outcome::Invalid as u32 { Kind::InvalidField } else { refused };
            let (detail, hint) = match reply.message.as_str().split_once("hint:") {
                Some((detail, hint)) => (detail.trim().to_owned(), Some(hint.trim().to_owned())),
                None => (reply.message.as_str().to_owned(), None),
            };
            let problem = Problem::new(kind, detail);
            return Err(match hint {
                Some(hint) => problem.hint(hint),
                None => problem,
            });
        }
        match expects.iter().find(|process| !replies.iter().any(|reply| reply.from == **process as u32)) {
            None => Ok(()),
            Some(silent) => Err(Problem::new(
                Kind::NotReady,
                format!("the {} did not answer within {} ms", silent.name(), within.as_millis()),
            )
            .hint("GET /readyz says whether it is there")),
        }
    }

    /// Waits a moment until what was done shows in the state too.
    pub async fn settle(&self, done: impl Fn(&Heard, Instant) -> bool) {
        for _ in 0..100 {
            if done(&self.heard(), Instant::now()) {
                return;
            }
            tokio::time::sleep(Duration::from_millis(2)).await;
        }
    }
}

fn request(kind: RequestKind) -> Request {
    Request { kind: kind as u32, ..Request::default() }
}

/// Refuses while faults are latched, and names them all: the lowest code need not be the cause.
fn none_latched(faults: u64) -> Result<(), Problem> {
    let latched: Vec<String> = Fault::in_set(faults)
        .map(|fault| format!("fault {} {} is latched: {}", fault.code(), fault.name(), fault.help()))
        .collect();
    if latched.is_empty() {
        return Ok(());
    }
    let hint = "POST …/clear-faults once the cause is gone, then …/arm";
    Err(Problem::new(Kind::FaultLatched, latched.join("; ")).hint(hint))
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

/// What an estimator tells of its parameters.
pub fn estimates(state: &ControllerState) -> Vec<ParameterEstimate> {
    (state.parameters.iter().take(state.parameter_count as usize))
        .map(|p| ParameterEstimate {
            name: p.name.as_str().to_owned(),
            value: finite(p.value),
            unit: p.unit.as_str().to_owned(),
            std_error: finite(p.std_error),
        })
        .collect()
}
