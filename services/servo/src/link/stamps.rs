//! How old a reading is: the oldest that it can be by all that is known, so that what comes late never passes for new.

use std::collections::VecDeque;

use super::Ages;
use super::questions::Questions;

/// Exchanges from mark to mark, where there are no strangers.
const MARK_EVERY: u32 = 4;
/// Most exchanges that may be due: some seconds at any rate, which no reading's life is.
const DUE_MAX: usize = 4096;
/// What two clocks may drift apart, ns a second.
const DRIFT_NS_S: i64 = 200_000;

/// The instants of what was said, on CLOCK_MONOTONIC, ns.
#[derive(Clone, Debug)]
pub struct Stamps {
    ages: Ages,
    /// Questions, or marks, that are due.
    questions: Questions,
    /// Exchanges that are due.
    due_ns: VecDeque<u64>,
    since_mark: u32,
    /// When the last mark that was answered was asked.
    marked_ns: Option<u64>,
    /// More answers come than exchanges were made: another servo's are answered too, and counting tells nothing.
    strangers: bool,
    /// What our clock is ahead of the device's, at least by what it answered and at most by what came soonest, each with
    /// the instant of that, ns.
    least_ahead: Option<(i64, u64)>,
    most_ahead: Option<(i64, u64)>,
}

impl Stamps {
    /// Nothing said yet; a reading stands this long.
    pub fn new(ages: Ages, life_ns: u64) -> Self {
        Self {
            ages,
            questions: Questions::new(life_ns),
            due_ns: VecDeque::new(),
            since_mark: MARK_EVERY,
            marked_ns: None,
            strangers: false,
            least_ahead: None,
            most_ahead: None,
        }
    }

    /// A new conversation: nothing is due.
    pub fn forget(&mut self, life_ns: u64) {
        *self = Self::new(self.ages, life_ns);
    }

    /// An exchange is made now: is it to hold a question?
    pub fn exchange(&mut self, now_ns: u64) -> bool {
        self.since_mark = self.since_mark.saturating_add(1);
        let turn = match self.ages {
            Ages::Questions => true,
            Ages::Exchanges => {
                if self.due_ns.len() < DUE_MAX {
                    self.due_ns.push_back(now_ns);
                }
                self.strangers || self.since_mark >= MARK_EVERY
            }
            Ages::Clock => self.since_mark >= MARK_EVERY,
            Ages::Unknown => return true,
        };
        let asks = turn && self.questions.may_ask(now_ns);
        if asks {
            self.since_mark = 0;
            self.questions.ask(now_ns);
        }
        asks
    }

    /// A mark was answered, by the device's clock then, us, if it tells one.
    pub fn marked(&mut self, now_ns: u64, clock_us: Option<u64>) {
        let Some(asked_ns) = self.questions.answered(now_ns) else { return };
        self.marked_ns = Some(asked_ns);
        // What was sent before it has come, or is lost. The answer to its own exchange may come before or behind it: after a
        // loss readings are told older by one exchange from there on.
        while self.due_ns.front().is_some_and(|due_ns| *due_ns < asked_ns) {
            self.due_ns.pop_front();
        }
        if let Some(clock_us) = clock_us {
            let ahead = ahead_of(clock_us, asked_ns);
            let before = self.least_ahead.map(|(ahead, at_ns)| ahead.saturating_sub(drift(at_ns, now_ns)));
            self.least_ahead = Some((before.map_or(ahead, |before| before.max(ahead)), now_ns));
        }
    }

    /// A reading came, by the device's clock if it tells one: when it was taken at the latest that is sure; none if nothing
    /// was asked.
    pub fn reading(&mut self, now_ns: u64, clock_us: Option<u64>) -> Option<u64> {
        match self.ages {
            Ages::Questions => self.questions.answered(now_ns),
            Ages::Exchanges => match self.due_ns.pop_front() {
                Some(due_ns) if !self.strangers => Some(due_ns),
                Some(_) => self.marked_ns,
                None => {
                    self.strangers = true;
                    self.marked_ns
                }
            },
            Ages::Clock => Some(self.by_clock(now_ns, clock_us)),
            Ages::Unknown => Some(now_ns),
        }
    }

    fn by_clock(&mut self, now_ns: u64, clock_us: Option<u64>) -> u64 {
        let Some(clock_us) = clock_us else { return now_ns };
        let ahead = ahead_of(clock_us, now_ns);
        let before = self.most_ahead.map(|(ahead, at_ns)| ahead.saturating_add(drift(at_ns, now_ns)));
        let most = before.map_or(ahead, |before| before.min(ahead));
        self.most_ahead = Some((most, now_ns));
        let least =
            self.least_ahead.map_or(most, |(ahead, at_ns)| ahead.saturating_sub(drift(at_ns, now_ns)));
        let clock_ns = i64::try_from(clock_us.saturating_mul(1000)).unwrap_or(i64::MAX);
        let stamp_ns = clock_ns.saturating_add(least.min(most));
        u64::try_from(stamp_ns).unwrap_or(0).min(now_ns)
    }
}

/// What our clock is ahead of the device's, ns.
fn ahead_of(clock_us: u64, now_ns: u64) -> i64 {
    let signed = |ns: u64| i64::try_from(ns).unwrap_or(i64::MAX);
    signed(now_ns).saturating_sub(signed(clock_us.saturating_mul(1000)))
}

/// What the clocks may have drifted apart since then, ns.
fn drift(at_ns: u64, now_ns: u64) -> i64 {
    let passed_us = i64::try_from(now_ns.saturating_sub(at_ns) / 1000).unwrap_or(i64::MAX);
    passed_us.saturating_mul(DRIFT_NS_S / 1000) / 1000
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;
    const LIFE: u64 = 50 * MS;

    /// What comes to us: a reading, taken at an instant, or the answer to a mark.
    enum Comes {
        Reading(u64),
        Mark,
    }

    /// Exchanges every 5 ms with a drive whose answers are `late(now)` ms under way, in order; it loses the readings that
    /// `lost` says and answers another servo's exchanges too, 2 ms after each of ours, if there are `strangers`. Stamps
    /// told, true ones and arrivals, ms.
    fn exchanged(
        late: impl Fn(u64) -> u64,
        lost: impl Fn(u64) -> bool,
        strangers: bool,
    ) -> Vec<(u64, u64, u64)> {
        let mut stamps = Stamps::new(Ages::Exchanges, LIFE);
        let (mut wire, mut told) = (VecDeque::<(u64, Comes)>::new(), Vec::new());
        for now in 0..2000 {
            while wire.front().is_some_and(|(at, _)| *at <= now) {
                let Some((_, comes)) = wire.pop_front() else { break };
                match comes {
                    Comes::Mark => stamps.marked(now * MS, None),
                    Comes::Reading(at) => {
                        told.extend(stamps.reading(now * MS, None).map(|stamp| (stamp / MS, at, now)));
                    }
                }
            }
            let arrives = wire.back().map_or(0, |(at, _)| *at).max(now + late(now));
            if now % 5 == 0 {
                let mark = stamps.exchange(now * MS);
                if !lost(now / 5) {
                    wire.push_back((arrives, Comes::Reading(now)));
                }
                if mark {
                    wire.push_back((arrives, Comes::Mark));
                }
            }
            if strangers && now % 5 == 2 {
                wire.push_back((arrives, Comes::Reading(now)));
            }
        }
        told
    }

    #[test]
    fn an_answer_that_is_later_than_the_next_exchange_is_as_old_as_its_own() {
        for late in [1, 4, 7, 12, 33] {
            let told = exchanged(|_| late, |_| false, false);
            assert!(told.len() > 380 && told.iter().all(|(stamp, at, _)| stamp == at), "{late}: {told:?}");
        }
        // A wire that stands still for 60 ms, and then brings all at once.
        let told =
            exchanged(|now| if now < 700 { 2 } else { 760_u64.saturating_sub(now).max(2) }, |_| false, false);
        assert!(told.iter().all(|(stamp, at, _)| stamp == at), "{told:?}");
    }

    #[test]
    fn lost_answers_make_none_young_and_marks_keep_the_error_within_an_exchange() {
        for late in [1, 12] {
            let told = exchanged(|_| late, |n| n % 20 == 7, false);
            // Those between the loss and the next mark may be one more behind.
            assert!(told.iter().all(|(stamp, at, _)| stamp <= at && at - stamp <= 10), "{late}: {told:?}");
        }
    }

    #[test]
    fn answers_to_another_servo_are_told_by_the_last_mark() {
        for late in [1, 7, 12] {
            let told = exchanged(|_| late, |_| false, true);
            // Until it shows that there is another one.
            let told = &told[8..];
            assert!(told.iter().all(|(stamp, at, _)| stamp <= at), "{late}: {told:?}");
            assert!(told.iter().all(|(stamp, _, now)| now - stamp <= 10 + 2 * late), "{late}: {told:?}");
        }
    }

    /// The device's clock is 1000 s behind ours, and 100 us a second too fast.
    #[test]
    fn what_carries_a_clock_is_not_younger_than_it_is() {
        let clock_us = |now_ms: u64| (now_ms * 1000) + now_ms / 10;
        for (answers, within_ms) in [(true, 3), (false, 2)] {
            let mut stamps = Stamps::new(Ages::Clock, LIFE);
            let begin_ms = 1_000_000;
            let mut asked = None;
            for now in (0..20_000).step_by(5) {
                // A wire that takes 2 ms, but 90 in one second of five.
                let late = if now % 5000 >= 4000 { 90 } else { 2 };
                let ours = |at: u64| (begin_ms + at) * MS;
                if let Some(at) = asked.filter(|at| at + 4 <= now && late == 2) {
                    asked = None;
                    stamps.marked(ours(now), Some(clock_us(at + 2)));
                }
                if stamps.exchange(ours(now)) && answers {
                    asked = Some(now);
                }
                let taken = now.saturating_sub(late);
                let stamp = stamps.reading(ours(now), Some(clock_us(taken))).unwrap();
                let told_ms = (stamp / MS).saturating_sub(begin_ms);
                if now > 100 {
                    assert!(told_ms <= taken + if answers { 0 } else { 2 }, "{now}: {told_ms}");
                    assert!(told_ms + within_ms + 4 >= taken, "{now}: {told_ms} for {taken}");
                }
            }
        }
    }

    #[test]
    fn no_clock_is_too_large() {
        for ages in [Ages::Questions, Ages::Exchanges, Ages::Clock, Ages::Unknown] {
            let mut stamps = Stamps::new(ages, LIFE);
            for now_ns in [0, 10 * MS, MS, u64::MAX / 4] {
                stamps.exchange(now_ns);
                stamps.marked(now_ns, Some(u64::MAX));
                stamps.reading(now_ns, Some(u64::MAX));
                stamps.reading(now_ns, Some(0));
            }
        }
    }
}
