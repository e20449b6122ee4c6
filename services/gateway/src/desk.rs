//! What the gateway asks of one thruster: the lease, and the setpoint its holder gave.
//!
//! Pure: the caller hands in the time and what is known of the thruster.

use std::time::Instant;

use crate::lease::{Lease, LeaseDesk};
use crate::problem::{Kind, Problem};
use crate::view::{Setpoint, SetpointRange};

/// Lease and setpoint of one thruster.
#[derive(Debug)]
pub struct Desk {
    thruster: String,
    /// Who may command.
    pub lease: LeaseDesk,
    setpoint: Option<Setpoint>,
    given: Option<Instant>,
    generation: u64,
    accepted: u64,
    version: u64,
}

impl Desk {
    /// Nobody commands, at rest.
    pub fn new(thruster: &str) -> Desk {
        Desk {
            thruster: thruster.to_owned(),
            lease: LeaseDesk::default(),
            setpoint: None,
            given: None,
            generation: 0,
            accepted: 0,
            version: 0,
        }
    }

    /// Setpoint in force; none while nobody commands.
    pub fn setpoint(&self) -> Option<Setpoint> {
        self.setpoint
    }

    /// When the last command was accepted.
    pub fn given(&self) -> Option<Instant> {
        self.given
    }

    /// Grows with every command and every end of one: the controller acts only on a growing number.
    pub fn generation(&self) -> u64 {
        self.generation
    }

    /// Commands accepted so far.
    pub fn accepted(&self) -> u64 {
        self.accepted
    }

    /// Changes whenever anything here does.
    pub fn version(&self) -> u64 {
        self.version
    }

    /// Takes command.
    pub fn take(&mut self, holder: &str, ttl_ms: u64, now: Instant) -> Result<Lease, Problem> {
        self.expire(now);
        self.version += 1;
        self.lease.take(&self.thruster, holder, ttl_ms, now)
    }

    /// Renews the lease.
    pub fn renew(&mut self, id: Option<&str>, now: Instant) -> Result<Lease, Problem> {
        self.version += 1;
        self.lease.renew(&self.thruster, id, now)
    }

    /// Gives command up: at rest.
    pub fn give(&mut self, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        self.lease.give(&self.thruster, id, now)?;
        self.version += 1;
        self.rest();
        Ok(())
    }

    /// Accepts a setpoint from the lease's holder and renews the lease.
    pub fn command(&mut self, id: Option<&str>, setpoint: Setpoint, now: Instant) -> Result<Lease, Problem> {
        let lease = self.renew(id, now)?;
        self.setpoint = Some(setpoint);
        self.given = Some(now);
        self.generation += 1;
        self.accepted += 1;
        Ok(lease)
    }

    /// Back to rest: disarmed, or nobody commands any more.
    pub fn rest(&mut self) {
        if self.setpoint.take().is_some() {
            self.generation += 1;
            self.version += 1;
        }
    }

    /// A request that may come without the lease, but not against it; with it, it renews it.
    pub fn may(&mut self, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        id.map_or(Ok(()), |id| self.renew(Some(id), now).map(drop))
    }

    /// Ends a lease whose time is over, and with it its setpoint.
    pub fn expire(&mut self, now: Instant) {
        if self.lease.expire(now) {
            self.version += 1;
            self.rest();
        }
    }
}

/// Refuses what is not a number or beyond the thruster's range.
pub fn check_range(setpoint: Setpoint, range: SetpointRange) -> Result<(), Problem> {
    let (field, value, bound, unit, source) = match setpoint {
        Setpoint::ThrustN(value) => {
            ("thrust_n", value, range.thrust_n, "N", "what the rig gives in bollard pull at full drive")
        }
        Setpoint::SpeedRadS(value) => {
            let source = "what the rig reaches at full drive, or limits.speed_rad_s of the configuration";
            ("speed_rad_s", value, range.speed_rad_s, "rad/s", source)
        }
    };
    if value.is_finite() && value.abs() <= bound {
        return Ok(());
    }
    Err(Problem::new(
        Kind::OutOfRange,
        format!("{field} = {value} is outside {:?} to {bound:?} {unit}", -bound),
    )
    .hint(format!("the bound is {source}; GET /v1/thrusters shows it as range.{field}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::time::Duration;

    const RANGE: SetpointRange = SetpointRange { thrust_n: 200.0, speed_rad_s: 120.0 };

    #[test]
    fn a_setpoint_ends_with_its_lease() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let lease = desk.take("bench", 500, t0).unwrap();
        desk.command(Some(&lease.id), Setpoint::ThrustN(25.0), t0).unwrap();
        assert_eq!((desk.setpoint(), desk.accepted()), (Some(Setpoint::ThrustN(25.0)), 1));
        desk.expire(t0 + Duration::from_millis(499));
        assert_eq!(desk.setpoint(), Some(Setpoint::ThrustN(25.0)));
        desk.expire(t0 + Duration::from_millis(500));
        assert_eq!((desk.setpoint(), desk.generation()), (None, 2));
        let next = desk.take("other", 500, t0 + Duration::from_millis(600)).unwrap();
        assert_ne!(next.id, lease.id);
        assert_eq!(desk.setpoint(), None, "a new holder starts at rest");
    }

    /// The state is rendered once a version: nothing may change without a new one.
    #[test]
    fn a_lease_given_up_at_rest_shows_at_once() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let lease = desk.take("bench", 500, t0).unwrap();
        let before = desk.version();
        desk.give(Some(&lease.id), t0).unwrap();
        assert_ne!(desk.version(), before);
    }

    #[test]
    fn what_is_not_a_number_names_the_allowed_range() {
        for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 200.1, -1e300] {
            let problem = check_range(Setpoint::ThrustN(value), RANGE).unwrap_err();
            assert!(serde_json::to_string(&problem).unwrap().contains("-200.0 to 200.0 N"), "{problem:?}");
        }
    }

    proptest! {
        #[test]
        fn only_finite_values_in_range_pass(value in prop::num::f64::ANY, thrust: bool) {
            let (setpoint, bound) = if thrust { (Setpoint::ThrustN(value), 200.0) } else { (Setpoint::SpeedRadS(value), 120.0) };
            prop_assert_eq!(check_range(setpoint, RANGE).is_ok(), value.abs() <= bound);
        }
    }
}
