//! A calibration holds the thruster: who may begin one, and what nobody may meanwhile.

use std::time::Instant;

use super::{Thruster, lock, none_latched};
use crate::calibration::{CalibrationInfo, CalibrationStep};
use crate::problem::{Kind, Problem};

impl Thruster {
    /// A calibration of it has come so far, or is over.
    pub fn set_calibration(&self, at: Option<(CalibrationInfo, Instant)>) {
        *lock(&self.calibration) = at;
    }

    /// How far the calibration is, if one runs.
    pub fn calibration(&self, now: Instant) -> Option<CalibrationStep> {
        lock(&self.calibration).as_ref().map(|(info, began)| CalibrationStep {
            id: info.id.clone(),
            stage: info.stage.clone().unwrap_or_else(|| "starting".into()),
            asks: info.asks.clone(),
            drives: info.drives,
            elapsed_s: now.saturating_duration_since(*began).as_secs_f64(),
        })
    }

    /// Refuses what a calibration that holds the thruster does not bear beside it.
    pub fn not_calibrated(&self) -> Result<(), Problem> {
        match &*lock(&self.calibration) {
            Some((info, _)) if info.drives => Err(Problem::new(
                Kind::CalibrationActive,
                format!("thruster {} is held by calibration {}", self.id, info.id),
            )
            .hint("POST …/disarm or DELETE …/calibrations/{calibration} ends it at once")),
            _ => Ok(()),
        }
    }

    /// Refuses whoever does not hold the lease in force.
    pub fn holds(&self, lease: Option<&str>) -> Result<(), Problem> {
        self.desk().check(lease, Instant::now())
    }

    /// May this lease's holder calibrate now? At rest, disarmed, without a fault. Returns the lease.
    pub fn may_calibrate(&self, lease: Option<&str>) -> Result<String, Problem> {
        self.holds(lease)?;
        self.ready()?;
        let now = Instant::now();
        none_latched(self.heard().faults(now))?;
        self.not_calibrated()?;
        if self.heard().armed(now) {
            let words = format!("thruster {} is armed; a calibration begins at rest", self.id);
            return Err(Problem::new(Kind::Refused, words).hint("POST …/disarm first"));
        }
        self.desk().done(lease, now);
        Ok(lease.unwrap_or_default().to_owned())
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;
    use std::time::Duration;

    use kort_proto::events::EventKind;

    use super::*;
    use crate::events::Events;
    use crate::heard::Heard;
    use crate::lease::Wanted;
    use crate::record::Recorder;
    use crate::settings::RecordingLimits;
    use crate::view::{Setpoint, SetpointRange};

    /// A calibration looks every 20 ms: it may be the first to find that the lease is over.
    #[test]
    fn a_calibration_that_finds_its_lease_over_ends_what_the_lease_began() {
        let folder = tempfile::tempdir().unwrap();
        let recorder = Recorder::open(&folder.path().join("recordings"), RecordingLimits::default()).unwrap();
        let events = Events::start(&folder.path().join("events"), Arc::new(recorder)).unwrap();
        let range = SetpointRange { thrust_n: 200.0, speed_rad_s: 120.0 };
        let (thruster, _asks) = Thruster::new("t1", range, Heard::default(), Arc::default(), events);
        let wanted = Wanted { holder: "bench", token: "local", ttl_ms: 20, takeover: false };
        let lease = thruster.desk().take(&wanted, Instant::now()).unwrap();
        let id = Some(lease.id.as_str());
        thruster.desk().command("local", id, Setpoint::ThrustN(25.0), Instant::now()).unwrap();
        let before = thruster.desk().version();
        std::thread::sleep(Duration::from_millis(40));
        assert!(thruster.holds(id).unwrap_err().is(Kind::LeaseLost));
        let mut desk = thruster.desk();
        assert_eq!(desk.setpoint(), None);
        assert_ne!(desk.version(), before);
        assert!(desk.notes().iter().any(|note| note.kind == EventKind::LeaseExpired));
    }
}
