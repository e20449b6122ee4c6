//! What a lease's holder commands: setpoints and test signals.

use std::sync::Arc;
use std::time::Instant;

use kort_proto::faults::Fault;

use super::{Thruster, latched};
use crate::desk::{Desk, check_range};
use crate::excitation::Prepared;
use crate::lease::Lease;
use crate::problem::{Kind, Problem};
use crate::view::Setpoint;

impl Thruster {
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
        desk.lease.check(&self.id, lease, now)?;
        self.ready()?;
        self.not_calibrated()?;
        if let Some(fault) = Fault::in_set(heard.faults(now)).next() {
            return Err(latched(fault));
        }
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
        desk.end_excitation_at_zero(now, Some(&format!("{who} ended it")));
        desk.done(lease, now);
        Ok(())
    }
}
