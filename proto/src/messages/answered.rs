//! Requests that were answered already.

use super::{Reply, Request};

/// The last answers given. Who hears no answer in time asks again with the same number: what was done is then told
/// again, and not done again.
#[derive(Clone, Copy, Debug, Default)]
pub struct Answered {
    replies: [Reply; 4],
    next: usize,
}

impl Answered {
    /// The answer that this request has had. One without a number (0) is never the same as another.
    pub fn to(&self, request: &Request) -> Option<Reply> {
        let same = |reply: &&Reply| reply.id == request.id && reply.to_session == request.header.session;
        self.replies.iter().filter(|_| request.id != 0).find(same).copied()
    }

    /// Remembers an answer, and forgets the oldest.
    pub fn keep(&mut self, reply: &Reply) {
        if let Some(oldest) = self.replies.get_mut(self.next) {
            *oldest = *reply;
        }
        self.next = (self.next + 1) % self.replies.len();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{Header, Outcome, Process};

    #[test]
    fn the_last_four_answers_are_told_again() {
        let request = |id, session| Request {
            id,
            header: Header { session, ..Header::default() },
            ..Request::default()
        };
        let mut answered = Answered::default();
        assert_eq!(answered.to(&request(0, 0)), None, "a request without a number");
        for id in 1..=5 {
            let reply =
                Reply::to(&request(id, 7), Process::Servo, Outcome::Done, format_args!("answer {id}"));
            answered.keep(&reply);
            assert_eq!(answered.to(&request(id, 7)), Some(reply));
        }
        assert_eq!(answered.to(&request(1, 7)), None, "the fifth before last");
        assert_eq!(answered.to(&request(5, 8)), None, "another asker");
        assert!((2..=5).all(|id| answered.to(&request(id, 7)).is_some()));
    }
}
