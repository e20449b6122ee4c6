//! What the drive's two answers to a SYNC say, and when both make a reading.

use super::state::State;

/// A reading, in the drive's units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Thousandths of the rated torque.
    pub torque: i16,
    /// Position, with all turns of its counter.
    pub position: i64,
    /// Speed.
    pub speed: i32,
}

/// Gathers answers.
#[derive(Clone, Copy, Debug, Default)]
pub struct Told {
    /// State told last.
    pub state: Option<State>,
    torque: Option<i16>,
    moving: Option<(i32, i32)>,
    /// The position told last, and all turns of its counter with it.
    before: Option<(i32, i64)>,
}

impl Told {
    /// Status (2 bytes), mode (1), torque (2); false for what is something else.
    pub fn first(&mut self, data: &[u8]) -> bool {
        let &[low, high, _mode, a, b] = data else { return false };
        self.state = Some(State::of(u16::from_le_bytes([low, high])));
        self.torque = Some(i16::from_le_bytes([a, b]));
        true
    }

    /// Position (4 bytes), speed (4).
    pub fn second(&mut self, data: &[u8]) -> bool {
        let &[a, b, c, d, e, f, g, h] = data else { return false };
        self.moving = Some((i32::from_le_bytes([a, b, c, d]), i32::from_le_bytes([e, f, g, h])));
        true
    }

    /// The reading, once both were told; each counts once.
    pub fn take(&mut self) -> Option<(State, Reading)> {
        let (state, torque, (position, speed)) = (self.state?, self.torque?, self.moving?);
        self.forget();
        // Its counter turns over; the angle does not.
        let travelled = match self.before {
            None => position.into(),
            Some((before, travelled)) => travelled.saturating_add(position.wrapping_sub(before).into()),
        };
        self.before = Some((position, travelled));
        Some((state, Reading { torque, position: travelled, speed }))
    }

    /// What was told counts no more.
    pub fn forget(&mut self) {
        (self.torque, self.moving) = (None, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_answer_again_and_again_is_no_reading_and_the_counter_turns_over() {
        let mut told = Told::default();
        let second = |position: i32| {
            let mut data = position.to_le_bytes().to_vec();
            data.extend(5i32.to_le_bytes());
            data
        };
        assert!(told.second(&second(i32::MAX)) && told.second(&second(i32::MAX)));
        assert_eq!(told.take(), None);
        assert!(told.first(&[0x37, 0x12, 10, 0xff, 0xff]));
        let reading = Reading { torque: -1, position: i64::from(i32::MAX), speed: 5 };
        assert_eq!(told.take(), Some((State::Enabled, reading)));
        assert_eq!(told.take(), None);
        assert!(told.first(&[0x37, 0x12, 10, 0, 0]) && told.second(&second(i32::MIN)));
        assert_eq!(told.take().map(|(_, r)| r.position), Some(i64::from(i32::MAX) + 1));
        assert!(!told.first(&[0x37, 0x12]) && !told.second(&[]));
    }
}
