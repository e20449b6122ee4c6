//! The servo as shared memory shows it, past the gateway.

use std::time::{Duration, Instant};

use kort_proto::messages::Telemetry;
use kort_proto::transport::{Deployment, GatewayPorts};

use super::{PATIENCE, wait};

/// Reads every telemetry sample of a servo from shared memory.
pub struct Watch {
    deployment: Deployment,
    thruster: &'static str,
    ports: GatewayPorts,
}

impl Watch {
    pub fn new(deployment: &Deployment, thruster: &'static str) -> Self {
        let ports = wait("shared memory", || GatewayPorts::open(deployment, thruster).ok());
        Self { deployment: deployment.clone(), thruster, ports }
    }

    /// Next sample.
    pub fn next(&mut self) -> Telemetry {
        wait("telemetry", || {
            if self.deployment.generation().is_some_and(|g| g != self.ports.generation)
                && let Ok(ports) = GatewayPorts::open(&self.deployment, self.thruster)
            {
                self.ports = ports;
            }
            self.ports.telemetry.next()
        })
    }

    /// First sample for which `done` holds.
    pub fn until(&mut self, what: &str, done: impl Fn(&Telemetry) -> bool) -> Telemetry {
        let end = Instant::now() + PATIENCE;
        loop {
            let t = self.next();
            if done(&t) {
                return t;
            }
            assert!(Instant::now() < end, "waited in vain for: {what}; last {:?}", t.signals);
        }
    }

    /// For a time no sample is armed or driven.
    pub fn stays_at_zero(&mut self, time: Duration) {
        while self.ports.telemetry.next().is_some() {}
        let end = Instant::now() + time;
        while Instant::now() < end {
            let t = self.next();
            assert!(at_zero(&t), "{t:?}");
        }
    }
}

/// Disarmed, and the drive, whatever its kind, is asked for nothing.
pub fn at_zero(t: &Telemetry) -> bool {
    let s = &t.signals;
    let asked = [s.current_cmd_a, s.voltage_cmd_v, s.speed_cmd_rad_s];
    t.armed == 0 && asked.into_iter().find(|c| !c.is_nan()) == Some(0.0)
}
