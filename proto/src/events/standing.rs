//! Which faults stand, by what a log tells.

use std::collections::BTreeMap;

use super::{Event, EventKind};
use crate::faults::Fault;

/// How the faults came that stand now, by the events of a log: of each thruster those since it was last cleared, for before
/// that the log speaks of an earlier time. However much is told later, they stand.
#[derive(Debug, Default)]
pub struct Standing(BTreeMap<String, (u64, Vec<Event>)>);

impl Standing {
    /// Takes an event into account; in what order they come does not matter.
    pub fn take(&mut self, event: &Event) {
        let Some(thruster) = &event.thruster else { return };
        let (cleared, latched) = self.0.entry(thruster.clone()).or_default();
        if event.kind == EventKind::FaultsCleared {
            *cleared = event.id.max(*cleared);
            latched.retain(|known| known.id > *cleared);
        } else if event.kind.latches() && event.id > *cleared {
            latched.retain(|known| known.fault != event.fault || known.id >= event.id);
            if latched.iter().all(|known| known.fault != event.fault) {
                latched.push(event.clone());
            }
        }
    }

    /// How a fault of a thruster came; none if it does not stand.
    pub fn of(&self, thruster: &str, fault: Fault) -> Option<&Event> {
        let (_, latched) = self.0.get(thruster)?;
        latched.iter().find(|event| event.fault == Some(fault.code()))
    }
}

impl<'a> FromIterator<&'a Event> for Standing {
    fn from_iter<T: IntoIterator<Item = &'a Event>>(log: T) -> Self {
        let mut standing = Self::default();
        log.into_iter().for_each(|event| standing.take(event));
        standing
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_cleared_stands_no_more_whatever_comes_out_of_turn() {
        let tripped = || Event::now(EventKind::Tripped, Some("t1"), "servo", "").fault(Fault::ServoLost);
        let (first, second) = (tripped(), tripped());
        let cleared = Event::now(EventKind::FaultsCleared, Some("t1"), "bench", "");
        let third = tripped();
        let standing: Standing = [&second, &first].into_iter().collect();
        assert_eq!(standing.of("t1", Fault::ServoLost), Some(&second), "the last of them");
        assert_eq!(standing.of("t2", Fault::ServoLost), None);
        assert_eq!(standing.of("t1", Fault::GatewayLost), None);
        let standing: Standing = [&cleared, &first, &second].into_iter().collect();
        assert_eq!(standing.of("t1", Fault::ServoLost), None);
        let standing: Standing = [&first, &third, &cleared].into_iter().collect();
        assert_eq!(standing.of("t1", Fault::ServoLost), Some(&third));
    }
}
