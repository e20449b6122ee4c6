//! What the gateway asks of one thruster: the lease, and the setpoint its holder gave.
//!
//! Pure: the caller hands in the time and what is known of the thruster.

mod excitation;

use std::time::{Duration, Instant};

use kort_proto::events::EventKind;

use crate::excitation::Playing;
use crate::lease::{By, Lease, LeaseDesk, Wanted};
use crate::problem::{Kind, Problem};
use crate::view::{Setpoint, SetpointRange};

/// A setpoint that moves is noted this often, of each that gives one.
const NOTE_EVERY: Duration = Duration::from_secs(1);

/// Something for the event log.
#[derive(Clone, Debug, PartialEq)]
pub struct Note {
    /// What happened.
    pub kind: EventKind,
    /// Who did it.
    pub who: String,
    /// What exactly.
    pub detail: String,
}

/// What was noted of the setpoints since the thruster rested.
#[derive(Debug, Default)]
struct Noted {
    /// The newest, and who gave it.
    newest: Option<(String, Setpoint)>,
    /// When each that gave one was noted last; as many as there are tokens at most.
    last: Vec<(String, Instant)>,
}

/// Lease and setpoint of one thruster.
#[derive(Debug)]
pub struct Desk {
    thruster: String,
    /// Who may command.
    pub lease: LeaseDesk,
    setpoint: Option<Setpoint>,
    /// Who gave it.
    by: By,
    given: Option<Instant>,
    generation: u64,
    accepted: u64,
    version: u64,
    notes: Vec<Note>,
    noted: Noted,
    /// The test signal that plays, or the last one.
    excitation: Option<Playing>,
}

impl Desk {
    /// Nobody commands, at rest.
    pub fn new(thruster: &str) -> Desk {
        Desk {
            thruster: thruster.to_owned(),
            lease: LeaseDesk::default(),
            setpoint: None,
            by: By::default(),
            given: None,
            generation: 0,
            accepted: 0,
            version: 0,
            notes: Vec::new(),
            noted: Noted::default(),
            excitation: None,
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

    /// Takes command: at rest, whoever had it before.
    pub fn take(&mut self, wanted: &Wanted, now: Instant) -> Result<Lease, Problem> {
        self.expire(now);
        let (lease, before) = self.lease.take(&self.thruster, wanted, now)?;
        self.version += 1;
        let who = lease.who();
        // Whichever way the lease before ended, nothing of it is left for this one.
        self.rest(now, &format!("{who} took command"));
        match before {
            None => {
                self.note(EventKind::LeaseTaken, &who, format!("{who} took command for {} ms", wanted.ttl_ms))
            }
            Some(from) => {
                self.note(EventKind::LeaseTakenOver, &who, format!("{who} took command from {from}"));
            }
        }
        Ok(lease)
    }

    /// Is this the lease in force? One whose time is over ends first, with its setpoint.
    pub fn check(&mut self, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        self.expire(now);
        self.lease.check(&self.thruster, id, now)
    }

    /// Renews the lease.
    pub fn renew(&mut self, id: Option<&str>, now: Instant) -> Result<Lease, Problem> {
        self.expire(now);
        self.version += 1;
        self.lease.renew(&self.thruster, id, now)
    }

    /// Gives command up: at rest. `token` is what it was asked with, here and below.
    pub fn give(&mut self, token: &str, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        self.expire(now);
        let By { who, words } = self.lease.by(token, id);
        self.lease.give(&self.thruster, id, now)?;
        self.version += 1;
        self.rest(now, "command was given up");
        self.note(EventKind::LeaseGivenUp, &who, format!("{words} gave command up"));
        Ok(())
    }

    /// Accepts a setpoint under the lease and renews it.
    pub fn command(
        &mut self,
        token: &str,
        id: Option<&str>,
        setpoint: Setpoint,
        now: Instant,
    ) -> Result<Lease, Problem> {
        let lease = self.renew(id, now)?;
        self.by = self.lease.by(token, id);
        self.end_excitation(now, Some(&format!("{} gave a setpoint", self.by.words)));
        self.setpoint = Some(setpoint);
        self.given = Some(now);
        self.generation += 1;
        self.accepted += 1;
        self.note_setpoint(now);
        Ok(lease)
    }

    /// Back to rest: disarmed, or nobody commands any more; `why` is told of a test signal that this ends.
    pub fn rest(&mut self, now: Instant, why: &str) {
        self.end_excitation(now, Some(why));
        if self.setpoint.take().is_some() {
            self.generation += 1;
            self.version += 1;
            self.noted = Noted::default();
        }
    }

    /// May this request change anything? It needs the lease while somebody holds one, and renews nothing: it may
    /// still be refused. Without a lease in force anybody may, unless an old one is shown.
    pub fn may(&mut self, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        self.expire(now);
        if self.lease.current(now).is_none() && id.is_none() {
            return Ok(());
        }
        self.check(id, now)
    }

    /// A change was made by the lease's holder: it lives on.
    pub fn done(&mut self, id: Option<&str>, now: Instant) {
        if id.is_some() {
            let _ = self.renew(id, now);
        }
    }

    /// Ends a lease whose time is over, and with it its setpoint; notes a setpoint that has come to rest.
    pub fn expire(&mut self, now: Instant) {
        let holder = self.lease.holder();
        if self.lease.expire(now) {
            self.version += 1;
            self.rest(now, "the lease ran out");
            let who = holder.unwrap_or_default();
            self.note(EventKind::LeaseExpired, &who, format!("the lease of {who} ran out"));
        }
        self.note_setpoint(now);
    }

    /// Ends a lease whose token was revoked, or may only read now, as one whose time is over.
    pub fn revoke(&mut self, may_command: impl Fn(&str) -> bool, now: Instant) {
        if let Some(who) = self.lease.revoke(may_command) {
            self.version += 1;
            self.rest(now, "the token of its lease was revoked");
            let words = format!("the lease of {who} ended: its token was revoked, or may command no more");
            self.note(EventKind::LeaseExpired, &who, words);
        }
    }

    /// Notes something for the event log.
    pub fn note(&mut self, kind: EventKind, who: &str, detail: impl Into<String>) {
        self.notes.push(Note { kind, who: who.to_owned(), detail: detail.into() });
    }

    /// What was noted since the last call.
    pub fn notes(&mut self) -> Vec<Note> {
        std::mem::take(&mut self.notes)
    }

    /// Notes the setpoint if it changed or another gave it, of each at most once a second; the last one is noted in the end.
    fn note_setpoint(&mut self, now: Instant) {
        let Some(setpoint) = self.setpoint.filter(|_| self.playing().is_none()) else { return };
        let By { who, words } = self.by.clone();
        if self.noted.newest.as_ref().is_some_and(|(by, known)| *by == who && *known == setpoint) {
            return;
        }
        let last = self.noted.last.iter().find(|(by, _)| *by == who).map(|(_, at)| *at);
        if last.is_none_or(|at| now.saturating_duration_since(at) >= NOTE_EVERY) {
            self.noted(now, setpoint);
            let asked = match setpoint {
                Setpoint::ThrustN(value) => format!("thrust_n = {value}"),
                Setpoint::SpeedRadS(value) => format!("speed_rad_s = {value}"),
            };
            self.note(EventKind::Commanded, &who, format!("{words} commands {asked}"));
        }
    }

    /// This setpoint of who gave the last one need not be noted any more.
    fn noted(&mut self, now: Instant, setpoint: Setpoint) {
        let who = &self.by.who;
        self.noted.newest = Some((who.clone(), setpoint));
        self.noted.last.retain(|(by, _)| by != who);
        self.noted.last.push((who.clone(), now));
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

    fn wants(holder: &str) -> Wanted<'_> {
        Wanted { holder, token: "local", ttl_ms: 500, takeover: false }
    }

    #[test]
    fn a_refused_command_renews_nothing_and_a_moving_setpoint_is_noted_once_a_second() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let ms = |n: u64| t0 + Duration::from_millis(n);
        let lease = desk.take(&wants("bench"), t0).unwrap();
        assert!(desk.may(Some(&lease.id), ms(400)).is_ok());
        desk.expire(ms(500));
        assert!(desk.lease.current(ms(500)).is_none(), "asking renews nothing");
        let lease = desk.take(&Wanted { ttl_ms: 60_000, ..wants("bench") }, ms(500)).unwrap();
        desk.notes();
        for n in 0..250 {
            let now = ms(500 + 10 * n);
            desk.command("local", Some(&lease.id), Setpoint::ThrustN(n as f64), now).unwrap();
        }
        desk.expire(ms(5000));
        let noted: Vec<String> = desk.notes().into_iter().map(|note| note.detail).collect();
        assert_eq!(noted.len(), 4, "{noted:?}");
        assert!(noted[3].contains("thrust_n = 249"), "the last one is noted: {noted:?}");
    }

    /// A lease's id is no name: who shows somebody else's is told by the token that it was shown with, at once, and not as
    /// the holder; the holder is told beside it.
    #[test]
    fn who_commands_under_the_lease_of_another_is_told_by_name() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let ms = |n: u64| t0 + Duration::from_millis(n);
        let lease = desk.take(&Wanted { token: "chief", ttl_ms: 60_000, ..wants("bridge") }, t0).unwrap();
        desk.notes();
        for n in 0..100 {
            for token in ["chief", "mate"] {
                desk.command(token, Some(&lease.id), Setpoint::ThrustN(5.0), ms(10 * n)).unwrap();
            }
        }
        let of = |note: Note| (note.who, note.detail);
        let told: Vec<_> = desk.notes().into_iter().map(of).collect();
        let mate =
            ("mate".to_owned(), "mate under the lease of bridge (chief) commands thrust_n = 5".to_owned());
        let chief = ("bridge (chief)".to_owned(), "bridge (chief) commands thrust_n = 5".to_owned());
        assert_eq!(told, [chief, mate], "each once in a second");
        desk.give("mate", Some(&lease.id), ms(2000)).unwrap();
        let gave = desk.notes().into_iter().map(of).next_back().unwrap();
        let words = "mate under the lease of bridge (chief) gave command up";
        assert_eq!(gave, ("mate".to_owned(), words.to_owned()));
    }

    #[test]
    fn who_takes_over_starts_at_rest() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let lease = desk.take(&wants("crashed"), t0).unwrap();
        desk.command("local", Some(&lease.id), Setpoint::ThrustN(25.0), t0).unwrap();
        desk.take(&Wanted { takeover: true, ..wants("bridge") }, t0).unwrap();
        assert_eq!(desk.setpoint(), None);
        let last = desk.notes().pop().unwrap();
        assert_eq!(
            (last.kind, last.detail.as_str()),
            (EventKind::LeaseTakenOver, "bridge took command from crashed")
        );
    }

    const RANGE: SetpointRange = SetpointRange { thrust_n: 200.0, speed_rad_s: 120.0 };

    /// Whoever looks first after its end, the bus or a command: the old setpoint must not wait for the next lease.
    #[test]
    fn a_command_that_comes_too_late_ends_the_setpoint_too() {
        type Late = fn(&mut Desk, &str, Instant);
        let late: [Late; 4] = [
            |desk, id, t| drop(desk.check(Some(id), t).unwrap_err()),
            |desk, id, t| drop(desk.renew(Some(id), t).unwrap_err()),
            |desk, id, t| drop(desk.give("local", Some(id), t).unwrap_err()),
            |desk, id, t| drop(desk.command("local", Some(id), Setpoint::ThrustN(30.0), t).unwrap_err()),
        ];
        for late in late {
            let (mut desk, t0) = (Desk::new("t1"), Instant::now());
            let lease = desk.take(&wants("bench"), t0).unwrap();
            desk.command("local", Some(&lease.id), Setpoint::ThrustN(25.0), t0).unwrap();
            late(&mut desk, &lease.id, t0 + Duration::from_millis(500));
            assert_eq!(desk.setpoint(), None);
            assert!(desk.notes().iter().any(|note| note.kind == EventKind::LeaseExpired));
        }
    }

    #[test]
    fn a_setpoint_ends_with_its_lease() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let lease = desk.take(&wants("bench"), t0).unwrap();
        desk.command("local", Some(&lease.id), Setpoint::ThrustN(25.0), t0).unwrap();
        assert_eq!((desk.setpoint(), desk.accepted()), (Some(Setpoint::ThrustN(25.0)), 1));
        desk.expire(t0 + Duration::from_millis(499));
        assert_eq!(desk.setpoint(), Some(Setpoint::ThrustN(25.0)));
        desk.expire(t0 + Duration::from_millis(500));
        assert_eq!((desk.setpoint(), desk.generation()), (None, 2));
        let next = desk.take(&wants("other"), t0 + Duration::from_millis(600)).unwrap();
        assert_ne!(next.id, lease.id);
        assert_eq!(desk.setpoint(), None, "a new holder starts at rest");
    }

    /// The state is rendered once a version: nothing may change without a new one.
    #[test]
    fn a_lease_given_up_at_rest_shows_at_once() {
        let (mut desk, t0) = (Desk::new("t1"), Instant::now());
        let lease = desk.take(&wants("bench"), t0).unwrap();
        let before = desk.version();
        desk.give("local", Some(&lease.id), t0).unwrap();
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
