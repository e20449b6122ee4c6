//! What is done to a thruster, on its way to the event log.

use std::time::Instant;

use kort_proto::events::EventKind;

use super::{Thruster, lock};
use crate::lease::By;

impl Thruster {
    /// Something was done: it is noted, and the lease it was done with lives on.
    pub fn did(&self, who: &str, lease: Option<&str>, kind: EventKind, what: &str) {
        let now = Instant::now();
        let mut desk = self.desk();
        let By { who, words } = desk.lease.by(who, lease);
        desk.done(lease, now);
        desk.note(kind, &who, format!("{words} {what}"));
        drop(desk);
        self.tell_notes(now);
    }

    /// What the desk noted goes to the event log.
    pub fn tell_notes(&self, now: Instant) {
        let _in_turn = lock(&self.telling);
        let notes = {
            let mut desk = self.desk();
            desk.expire(now);
            desk.notes()
        };
        for note in notes {
            self.events.tell(note.kind, Some(&self.id), &note.who, note.detail);
        }
    }

    /// Waits until what was told of is in the event log.
    pub async fn written(&self) {
        self.events.written().await;
    }
}
