//! Questions whose answers are due: an answer tells what was at its question or later, however long it was under way.
//!
//! One question is asked at a time, so that answers do not pile up in a device that is slower than it is asked. One
//! that stays without an answer was lost, or its answer is late, and nothing in an answer tells which: it is asked again after
//! twice the way that a lone answer took last, answers are taken for those to the oldest questions, and what is left over
//! then is waited for twice as long before it counts as lost. So a lost answer makes no reading young; a device that becomes slower
//! by more than the patience between two answers may be taken for younger by about one way.

use std::collections::VecDeque;

/// Shortest and longest patience, as parts of a reading's life.
const SHORTEST: u64 = 8;
const LONGEST: u64 = 2;
/// Most questions due: more fit into no reading's life.
const DUE_MAX: usize = 8;

/// Questions on a wire; instants are of CLOCK_MONOTONIC, ns.
#[derive(Clone, Debug)]
pub struct Questions {
    life_ns: u64,
    patience_ns: u64,
    asked_ns: VecDeque<u64>,
    answered_ns: u64,
}

impl Questions {
    /// None asked yet; a reading stands this long.
    pub fn new(life_ns: u64) -> Self {
        let asked_ns = VecDeque::with_capacity(DUE_MAX);
        // A device is slow until it has shown otherwise.
        Self { life_ns, patience_ns: life_ns / LONGEST, asked_ns, answered_ns: 0 }
    }

    /// May something be asked now?
    pub fn may_ask(&mut self, now_ns: u64) -> bool {
        let Some(newest_ns) = self.asked_ns.back().copied() else { return true };
        if self.answered_ns >= newest_ns {
            // Left over after an answer.
            if now_ns.saturating_sub(self.answered_ns) >= 2 * self.patience_ns {
                self.asked_ns.clear();
            }
            return self.asked_ns.is_empty();
        }
        self.asked_ns.len() < DUE_MAX && now_ns.saturating_sub(newest_ns) >= self.patience_ns
    }

    /// Something is asked now.
    pub fn ask(&mut self, now_ns: u64) {
        self.asked_ns.push_back(now_ns);
    }

    /// An answer came: when its question was asked at the latest; none if nothing was asked.
    pub fn answered(&mut self, now_ns: u64) -> Option<u64> {
        let asked_ns = self.asked_ns.pop_front()?;
        self.answered_ns = now_ns;
        if self.asked_ns.is_empty() {
            let way_ns = now_ns.saturating_sub(asked_ns);
            self.patience_ns = (2 * way_ns).clamp(self.life_ns / SHORTEST, self.life_ns / LONGEST);
        }
        Some(asked_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    /// Exchanges every 5 ms over a device that answers one question after the other, each in `takes_ms`, and loses
    /// those that `lost` says. The stamps told, with the true ones and the instants of arrival, ms.
    fn over(takes_ms: impl Fn(u64) -> u64, lost: impl Fn(usize) -> bool) -> Vec<(u64, u64, u64)> {
        let mut questions = Questions::new(50 * MS);
        let (mut asked, mut waiting, mut told) = (0, VecDeque::new(), Vec::new());
        let mut busy_until = 0;
        for now in 0..2000 {
            if let Some((at, ends, heard)) = waiting.front().copied()
                && ends <= now
            {
                waiting.pop_front();
                if heard && let Some(stamp) = questions.answered(now * MS) {
                    told.push((stamp / MS, at, now));
                }
            }
            if now % 5 == 0 && questions.may_ask(now * MS) {
                questions.ask(now * MS);
                busy_until = now.max(busy_until) + takes_ms(now);
                waiting.push_back((now, busy_until, !lost(asked)));
                asked += 1;
            }
        }
        told
    }

    #[test]
    fn an_answer_is_as_old_as_its_question_however_slow_the_device() {
        for takes in [1, 4, 8, 12, 20, 24] {
            let told = over(|_| takes, |_| false);
            let per_answer = takes.div_ceil(5) * 5;
            assert!(told.len() as u64 >= 1900 / per_answer, "{takes}: {}", told.len());
            assert!(told.iter().all(|(stamp, at, _)| stamp == at), "{takes}: {told:?}");
            assert!(told.iter().all(|(_, at, now)| now - at <= takes), "{takes}: answers pile up: {told:?}");
        }
        // One that becomes slower on the way.
        let told = over(|now| if now < 700 { 1 } else { 9 }, |_| false);
        assert!(told.iter().all(|(stamp, at, _)| stamp == at), "{told:?}");
    }

    /// Three lost in a row are no silence, and no answer is told younger than it is; the next are on time again.
    #[test]
    fn lost_answers_are_asked_for_again_and_make_no_reading_young() {
        for takes in [1, 4] {
            let told = over(|_| takes, |n| (5..8).contains(&(n % 20)));
            assert!(told.iter().all(|(stamp, at, _)| stamp <= at), "{takes}: {told:?}");
            assert!(told.windows(2).all(|w| w[1].2 - w[0].2 < 50), "{takes}: {told:?}");
            let exact = told.iter().filter(|(stamp, at, _)| stamp == at).count();
            assert!(exact * 10 > told.len() * 8, "{takes}: {exact} of {}", told.len());
        }
    }

    #[test]
    fn what_was_not_asked_for_is_no_answer() {
        let mut questions = Questions::new(50 * MS);
        assert_eq!(questions.answered(MS), None);
        questions.ask(2 * MS);
        assert_eq!(questions.answered(3 * MS), Some(2 * MS));
        assert_eq!(questions.answered(4 * MS), None);
    }
}
