//! What the metrics say of one thruster beyond its latest values: windows of fast signals and counters.

use std::sync::Mutex;

use kort_proto::faults::Fault;
use kort_proto::messages::{ControllerState, Telemetry, Timing};
use kort_proto::signals::{ESTIMATES, Kind, SIGNALS};

use crate::energy::{Energy, Motor};
use crate::thruster::lock;
use crate::windows::{Summary, Window};

/// Length of a window, ns: a scrape each second sees every extreme.
const WINDOW_NS: u64 = 1_000_000_000;

/// Written by the bus, read at each scrape.
#[derive(Debug)]
pub struct Tally(Mutex<Counts>);

/// The figures behind a [`Tally`].
#[derive(Clone, Debug)]
pub struct Counts {
    signals: Vec<Window>,
    estimates: Vec<Window>,
    servo_faults: u64,
    controller_faults: u64,
    own_faults: u64,
    /// Times each fault was raised, in the order of [`Fault::ALL`].
    pub faults_raised: Vec<u64>,
    /// Telemetry samples read, and samples missed because the gateway came too late.
    pub telemetry: (u64, u64),
    /// The gateway's own loop.
    pub gateway: Timing,
    /// Power and energy of the motor.
    pub energy: Energy,
}

impl Tally {
    /// Nothing counted yet; of the motor nothing is known.
    pub fn new() -> Tally {
        Tally(Mutex::new(Counts {
            signals: vec![Window::new(WINDOW_NS); SIGNALS.len()],
            estimates: vec![Window::new(WINDOW_NS); ESTIMATES.len()],
            servo_faults: 0,
            controller_faults: 0,
            own_faults: 0,
            faults_raised: vec![0; Fault::ALL.len()],
            telemetry: (0, 0),
            gateway: Timing::default(),
            energy: Energy::new(Motor::UNKNOWN),
        }))
    }

    /// What samples show is turned into power with this motor from now on: that of the rig in force.
    pub fn set_motor(&self, motor: Motor) {
        lock(&self.0).energy.set_motor(motor);
    }

    /// One more sample of the servo, `lost` samples after the one before.
    pub fn telemetry(&self, telemetry: &Telemetry, lost: u64) {
        let counts = &mut *lock(&self.0);
        for (window, row) in counts.signals.iter_mut().zip(SIGNALS) {
            window.add(telemetry.time_ns, (row.get)(&telemetry.signals));
        }
        counts.energy.add(telemetry.time_ns, &telemetry.signals);
        counts.telemetry.0 += 1;
        counts.telemetry.1 += lost;
        let before = std::mem::replace(&mut counts.servo_faults, telemetry.faults);
        counts.raised(telemetry.faults & !before);
    }

    /// A newer state of the controller.
    pub fn controller(&self, state: &ControllerState) {
        let counts = &mut *lock(&self.0);
        for (window, row) in counts.estimates.iter_mut().zip(ESTIMATES) {
            window.add(state.header.stamp_ns, (row.get)(&state.estimates));
        }
        let before = std::mem::replace(&mut counts.controller_faults, state.faults);
        counts.raised(state.faults & !before);
    }

    /// How the gateway's loop keeps time, and the gateway's own faults, as a bitset.
    pub fn gateway(&self, timing: &Timing, faults: u64) {
        let counts = &mut *lock(&self.0);
        counts.gateway = *timing;
        let before = std::mem::replace(&mut counts.own_faults, faults);
        counts.raised(faults & !before);
    }

    /// The figures now.
    pub fn counts(&self) -> Counts {
        lock(&self.0).clone()
    }
}

impl Counts {
    fn raised(&mut self, set: u64) {
        for (count, fault) in self.faults_raised.iter_mut().zip(Fault::ALL) {
            *count += u64::from(set & fault.bit() != 0);
        }
    }

    /// Kind, metric name, meaning and last window of every signal and estimate.
    pub fn windows(&self) -> impl Iterator<Item = (Kind, &'static str, &'static str, Option<Summary>)> {
        let signals = SIGNALS
            .iter()
            .zip(&self.signals)
            .map(|(row, w)| (row.kind, row.metric, row.meaning, w.complete()));
        let estimates = ESTIMATES
            .iter()
            .zip(&self.estimates)
            .map(|(row, w)| (row.kind, row.metric, row.meaning, w.complete()));
        signals.chain(estimates)
    }
}
