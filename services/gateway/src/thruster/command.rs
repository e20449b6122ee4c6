//! The lease, and what its holder commands: setpoints and test signals.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::{Thruster, none_latched};
use crate::desk::{Desk, check_range};
use crate::excitation::Prepared;
use crate::lease::{Lease, Wanted};
use crate::problem::{Kind, Problem};
use crate::view::Setpoint;

/// Within so many heartbeats the controller hears of a lease, and what it asks of the servo then shows here.
const TURNS_TO_HEAR: u32 = 5;

impl Thruster {
    /// Takes command. Where the drive is armed and nobody had it, the ramp of the lease before runs: by the answer its
    /// controller has heard of this one, or the drive shows disarmed, so that what is accepted then is not lost.
    pub async fn take_lease(&self, wanted: &Wanted<'_>) -> Result<(Lease, Instant), Problem> {
        let now = Instant::now();
        let (mut lease, led) = {
            let mut desk = self.desk();
            desk.expire(now);
            let led = desk.lease.current(now).is_some();
            (desk.take(wanted, now)?, led)
        };
        let heard_within = TURNS_TO_HEAR * self.heard().turn;
        while !led && self.heard().armed(Instant::now()) && now.elapsed() < heard_within {
            tokio::time::sleep(Duration::from_millis(2)).await;
            // The wait is none of its life. One that is over all the same, or taken over, was granted: its next word is told.
            let Ok(renewed) = self.desk().renew(Some(&lease.id), Instant::now()) else { break };
            lease = renewed;
        }
        Ok((lease, Instant::now()))
    }

    /// Renews the lease.
    pub fn renew_lease(&self, id: Option<&str>) -> Result<(Lease, Instant), Problem> {
        let now = Instant::now();
        self.desk().renew(id, now).map(|lease| (lease, now))
    }

    /// Gives command up.
    pub fn give_lease(&self, who: &str, id: Option<&str>) -> Result<(), Problem> {
        self.desk().give(who, id, Instant::now())
    }

    /// Puts a setpoint in force. `who` asks, for the event log, here and below.
    pub fn command(
        &self,
        who: &str,
        lease: Option<&str>,
        setpoint: Setpoint,
    ) -> Result<(Lease, Instant), Problem> {
        check_range(setpoint, self.range())?;
        let now = Instant::now();
        let mut desk = self.desk();
        self.may_command(&mut desk, lease, now)?;
        desk.command(who, lease, setpoint, now).map(|lease| (lease, now))
    }

    /// May this lease command now? Under it, armed, without a fault.
    pub fn may_command(&self, desk: &mut Desk, lease: Option<&str>, now: Instant) -> Result<(), Problem> {
        let heard = self.heard();
        desk.check(lease, now)?;
        self.ready()?;
        self.not_calibrated()?;
        none_latched(heard.faults(now))?;
        if !heard.armed(now) {
            return Err(Problem::new(
                Kind::NotArmed,
                format!("thruster {} is disarmed and takes no setpoint", self.id),
            )
            .hint(format!("POST /v1/thrusters/{}/arm first", self.id)));
        }
        Ok(())
    }

    /// Begins a test signal in place of the setpoint; its number.
    pub fn excite(
        &self,
        who: &str,
        lease: Option<&str>,
        signal: Arc<Prepared>,
        recording: Option<String>,
    ) -> Result<u64, Problem> {
        let now = Instant::now();
        let mut desk = self.desk();
        self.may_command(&mut desk, lease, now)?;
        desk.excite(who, lease, signal, recording, now)
    }

    /// Ends the test signal that plays: zero setpoint, still under the lease.
    pub fn end_excitation(&self, who: &str, lease: Option<&str>) -> Result<(), Problem> {
        let now = Instant::now();
        let mut desk = self.desk();
        desk.may(lease, now)?;
        if desk.playing().is_none() {
            return Err(Problem::new(Kind::NoExcitation, format!("no test signal plays on {}", self.id))
                .hint("POST …/excitation begins one"));
        }
        let by = desk.lease.by(who, lease).words;
        desk.end_excitation_at_zero(now, Some(&format!("{by} ended it")));
        desk.done(lease, now);
        Ok(())
    }
}
