//! Who may command: one holder at a time, for a bounded time, renewed by every accepted command.
//!
//! Pure: the caller hands in the time, so expiry is tested without waiting.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use crate::problem::{Kind, Problem};

/// Life of a lease when the request names none, ms.
pub const TTL_DEFAULT_MS: u64 = 500;
/// Longest life a lease can be given, ms.
pub const TTL_MAX_MS: u64 = 60_000;
/// Leases of which it is remembered who took them over.
const TOLD_MAX: usize = 16;

/// A lease in force.
#[derive(Clone, Debug)]
pub struct Lease {
    /// Secret of the holder; whoever shows it may command.
    pub id: String,
    /// Name the holder gave itself.
    pub holder: String,
    /// Name of the token it was taken with.
    pub token: String,
    ttl: Duration,
    expires: Instant,
}

impl Lease {
    /// The holder's name, and the token's where it is another.
    pub fn who(&self) -> String {
        if self.token == "local" || self.token == self.holder {
            self.holder.clone()
        } else {
            format!("{} ({})", self.holder, self.token)
        }
    }

    /// Time left, ms; at least 1 while the lease is in force.
    pub fn expires_in_ms(&self, now: Instant) -> u64 {
        (self.expires.saturating_duration_since(now).as_millis() as u64).max(1)
    }
}

/// Who did something, for the event log: whoever's token it was sent with, which need not be the one that the lease was
/// taken with.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct By {
    /// The holder of the lease with its token's name, or the name of another's token.
    pub who: String,
    /// The same, with the holder where that is somebody else.
    pub words: String,
}

/// The lease of one thruster, taken or free.
#[derive(Debug, Default)]
pub struct LeaseDesk {
    lease: Option<Lease>,
    /// The leases that were taken over last, and by whom: each holder is told at its next word or state.
    taken_over: VecDeque<(String, String)>,
    granted: u64,
    expired: u64,
}

impl LeaseDesk {
    /// The lease in force, if any.
    pub fn current(&self, now: Instant) -> Option<&Lease> {
        self.lease.as_ref().filter(|lease| now < lease.expires)
    }

    /// Name of who had or has it, with its token's where that is another.
    pub fn holder(&self) -> Option<String> {
        self.lease.as_ref().map(Lease::who)
    }

    /// Who does something with this token and this lease. A lease says who answers for the thruster; what its `Lease-Id` is
    /// sent with says who does it.
    pub fn by(&self, token: &str, lease: Option<&str>) -> By {
        let one = |who: String| By { words: who.clone(), who };
        match self.lease.as_ref().filter(|held| lease == Some(held.id.as_str())) {
            Some(held) if held.token == token => one(held.who()),
            Some(held) => {
                By { who: token.to_owned(), words: format!("{token} under the lease of {}", held.who()) }
            }
            None => one(token.to_owned()),
        }
    }

    /// Drops a lease whose time is over; true if one was dropped.
    pub fn expire(&mut self, now: Instant) -> bool {
        let over = self.lease.as_ref().is_some_and(|lease| now >= lease.expires);
        if over {
            self.lease = None;
            self.expired += 1;
        }
        over
    }

    /// Drops a lease that was taken by a token of which this says that it may command no more; whose it was.
    pub fn revoke(&mut self, may_command: impl Fn(&str) -> bool) -> Option<String> {
        let lease = self.lease.take_if(|lease| !may_command(&lease.token))?;
        self.expired += 1;
        Some(lease.who())
    }

    /// Leases granted and leases that ran out since start.
    pub fn counts(&self) -> (u64, u64) {
        (self.granted, self.expired)
    }

    /// Takes command, if nobody has it or it is asked for over the holder's head. Returns the lease, and whom it
    /// was taken from.
    pub fn take(
        &mut self,
        thruster: &str,
        wanted: &Wanted,
        now: Instant,
    ) -> Result<(Lease, Option<String>), Problem> {
        let Wanted { holder, token, ttl_ms, takeover } = *wanted;
        self.expire(now);
        let before = match &self.lease {
            Some(lease) if !takeover => return Err(held(thruster, lease, now)),
            Some(lease) => {
                self.taken_over.push_front((lease.id.clone(), holder.to_owned()));
                self.taken_over.truncate(TOLD_MAX);
                Some(lease.holder.clone())
            }
            None => None,
        };
        let ttl = Duration::from_millis(ttl_ms);
        let id = format!("{:032x}", rand::random::<u128>());
        self.granted += 1;
        let (holder, token) = (holder.to_owned(), token.to_owned());
        Ok((self.lease.insert(Lease { id, holder, token, ttl, expires: now + ttl }).clone(), before))
    }

    /// Renews the lease this id names; every accepted command does so.
    pub fn renew(&mut self, thruster: &str, id: Option<&str>, now: Instant) -> Result<Lease, Problem> {
        self.check(thruster, id, now)?;
        let lease = self.lease.as_mut().expect("check found it");
        lease.expires = now + lease.ttl;
        Ok(lease.clone())
    }

    /// Gives command up.
    pub fn give(&mut self, thruster: &str, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        self.check(thruster, id, now)?;
        self.lease = None;
        Ok(())
    }

    /// Who took this lease over, if somebody did.
    pub fn taken_over(&self, id: &str) -> Option<&str> {
        self.taken_over.iter().find(|(lost, _)| lost == id).map(|(_, by)| by.as_str())
    }

    /// Is this the lease in force?
    pub fn check(&mut self, thruster: &str, id: Option<&str>, now: Instant) -> Result<(), Problem> {
        self.expire(now);
        match (&self.lease, id) {
            (Some(lease), Some(id)) if lease.id == id => Ok(()),
            (_, Some(id)) if self.taken_over(id).is_some() => {
                let by = self.taken_over(id).unwrap_or_default();
                Err(Problem::new(
                    Kind::LeaseLost,
                    format!("this lease on {thruster} was taken over by \"{by}\""),
                )
                .hint("speak to them; POST …/lease with takeover takes it back")
                .holder(by))
            }
            (Some(lease), _) => Err(held(thruster, lease, now)),
            (None, Some(_)) => Err(Problem::new(
                Kind::LeaseLost,
                format!("this lease on {thruster} ran out or was given up"),
            )
            .hint(format!(
                "POST /v1/thrusters/{thruster}/lease takes a new one; command faster than its ttl_ms"
            ))),
            (None, None) => Err(Problem::new(Kind::LeaseRequired, "header Lease-Id is missing").hint(
                format!("POST /v1/thrusters/{thruster}/lease, then send its lease_id as header Lease-Id"),
            )),
        }
    }
}

/// Who wants command, and how.
#[derive(Clone, Copy, Debug)]
pub struct Wanted<'a> {
    /// Name the holder gives itself.
    pub holder: &'a str,
    /// Name of the token.
    pub token: &'a str,
    /// Life without a command, ms.
    pub ttl_ms: u64,
    /// Take it from who has it.
    pub takeover: bool,
}

fn held(thruster: &str, lease: &Lease, now: Instant) -> Problem {
    let (holder, left_ms) = (&lease.holder, lease.expires_in_ms(now));
    Problem::new(
        Kind::LeaseHeld,
        format!("thruster {thruster} is commanded by \"{holder}\" for another {left_ms} ms"),
    )
    .hint("send its lease_id as header Lease-Id, wait until it ends, ask the holder to DELETE it, or take it over ({\"takeover\": true})")
    .holder(holder)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn ms(n: u64) -> Duration {
        Duration::from_millis(n)
    }

    fn wants(holder: &str, ttl_ms: u64) -> Wanted<'_> {
        Wanted { holder, token: "local", ttl_ms, takeover: false }
    }

    #[test]
    fn a_takeover_ends_the_lease_before_and_its_holder_is_told() {
        let (mut desk, t0) = (LeaseDesk::default(), Instant::now());
        let (first, nobody) = desk.take("t1", &wants("crashed", 60_000), t0).unwrap();
        assert_eq!(nobody, None);
        let (second, from) =
            desk.take("t1", &Wanted { takeover: true, ..wants("bridge", 500) }, t0 + ms(5)).unwrap();
        assert_eq!(from.as_deref(), Some("crashed"));
        assert!(desk.check("t1", Some(&second.id), t0 + ms(6)).is_ok());
        let told =
            serde_json::to_string(&desk.check("t1", Some(&first.id), t0 + ms(6)).unwrap_err()).unwrap();
        assert!(
            told.contains("lease-lost") && told.contains("taken over") && told.contains("bridge"),
            "{told}"
        );
    }

    #[test]
    fn of_takeovers_in_a_row_each_holder_is_told() {
        let (mut desk, t0) = (LeaseDesk::default(), Instant::now());
        let mut take =
            |holder| desk.take("t1", &Wanted { takeover: true, ..wants(holder, 500) }, t0).unwrap().0.id;
        let lost = ["a", "b", "c"].map(&mut take);
        for _ in 0..TOLD_MAX - 3 {
            take("d");
        }
        assert_eq!(
            lost.map(|id| desk.taken_over(&id).map(str::to_owned)),
            ["b", "c", "d"].map(|by| Some(by.into()))
        );
        for _ in 0..100 {
            desk.take("t1", &Wanted { takeover: true, ..wants("e", 500) }, t0).unwrap();
        }
        assert_eq!(desk.taken_over.len(), TOLD_MAX);
    }

    #[test]
    fn without_the_id_nothing_is_allowed_while_somebody_holds_it() {
        let (mut desk, t0) = (LeaseDesk::default(), Instant::now());
        desk.take("t1", &wants("bench", 500), t0).unwrap();
        let told = serde_json::to_string(&desk.check("t1", None, t0).unwrap_err()).unwrap();
        assert!(told.contains("lease-held") && told.contains(r#""holder":"bench""#), "{told}");
    }

    #[test]
    fn a_second_holder_is_refused_with_the_name_of_the_first() {
        let (mut desk, t0) = (LeaseDesk::default(), Instant::now());
        desk.take("t1", &wants("bench", 500), t0).unwrap();
        let problem = desk.take("t1", &wants("other", 500), t0 + ms(499)).unwrap_err();
        let text = serde_json::to_string(&problem).unwrap();
        assert!(text.contains(r#""holder":"bench""#) && text.contains("409"), "{text}");
        desk.take("t1", &wants("other", 500), t0 + ms(500)).expect("free once the first ran out");
    }

    #[test]
    fn a_renewed_lease_lives_on_and_a_lost_one_does_not_come_back() {
        let (mut desk, t0) = (LeaseDesk::default(), Instant::now());
        let (lease, _) = desk.take("t1", &wants("bench", 100), t0).unwrap();
        for step in 1..50 {
            desk.renew("t1", Some(&lease.id), t0 + ms(99 * step)).unwrap();
        }
        let late = t0 + ms(99 * 49 + 100);
        assert!(desk.renew("t1", Some(&lease.id), late).is_err());
        assert!(desk.renew("t1", Some(&lease.id), t0).is_err(), "an old instant must not revive it");
    }

    proptest! {
        /// Whatever is tried in whatever order, at most one id is ever accepted at one instant.
        #[test]
        fn at_most_one_commander(steps in prop::collection::vec((0u64..3, 0usize..4, 1u64..300), 1..80)) {
            let (mut desk, mut now) = (LeaseDesk::default(), Instant::now());
            let mut ids: Vec<String> = vec!["made-up".into()];
            for (action, who, wait) in steps {
                now += ms(wait);
                match action {
                    0 => if let Ok((lease, _)) = desk.take("t1", &Wanted { takeover: wait % 2 == 0, ..wants("x", 200) }, now) { ids.push(lease.id) },
                    1 => { let _ = desk.renew("t1", ids.get(who).map(String::as_str), now); }
                    _ => { let _ = desk.give("t1", ids.get(who).map(String::as_str), now); }
                }
                let accepted = ids.iter().filter(|id| desk.check("t1", Some(id), now).is_ok()).count();
                prop_assert!(accepted <= 1);
                prop_assert_eq!(accepted == 1, desk.current(now).is_some());
            }
        }
    }
}
