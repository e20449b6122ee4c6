//! Which messages are new.

use super::Header;

/// Only *new* messages pass: of one sender's session, of a growing sequence, stamped within `life_ns` and not in the
/// future. A new session passes if it is younger.
#[derive(Clone, Copy, Debug, Default)]
pub struct Freshness {
    session: u64,
    sequence: u64,
}

/// What [`Freshness::check`] says of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fresh {
    /// Next message of the known sender.
    Yes,
    /// First message of a younger sender.
    NewSession,
    /// Repeated, reordered, too old, from the future, or from a sender that was replaced.
    No,
}

impl Freshness {
    /// Judges a message and remembers it if it is new.
    pub fn check(&mut self, header: &Header, now_ns: u64, life_ns: u64) -> Fresh {
        // One clock on one machine: a stamp ahead of ours by more than a scheduling hiccup is wrong.
        let in_time = header.stamp_ns <= now_ns.saturating_add(1_000_000)
            && now_ns.saturating_sub(header.stamp_ns) <= life_ns;
        if !in_time || header.session < self.session || header.session > header.stamp_ns {
            return Fresh::No;
        }
        if header.session > self.session {
            *self = Self { session: header.session, sequence: header.sequence };
            return Fresh::NewSession;
        }
        if header.sequence <= self.sequence {
            return Fresh::No;
        }
        self.sequence = header.sequence;
        Fresh::Yes
    }

    /// Session of the sender in force; zero before the first message.
    pub fn session(&self) -> u64 {
        self.session
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn header(sequence: u64, stamp_ns: u64, session: u64) -> Header {
        Header { sequence, stamp_ns, session }
    }

    #[test]
    fn only_new_messages_pass() {
        let mut f = Freshness::default();
        assert_eq!(f.check(&header(1, 1_000, 500), 1_000, 100), Fresh::NewSession);
        assert_eq!(f.check(&header(1, 1_000, 500), 1_010, 100), Fresh::No, "repeated");
        assert_eq!(f.check(&header(2, 1_020, 500), 1_200, 100), Fresh::No, "too old");
        assert_eq!(f.check(&header(2, 1_020, 500), 1_050, 100), Fresh::Yes);
        assert_eq!(f.check(&header(3, 9_000_000, 500), 1_060, 100), Fresh::No, "from the future");
        assert_eq!(f.check(&header(9, 1_060, 400), 1_060, 100), Fresh::No, "replaced sender");
        assert_eq!(f.check(&header(1, 1_070, 600), 1_070, 100), Fresh::NewSession);
        assert_eq!(f.check(&header(3, 1_080, 500), 1_080, 100), Fresh::No, "the old sender again");
    }

    proptest! {
        #[test]
        fn a_message_passes_at_most_once(headers in prop::collection::vec((0u64..5, 0u64..50, 1u64..4), 1..60)) {
            let mut f = Freshness::default();
            let mut passed = std::collections::HashSet::new();
            for (sequence, stamp, session) in headers {
                let h = header(sequence, stamp + session, session);
                if f.check(&h, 50, 50) != Fresh::No {
                    prop_assert!(passed.insert((h.session, h.sequence)));
                }
            }
        }
    }
}
