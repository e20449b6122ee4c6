//! A test signal in the place of the setpoint.

use std::sync::Arc;
use std::time::Instant;

use kort_proto::events::EventKind;

use super::Desk;
use crate::excitation::{Ended, Playing, Prepared};
use crate::lease::By;
use crate::problem::{Kind, Problem};

impl Desk {
    /// Begins a test signal under the lease, in place of the setpoint. Returns its number.
    pub fn excite(
        &mut self,
        token: &str,
        id: Option<&str>,
        signal: Arc<Prepared>,
        recording: Option<String>,
        now: Instant,
    ) -> Result<u64, Problem> {
        self.check(id, now)?;
        if let Some(playing) = self.playing() {
            let words = format!("{} plays on {} already", playing.signal.name, self.thruster);
            return Err(Problem::new(Kind::ExcitationActive, words).hint("DELETE …/excitation ends it"));
        }
        self.renew(id, now)?;
        self.by = self.lease.by(token, id);
        let By { who, words } = self.by.clone();
        let words = format!("{words} plays {} for {:.1} s", signal.name, signal.duration_s);
        self.note(EventKind::ExcitationStarted, &who, words);
        let number = self.excitation.as_ref().map_or(1, |last| last.number + 1);
        let playing = Playing { number, signal, who, began: now, recording, ended: None, diagnosis: None };
        self.setpoint = playing.setpoint(now);
        self.excitation = Some(playing);
        self.given = Some(now);
        self.generation += 1;
        self.accepted += 1;
        Ok(number)
    }

    /// The test signal goes on to this instant; at its end the setpoint is zero, still under the lease.
    pub fn advance(&mut self, now: Instant) {
        let Some(playing) = self.playing() else { return };
        match playing.setpoint(now) {
            Some(setpoint) if self.setpoint == Some(setpoint) => (),
            Some(setpoint) => {
                self.setpoint = Some(setpoint);
                self.generation += 1;
                self.version += 1;
            }
            None => self.end_excitation_at_zero(now, None),
        }
    }

    /// Ends the test signal that plays: zero setpoint, under the lease. `why` is none for one that is complete.
    pub fn end_excitation_at_zero(&mut self, now: Instant, why: Option<&str>) {
        let Some(zero) = self.playing().map(|playing| playing.signal.commanded.setpoint(0.0)) else { return };
        self.end_excitation(now, why);
        self.setpoint = Some(zero);
        self.noted(now, zero);
        self.generation += 1;
    }

    /// The test signal that plays is over, whatever comes in its place; it is never taken up again.
    pub fn end_excitation(&mut self, now: Instant, why: Option<&str>) {
        let Some(playing) = self.excitation.as_mut().filter(|playing| playing.ended.is_none()) else {
            return;
        };
        let after = now.saturating_duration_since(playing.began);
        playing.ended = Some(Ended { after, why: why.map(str::to_owned) });
        let (name, whole_s) = (playing.signal.name.clone(), playing.signal.duration_s);
        let words = match why {
            None => format!("{name} is complete, {whole_s:.1} s"),
            Some(why) => format!("{name} ended after {:.1} of {whole_s:.1} s: {why}", after.as_secs_f64()),
        };
        let who = playing.who.clone();
        self.version += 1;
        self.note(EventKind::ExcitationEnded, &who, words);
    }

    /// The test signal that plays, or the last one.
    pub fn excitation(&self) -> Option<&Playing> {
        self.excitation.as_ref()
    }

    /// The test signal that plays.
    pub fn playing(&self) -> Option<&Playing> {
        self.excitation.as_ref().filter(|playing| playing.ended.is_none())
    }

    /// A diagnosis was begun of this test signal.
    pub fn diagnosed(&mut self, number: u64, diagnosis: String) {
        if let Some(playing) = self.excitation.as_mut().filter(|playing| playing.number == number) {
            playing.diagnosis = Some(diagnosis);
            self.version += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lease::{Lease, Wanted};
    use crate::view::{Setpoint, SetpointRange};
    use std::time::Duration;

    const RANGE: SetpointRange = SetpointRange { thrust_n: 200.0, speed_rad_s: 120.0 };

    fn wants(holder: &str) -> Wanted<'_> {
        Wanted { holder, token: "local", ttl_ms: 500, takeover: false }
    }

    /// A ramp of 0 to 10 N in 10 s, begun under a lease of a minute.
    fn playing() -> (Desk, Lease, Instant) {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let lease = desk.take(&Wanted { ttl_ms: 60_000, ..wants("bench") }, t0).unwrap();
        let scenario = kort_scenario::Scenario {
            segments: vec![kort_scenario::Segment::Ramp { from: 0.0, to: 10.0, duration_s: 10.0 }],
            command: kort_scenario::Command::ThrustCmdN,
            ..Default::default()
        };
        let signal = Prepared::new(crate::excitation::from_scenario(scenario, None, None), RANGE).unwrap();
        desk.excite("local", Some(&lease.id), Arc::new(signal), None, t0).unwrap();
        (desk, lease, t0)
    }

    #[test]
    fn a_test_signal_is_followed_and_ends_at_zero_under_the_lease() {
        let (mut desk, lease, t0) = playing();
        for ms in [0, 2_500, 2_500, 9_999] {
            let before = desk.generation();
            desk.advance(t0 + Duration::from_millis(ms));
            let thrust_n = ms as f64 / 1000.0;
            assert!(matches!(desk.setpoint(), Some(Setpoint::ThrustN(n)) if (n - thrust_n).abs() < 1e-9));
            desk.advance(t0 + Duration::from_millis(ms));
            assert!(desk.generation() <= before + 1, "the same setpoint is no new command");
        }
        let again = Arc::clone(&desk.playing().unwrap().signal);
        let refused = desk.excite("local", Some(&lease.id), again, None, t0).unwrap_err();
        assert!(refused.is(Kind::ExcitationActive));
        desk.advance(t0 + Duration::from_secs(10));
        assert_eq!((desk.setpoint(), desk.playing().is_none()), (Some(Setpoint::ThrustN(0.0)), true));
        desk.advance(t0 + Duration::from_secs(3));
        assert_eq!(desk.setpoint(), Some(Setpoint::ThrustN(0.0)), "it is never taken up again");
        let told: Vec<EventKind> = desk.notes().into_iter().map(|note| note.kind).collect();
        assert_eq!(told, [EventKind::LeaseTaken, EventKind::ExcitationStarted, EventKind::ExcitationEnded]);
    }

    #[test]
    fn whatever_else_happens_ends_a_test_signal_at_once() {
        type Happens = fn(&mut Desk, &Lease, Instant);
        let happenings: [(Happens, Option<Setpoint>); 6] = [
            (|desk, _, t| desk.rest(t, "x disarmed"), None),
            (|desk, lease, t| desk.give("local", Some(&lease.id), t).unwrap(), None),
            (|desk, _, t| desk.expire(t + Duration::from_secs(60)), None),
            (|desk, _, t| drop(desk.take(&Wanted { takeover: true, ..wants("bridge") }, t).unwrap()), None),
            (
                |desk, lease, t| {
                    drop(desk.command("local", Some(&lease.id), Setpoint::SpeedRadS(3.0), t).unwrap());
                },
                Some(Setpoint::SpeedRadS(3.0)),
            ),
            (|desk, _, t| desk.end_excitation_at_zero(t, Some("x ended it")), Some(Setpoint::ThrustN(0.0))),
        ];
        for (at, (happens, left)) in happenings.into_iter().enumerate() {
            let (mut desk, lease, t0) = playing();
            let then = t0 + Duration::from_secs(4);
            desk.advance(then);
            let generation = desk.generation();
            happens(&mut desk, &lease, then);
            assert_eq!(desk.setpoint(), left, "{at}");
            assert!(desk.generation() > generation, "{at}: the controller is told");
            desk.advance(then + Duration::from_secs(1));
            assert_eq!(desk.setpoint(), left, "{at}: never resumed");
            let ended = desk.excitation().unwrap().ended.clone().unwrap();
            assert!(ended.why.is_some() && ended.after >= Duration::from_secs(4), "{at}: {ended:?}");
        }
    }
}
