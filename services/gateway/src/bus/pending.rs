//! Requests that wait for their answers.

use std::time::{Duration, Instant};

use kort_proto::messages::{Process, Reply, Request, RequestKind};

use crate::thruster::Ask;

/// A request without an answer is sent again after this time, then after twice as long as before: either way a message
/// may be lost, and servo and controller act on a number once only, see [`kort_proto::messages::Answered`]. A stop whose
/// first message is lost keeps within its 100 ms.
const AGAIN_AFTER: Duration = Duration::from_millis(40);

/// A request that waits for its answers.
pub struct Pending {
    since: Instant,
    again_at: Instant,
    wait: Duration,
    ask: Ask,
    replies: Vec<Reply>,
}

impl Pending {
    pub fn new(ask: Ask, now: Instant) -> Self {
        Self { since: now, again_at: now + AGAIN_AFTER, wait: AGAIN_AFTER, ask, replies: Vec::new() }
    }

    /// Takes an answer; false if it is to another request.
    pub fn take(&mut self, reply: &Reply) -> bool {
        let mine = reply.id == self.ask.request.id;
        if mine {
            self.replies.push(*reply);
        }
        mine
    }

    /// Has everybody answered?
    pub fn complete(&self) -> bool {
        self.silent().is_none()
    }

    /// Is its time over?
    pub fn overdue(&self, now: Instant) -> bool {
        now.duration_since(self.since) >= self.ask.within
    }

    /// The request, where it is time to send it once more, and who has not answered. A revision of the rig is not asked
    /// for twice: it is designed for longer than that.
    pub fn again(&mut self, now: Instant) -> Option<(Request, Process)> {
        let due = now >= self.again_at && self.ask.request.kind != RequestKind::SetRig as u32;
        let silent = self.silent().filter(|_| due)?;
        self.wait *= 2;
        self.again_at = now + self.wait;
        Some((self.ask.request, silent))
    }

    /// Tells the asker what came.
    pub fn finish(self) {
        let _ = self.ask.answer.send(self.replies);
    }

    fn silent(&self) -> Option<Process> {
        let answered = |process: &Process| self.replies.iter().any(|reply| reply.from == *process as u32);
        self.ask.expects.iter().copied().find(|process| !answered(process))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_unanswered_request_is_sent_again_until_all_have_answered() {
        let (answer, mut told) = tokio::sync::oneshot::channel();
        let request = Request { id: 3, kind: RequestKind::Disarm as u32, ..Request::default() };
        let within = Duration::from_millis(700);
        let expects = vec![Process::Servo, Process::Controller];
        let start = Instant::now();
        let at = |ms| start + Duration::from_millis(ms);
        let mut pending = Pending::new(Ask { request, expects, within, answer }, start);
        let reply = |id, from: Process| Reply { id, from: from as u32, ..Reply::default() };
        assert!(!pending.take(&reply(2, Process::Servo)), "an answer to another");
        assert!(pending.take(&reply(3, Process::Controller)));
        assert_eq!(pending.again(at(39)), None);
        assert_eq!(pending.again(at(40)), Some((request, Process::Servo)));
        assert_eq!(pending.again(at(119)), None);
        assert!(pending.again(at(120)).is_some() && pending.again(at(279)).is_none());
        assert!(pending.again(at(280)).is_some() && !pending.complete());
        assert!(pending.take(&reply(3, Process::Servo)) && pending.complete());
        assert_eq!(pending.again(at(650)), None);
        assert!(!pending.overdue(at(699)) && pending.overdue(at(700)));
        pending.finish();
        assert_eq!(told.try_recv().expect("answers").len(), 2);
    }
}
