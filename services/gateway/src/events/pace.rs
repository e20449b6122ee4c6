//! Whoever repeats the same thing, which needs no lease, wipes no log with it: repeats become one event with a count.

use std::collections::HashMap;
use std::time::{Duration, Instant};

use kort_proto::events::{Event, EventKind};

/// How long repeats are gathered before they are told; each time they go on, twice as long.
const HOLD: Duration = Duration::from_secs(1);
const HOLD_MAX: Duration = Duration::from_secs(60);
/// Events of one kind that say different things and are told one by one all the same.
const BURST: f64 = 5.0;
/// Names that events of one kind are told apart by; a holder's name is as its client likes.
const NAMES: usize = 8;

/// What was told lately, and what is held back.
#[derive(Debug, Default)]
pub struct Pace(HashMap<Key, Lately>);

/// Whose events are gathered together; no name where there are too many.
type Key = (EventKind, Option<String>, Option<String>);

#[derive(Debug)]
struct Lately {
    told: Instant,
    detail: Option<String>,
    /// How many that say something else may be told at once, and since when that grows.
    credit: f64,
    credited: Instant,
    hold: Duration,
    held: Option<Held>,
}

/// Repeats that are not told yet.
#[derive(Debug)]
struct Held {
    began: Instant,
    /// Wall time of the first.
    since: String,
    times: u64,
    newest: Event,
}

impl Pace {
    /// An event that came: to be told now, or held back.
    pub fn take(&mut self, event: Event, now: Instant) -> Option<Event> {
        let key = self.key(&event);
        let new = || Lately { told: now, detail: None, credit: BURST, credited: now, hold: HOLD, held: None };
        let lately = self.0.entry(key).or_insert_with(new);
        let since = now.saturating_duration_since(lately.credited);
        lately.credit = BURST.min(lately.credit + since.div_duration_f64(lately.hold));
        lately.credited = now;
        let same = lately.detail.as_ref() == Some(&event.detail);
        let quiet = now.saturating_duration_since(lately.told) >= lately.hold && lately.held.is_none();
        let at_once = if same { quiet } else { lately.credit >= 1.0 };
        if at_once {
            lately.told = now;
            lately.detail = Some(event.detail.clone());
            lately.credit -= 1.0;
            return Some(event);
        }
        let held = lately.held.get_or_insert_with(|| Held {
            began: now,
            since: event.time.clone(),
            times: 0,
            newest: event.clone(),
        });
        held.times += 1;
        held.newest = event;
        None
    }

    /// What was held back long enough, or all of it: one event each, of now, for whoever asks on from the last it knows
    /// must not miss it.
    pub fn due(&mut self, now: Instant, all: bool) -> Vec<Event> {
        let mut due = Vec::new();
        for lately in self.0.values_mut() {
            let ripe = |held: &mut Held| all || now.saturating_duration_since(held.began) >= lately.hold;
            let Some(Held { since, times, newest, .. }) = lately.held.take_if(ripe) else { continue };
            lately.told = now;
            lately.hold = HOLD_MAX.min(2 * lately.hold);
            let Event { kind, thruster, who, detail, .. } = newest;
            let words = if times == 1 { detail } else { format!("{detail}; {times} times since {since}") };
            let event = Event::now(kind, thruster.as_deref(), &who, words).since(since);
            due.push(Event { times: (times > 1).then_some(times), ..event });
        }
        self.0.retain(|_, lately| {
            lately.held.is_some() || now.saturating_duration_since(lately.told) < lately.hold.mul_f64(BURST)
        });
        due
    }

    fn key(&self, event: &Event) -> Key {
        let key = (event.kind, event.thruster.clone(), Some(event.who.clone()));
        let alike = || self.0.keys().filter(|(kind, of, _)| *kind == key.0 && *of == key.1).count();
        if self.0.contains_key(&key) || alike() < NAMES { key } else { (key.0, key.1, None) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stop(who: &str, detail: &str) -> Event {
        Event::now(EventKind::Stopped, None, who, detail)
    }

    /// Five minutes of 500 a second, and how many are told of them.
    #[test]
    fn repeats_are_counted_and_what_says_something_else_is_told_at_once() {
        let (mut pace, begun) = (Pace::default(), Instant::now());
        let (mut told, mut counted) = (0, 0);
        for n in 0..150_000u32 {
            let now = begun + n * Duration::from_millis(2);
            let at_once = pace.take(stop("local", "stopped"), now).map_or(0, |_| 1);
            // What says something else is told again behind what said otherwise.
            assert_eq!(at_once, u64::from(n == 0 || n == 75_001), "{n}");
            let due = pace.due(now, false);
            told += at_once + due.len() as u64;
            counted += at_once + due.iter().map(|event| event.times.unwrap_or(1)).sum::<u64>();
            if n == 75_000 {
                assert!(pace.take(stop("local", "stopped; t1 was armed"), now).is_some());
                assert!(pace.take(stop("bridge", "stopped"), now).is_some(), "another");
                assert!(pace.take(Event::now(EventKind::Armed, None, "local", ""), now).is_some());
            }
        }
        let rest = pace.due(begun, true);
        counted += rest.iter().map(|event| event.times.unwrap_or(1)).sum::<u64>();
        assert!(told < 20 && counted >= 150_000, "{told} {counted}");
    }

    #[test]
    fn other_words_and_other_names_are_no_way_round() {
        let (mut pace, now) = (Pace::default(), Instant::now());
        let words = (0..100).filter_map(|n| pace.take(stop("local", &n.to_string()), now)).count();
        assert_eq!(words, BURST as usize);
        let names = (0..100).filter_map(|n| pace.take(stop(&n.to_string(), &n.to_string()), now)).count();
        assert_eq!(names, NAMES - 1 + BURST as usize);
        let due = pace.due(now + HOLD, false);
        assert_eq!(due.iter().map(|event| event.times.unwrap_or(1)).sum::<u64>(), 200 - 5 - 12);
        assert!(due.iter().all(|event| event.since.is_some()), "{due:?}");
        assert!(pace.due(now + HOLD_MAX, false).is_empty() && pace.0.is_empty(), "nothing is kept of it");
    }
}
